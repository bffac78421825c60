//! Groups the rows of a leaf, so that few remain: equal rows are counted, and aggregates of them
//! are computed.

use std::cell::RefCell;
use std::cmp::Ordering;
use std::collections::HashMap;
use std::sync::Arc;

use oxigraph::model::Literal;

use crate::vertical::column::Value;
use crate::vertical::expression::Native;
use crate::vertical::join::Rows;
use crate::vertical::stop::{Stop, unfit};
use crate::vertical::value::Cell;

/// Largest number of values that are kept: they take about a gigabyte.
const MOST_VALUES: usize = 12_000_000;
/// Largest size of a text. Unit: bytes.
const LONGEST_TEXT: usize = 1 << 20;
/// Largest size of all texts. Unit: bytes.
const MOST_TEXT: usize = 256 << 20;
/// Number of rows from which those that can't be among the first are removed.
const MANY_ROWS: usize = 4096;

/// The values that remain of the rows of a leaf.
#[derive(Debug, Clone, Default)]
pub(super) struct Output {
    /// Places whose values remain.
    pub keys: Vec<usize>,
    pub aggregates: Vec<(Kind, Native)>,
    /// Whether equal rows become one row with their number.
    pub grouped: bool,
    /// Keys of the order, each with whether it is descending, and the number of first rows that are
    /// needed.
    pub first: Option<(Vec<(Native, bool)>, usize)>,
    /// Number of rows of which any are needed.
    pub any: Option<usize>,
}

/// An aggregate.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Kind {
    /// Number of values.
    Count,
    Sum,
    Least,
    Greatest,
    /// Texts with this separator between them.
    Joined(Arc<str>),
}

/// A sum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Sum {
    Integer(i64),
    Double(f64),
}

impl Sum {
    /// Returns `None` if the sum is too large.
    fn plus(self, other: Self) -> Option<Self> {
        Some(match (self, other) {
            (Self::Integer(one), Self::Integer(other)) => Self::Integer(one.checked_add(other)?),
            (one, other) => Self::Double(one.double() + other.double()),
        })
    }

    fn double(self) -> f64 {
        match self {
            Self::Integer(number) => number as f64,
            Self::Double(number) => number,
        }
    }

    fn value(self) -> Value {
        match self {
            Self::Integer(number) => Value::Integer(number),
            Self::Double(number) => Value::Double(number.to_bits()),
        }
    }
}

/// The state of an aggregate; `None` in it if a value was missing.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum State<T> {
    Count(u64),
    Sum(Option<Sum>),
    Best(Option<T>),
    Joined(Option<String>),
}

/// A row that remains: its values, the number of equal ones, and its aggregates.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Reduced {
    pub values: Vec<Option<Value>>,
    pub count: u64,
    pub states: Vec<State<Value>>,
    /// The keys of the order.
    order: Vec<Option<Value>>,
}

impl Reduced {
    /// The results of its aggregates.
    pub(super) fn results(&self) -> impl Iterator<Item = Option<Value>> {
        self.states.iter().map(|state| match state {
            State::Count(count) => i64::try_from(*count).ok().map(Value::Integer),
            State::Sum(sum) => sum.map(Sum::value),
            State::Best(best) => best.clone(),
            State::Joined(text) => text
                .as_ref()
                .map(|text| Value::Term(Literal::new_simple_literal(text).into())),
        })
    }
}

/// Reduces the rows of one file.
pub(super) fn reduced(rows: &Rows<'_>, output: &Output) -> Result<Vec<Reduced>, Stop> {
    if let Some((keys, most)) = &output.first {
        return first(rows, output, keys, *most);
    }
    if !output.grouped {
        let most = output.any.unwrap_or(usize::MAX);
        return (0..rows.len.min(most))
            .map(|row| single(rows, output, row, Vec::new()))
            .collect();
    }
    let mut groups: HashMap<Vec<u32>, usize> = HashMap::new();
    let mut found: Vec<(usize, u64, Vec<State<Cell<'_>>>)> = Vec::new();
    let mut key = Vec::with_capacity(output.keys.len());
    for row in 0..rows.len {
        key.clear();
        key.extend(output.keys.iter().map(|place| rows.codes[*place][row]));
        let at = match groups.get(&key) {
            Some(at) => *at,
            None => {
                groups.insert(key.clone(), found.len());
                found.push((
                    row,
                    0,
                    output
                        .aggregates
                        .iter()
                        .map(|(kind, _)| empty(kind))
                        .collect(),
                ));
                found.len() - 1
            }
        };
        let (_, count, states) = &mut found[at];
        *count += 1;
        for ((kind, expression), state) in output.aggregates.iter().zip(states) {
            add(kind, state, expression.value(rows, row)?, *count == 1)?;
        }
    }
    found
        .into_iter()
        .map(|(row, count, states)| {
            let mut reduced = single(rows, output, row, Vec::new())?;
            reduced.count = count;
            reduced.states = states.into_iter().map(owned).collect::<Result<_, Stop>>()?;
            Ok(reduced)
        })
        .collect()
}

fn single(
    rows: &Rows<'_>,
    output: &Output,
    row: usize,
    order: Vec<Option<Value>>,
) -> Result<Reduced, Stop> {
    let values = output
        .keys
        .iter()
        .map(|place| rows.value(*place, rows.codes[*place][row]));
    Ok(Reduced {
        values: values.collect::<Result<_, Stop>>()?,
        count: 1,
        states: Vec::new(),
        order,
    })
}

fn empty<T>(kind: &Kind) -> State<T> {
    match kind {
        Kind::Count => State::Count(0),
        Kind::Sum => State::Sum(Some(Sum::Integer(0))),
        Kind::Least | Kind::Greatest => State::Best(None),
        Kind::Joined(_) => State::Joined(Some(String::new())),
    }
}

/// Adds a value to an aggregate. `is_first`: whether it is the first one.
fn add<'a>(
    kind: &Kind,
    state: &mut State<Cell<'a>>,
    value: Option<Cell<'a>>,
    is_first: bool,
) -> Result<(), Stop> {
    match state {
        State::Count(count) => *count += u64::from(value.is_some()),
        State::Sum(sum) => {
            *sum = match (*sum, value) {
                (Some(sum), Some(Cell::Integer(number))) => sum.plus(Sum::Integer(number)),
                (Some(sum), Some(Cell::Double(number))) => sum.plus(Sum::Double(number)),
                (Some(_), Some(Cell::Decimal(_) | Cell::Other(_))) => {
                    return unfit("a sum of values of a rare type");
                }
                _ => None,
            }
        }
        State::Joined(text) => match (&mut *text, value) {
            (Some(text), Some(Cell::Text(further))) => join(text, kind, is_first, &further)?,
            (Some(_), Some(Cell::Other(_) | Cell::Decimal(_))) => {
                return unfit("a list of values of a rare type");
            }
            // As in the evaluator, the list is an error if a value is not a text.
            _ => *text = None,
        },
        State::Best(best) => match (&best, value) {
            (_, None) => *best = None,
            (None, value) => *best = value.filter(|_| is_first),
            (Some(known), Some(value)) => {
                if value.order(known)? == wanted(kind) {
                    *best = Some(value);
                }
            }
        },
    }
    Ok(())
}

fn join(text: &mut String, kind: &Kind, is_first: bool, further: &str) -> Result<(), Stop> {
    if let Kind::Joined(separator) = kind
        && !is_first
    {
        text.push_str(separator);
    }
    text.push_str(further);
    if text.len() > LONGEST_TEXT {
        unfit("a long text")
    } else {
        Ok(())
    }
}

fn wanted(kind: &Kind) -> Ordering {
    if *kind == Kind::Least {
        Ordering::Less
    } else {
        Ordering::Greater
    }
}

fn owned(state: State<Cell<'_>>) -> Result<State<Value>, Stop> {
    Ok(match state {
        State::Count(count) => State::Count(count),
        State::Sum(sum) => State::Sum(sum),
        State::Joined(text) => State::Joined(text),
        State::Best(best) => State::Best(best.map(|cell| cell.value()).transpose()?),
    })
}

/// The rows that can be among the first of all.
fn first(
    rows: &Rows<'_>,
    output: &Output,
    keys: &[(Native, bool)],
    most: usize,
) -> Result<Vec<Reduced>, Stop> {
    let mut sorted: Vec<(Vec<Option<Cell<'_>>>, usize)> = Vec::with_capacity(rows.len);
    for row in 0..rows.len {
        let cells = keys
            .iter()
            .map(|(key, _)| key.value(rows, row))
            .collect::<Result<_, Stop>>()?;
        sorted.push((cells, row));
    }
    sort(
        &mut sorted,
        keys,
        |(cells, _)| cells,
        |one, other| one.order(other),
    )?;
    sorted.truncate(most);
    let of = |(cells, row): (Vec<Option<Cell<'_>>>, usize)| {
        let order = cells
            .into_iter()
            .map(|cell| cell.map(|cell| cell.value()).transpose());
        single(rows, output, row, order.collect::<Result<_, Stop>>()?)
    };
    sorted.into_iter().map(of).collect()
}

/// Sorts by keys. Missing values come first.
fn sort<T, C>(
    rows: &mut [T],
    keys: &[(Native, bool)],
    of: impl Fn(&T) -> &Vec<Option<C>>,
    order: impl Fn(&C, &C) -> Result<Ordering, Stop>,
) -> Result<(), Stop> {
    let fault: RefCell<Option<Stop>> = RefCell::new(None);
    rows.sort_by(|one, other| {
        for (at, (_, descending)) in keys.iter().enumerate() {
            let ordered = match (&of(one)[at], &of(other)[at]) {
                (Some(one), Some(other)) => order(one, other).unwrap_or_else(|stop| {
                    *fault.borrow_mut() = Some(stop);
                    Ordering::Equal
                }),
                (one, other) => one.is_some().cmp(&other.is_some()),
            };
            let ordered = if *descending {
                ordered.reverse()
            } else {
                ordered
            };
            if ordered.is_ne() {
                return ordered;
            }
        }
        Ordering::Equal
    });
    fault.into_inner().map_or(Ok(()), Err)
}

/// The reduced rows of all files.
#[derive(Debug, Default)]
pub(super) struct Gathered {
    pub rows: Vec<Reduced>,
    /// Size of the texts of lists. Unit: bytes.
    text: usize,
    known: HashMap<Vec<Option<Value>>, usize>,
}

impl Gathered {
    /// Adds the rows of a file.
    pub(super) fn add(&mut self, rows: Vec<Reduced>, output: &Output) -> Result<(), Stop> {
        for row in rows {
            self.text += row.text();
            if !output.grouped {
                self.rows.push(row);
                continue;
            }
            match self.known.get(&row.values) {
                Some(at) => self.rows[*at].merge(row, output)?,
                None => {
                    self.known.insert(row.values.clone(), self.rows.len());
                    self.rows.push(row);
                }
            }
        }
        if let Some((keys, most)) = &output.first
            && self.rows.len() > MANY_ROWS.max(4 * most)
        {
            self.keep_first(keys, *most)?;
        }
        if self.text > MOST_TEXT {
            return unfit(format!("texts of over {} MiB", MOST_TEXT >> 20));
        }
        let each = output.keys.len() + output.aggregates.len() + 1;
        if self.rows.len().saturating_mul(each) > MOST_VALUES {
            return unfit(format!(
                "over {} different rows of a pattern",
                self.rows.len() / 1000 * 1000
            ));
        }
        Ok(())
    }

    /// Whether more files are not needed.
    pub(super) fn is_enough(&self, output: &Output) -> bool {
        output.any.is_some_and(|any| self.rows.len() >= any)
    }

    fn keep_first(&mut self, keys: &[(Native, bool)], most: usize) -> Result<(), Stop> {
        let order = |one: &Value, other: &Value| Cell::of(one).order(&Cell::of(other));
        sort(&mut self.rows, keys, |row| &row.order, order)?;
        self.rows.truncate(most);
        Ok(())
    }

    /// The rows, of which no more than needed remain.
    pub(super) fn into_rows(mut self, output: &Output) -> Result<Vec<Reduced>, Stop> {
        if let Some((keys, most)) = &output.first {
            self.keep_first(keys, *most)?;
        }
        Ok(self.rows)
    }
}

impl Reduced {
    /// Size of its lists of texts. Unit: bytes.
    fn text(&self) -> usize {
        let text = |state: &State<Value>| {
            if let State::Joined(Some(text)) = state {
                text.len()
            } else {
                0
            }
        };
        self.states.iter().map(text).sum()
    }

    fn merge(&mut self, other: Self, output: &Output) -> Result<(), Stop> {
        self.count += other.count;
        for ((kind, _), (state, other)) in output
            .aggregates
            .iter()
            .zip(self.states.iter_mut().zip(other.states))
        {
            match (state, other) {
                (State::Count(count), State::Count(other)) => *count += other,
                (State::Sum(sum), State::Sum(other)) => {
                    *sum = sum.zip(other).and_then(|(sum, other)| sum.plus(other));
                }
                (State::Joined(text), State::Joined(other)) => match (&mut *text, other) {
                    (Some(text), Some(other)) => join(text, kind, false, &other)?,
                    _ => *text = None,
                },
                (State::Best(best), State::Best(other)) => match (&best, other) {
                    (Some(known), Some(other)) => {
                        if Cell::of(&other).order(&Cell::of(known))? == wanted(kind) {
                            *best = Some(other);
                        }
                    }
                    _ => *best = None,
                },
                _ => {}
            }
        }
        Ok(())
    }
}
