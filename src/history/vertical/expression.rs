//! Expressions that are evaluated on the rows of one file.
//!
//! Only expressions that most queries use, with values of the types that runs have: everything else
//! is left to the evaluator.

use std::borrow::Cow;

use oxigraph::model::vocab::xsd;
use oxigraph::model::{NamedNode, Term, Variable};
use regex::{Regex, RegexBuilder};
use spargebra::algebra::{Expression, Function};

use crate::vertical::column::Value;
use crate::vertical::join::Rows;
use crate::vertical::stop::{Stop, unfit};
use crate::vertical::value::Cell;
use actcheck_base::{COUNTED_TEXT, TEXT_FUNCTIONS, names};

/// Largest size of a compiled pattern, as the evaluator has it.
const MOST_PATTERN_BYTES: usize = 1_000_000;

/// An expression with places of variables instead of their names.
#[derive(Debug, Clone)]
pub(super) enum Native {
    Place(usize),
    Constant(Value),
    /// Whether a run counts in rates.
    Counts(usize),
    Bound(usize),
    Or(Box<[Native; 2]>),
    And(Box<[Native; 2]>),
    Not(Box<Native>),
    Equal(Box<[Native; 2]>),
    Less(Box<[Native; 2]>),
    LessOrEqual(Box<[Native; 2]>),
    If(Box<[Native; 3]>),
    Coalesce(Vec<Native>),
    /// `STR`
    Text(Box<Native>),
    /// `REPLACE` of a constant pattern by nothing, which makes no text longer.
    Removed(Box<Native>, Regex),
    /// Sum, difference and product.
    Arithmetic(Operation, Box<[Native; 2]>),
}

#[derive(Debug, Clone, Copy)]
pub(super) enum Operation {
    Add,
    Subtract,
    Multiply,
}

impl Native {
    /// Returns `None` if the expression is left to the evaluator. `place`: the place of a variable.
    pub(super) fn of(
        expression: &Expression,
        place: &dyn Fn(&Variable) -> Option<usize>,
    ) -> Option<Self> {
        use Expression as E;
        let of = |expression: &Expression| Self::of(expression, place);
        let pair = |one: &Expression, other: &Expression| Some(Box::new([of(one)?, of(other)?]));
        Some(match expression {
            E::Variable(variable) => Self::Place(place(variable)?),
            E::NamedNode(node) => Self::Constant(Value::of(&Term::from(node.clone()))),
            E::Literal(literal) => Self::Constant(Value::of(&Term::from(literal.clone()))),
            E::Bound(variable) => Self::Bound(place(variable)?),
            E::Or(one, other) => Self::Or(pair(one, other)?),
            E::And(one, other) => Self::And(pair(one, other)?),
            E::Not(inner) => Self::Not(Box::new(of(inner)?)),
            E::Equal(one, other) => Self::Equal(pair(one, other)?),
            E::Less(one, other) => Self::Less(pair(one, other)?),
            E::LessOrEqual(one, other) => Self::LessOrEqual(pair(one, other)?),
            E::Greater(one, other) => Self::Less(pair(other, one)?),
            E::GreaterOrEqual(one, other) => Self::LessOrEqual(pair(other, one)?),
            E::If(condition, yes, no) => Self::If(Box::new([of(condition)?, of(yes)?, of(no)?])),
            E::Coalesce(list) => Self::Coalesce(list.iter().map(of).collect::<Option<_>>()?),
            E::In(value, list) => {
                let mut any = Self::Constant(Value::Boolean(false));
                for other in list {
                    any = Self::Or(Box::new([any, Self::Equal(pair(value, other)?)]));
                }
                any
            }
            E::Add(one, other) => Self::Arithmetic(Operation::Add, pair(one, other)?),
            E::Subtract(one, other) => Self::Arithmetic(Operation::Subtract, pair(one, other)?),
            E::Multiply(one, other) => Self::Arithmetic(Operation::Multiply, pair(one, other)?),
            E::FunctionCall(Function::Str, args) => match args.as_slice() {
                [value] => Self::Text(Box::new(of(value)?)),
                _ => return None,
            },
            E::FunctionCall(Function::Custom(function), args) if is_replace(function) => {
                match args.as_slice() {
                    [value, E::Literal(pattern), E::Literal(by)]
                        if [pattern, by]
                            .iter()
                            .all(|text| text.datatype() == xsd::STRING)
                            && by.value().is_empty() =>
                    {
                        let pattern = RegexBuilder::new(pattern.value())
                            .size_limit(MOST_PATTERN_BYTES)
                            .build()
                            .ok()?;
                        Self::Removed(Box::new(of(value)?), pattern)
                    }
                    _ => return None,
                }
            }
            // The length of lists is limited where they are made.
            E::FunctionCall(Function::Custom(function), args)
                if function.as_str() == COUNTED_TEXT =>
            {
                match args.as_slice() {
                    [text] => of(text)?,
                    _ => return None,
                }
            }
            E::FunctionCall(Function::Custom(function), args)
                if function.as_str() == names::act("counts") =>
            {
                match args.as_slice() {
                    [E::Variable(run)] => Self::Counts(place(run)?),
                    _ => return None,
                }
            }
            _ => return None,
        })
    }

    /// The places that it uses.
    pub(super) fn places(&self, into: &mut Vec<usize>) {
        match self {
            Self::Place(place) | Self::Counts(place) | Self::Bound(place) => into.push(*place),
            Self::Constant(_) => {}
            Self::Or(parts)
            | Self::And(parts)
            | Self::Equal(parts)
            | Self::Less(parts)
            | Self::LessOrEqual(parts)
            | Self::Arithmetic(_, parts) => parts.iter().for_each(|part| part.places(into)),
            Self::Not(part) | Self::Text(part) | Self::Removed(part, _) => part.places(into),
            Self::If(parts) => parts.iter().for_each(|part| part.places(into)),
            Self::Coalesce(parts) => parts.iter().for_each(|part| part.places(into)),
        }
    }

    /// Its value in a row; `None` if it is an error, or unbound.
    pub(super) fn value<'a>(
        &'a self,
        rows: &Rows<'a>,
        row: usize,
    ) -> Result<Option<Cell<'a>>, Stop> {
        let truth = |part: &'a Self| part.truth(rows, row);
        let both = |parts: &'a [Self; 2]| -> Result<Option<[Cell<'a>; 2]>, Stop> {
            let (one, other) = (parts[0].value(rows, row)?, parts[1].value(rows, row)?);
            Ok(one.zip(other).map(|(one, other)| [one, other]))
        };
        let compared = |parts: &'a [Self; 2]| match both(parts)? {
            Some([one, other]) => one.compare(&other),
            None => Ok(None),
        };
        let boolean = |value: Option<bool>| value.map(Cell::Boolean);
        Ok(match self {
            Self::Place(place) => match rows.cell(*place, row) {
                None if rows.is_bound(*place, row) => {
                    return unfit("outcomes and their results as values (they are blank nodes)");
                }
                cell => cell,
            },
            Self::Constant(value) => Some(Cell::of(value)),
            Self::Counts(place) => rows.counts(*place, row)?.map(Cell::Boolean),
            Self::Bound(place) => Some(Cell::Boolean(rows.is_bound(*place, row))),
            Self::Or(parts) => match truth(&parts[0])? {
                Some(true) => Some(Cell::Boolean(true)),
                one => boolean(match (one, truth(&parts[1])?) {
                    (_, Some(true)) => Some(true),
                    (Some(false), Some(false)) => Some(false),
                    _ => None,
                }),
            },
            Self::And(parts) => match truth(&parts[0])? {
                Some(false) => Some(Cell::Boolean(false)),
                one => boolean(match (one, truth(&parts[1])?) {
                    (_, Some(false)) => Some(false),
                    (Some(true), Some(true)) => Some(true),
                    _ => None,
                }),
            },
            Self::Not(part) => boolean(truth(part)?.map(|value| !value)),
            Self::Equal(parts) => match both(parts)? {
                Some([one, other]) => boolean(one.equals(&other)?),
                None => None,
            },
            Self::Less(parts) => boolean(compared(parts)?.map(std::cmp::Ordering::is_lt)),
            Self::LessOrEqual(parts) => boolean(compared(parts)?.map(std::cmp::Ordering::is_le)),
            Self::If(parts) => match truth(&parts[0])? {
                Some(true) => parts[1].value(rows, row)?,
                Some(false) => parts[2].value(rows, row)?,
                None => None,
            },
            Self::Coalesce(parts) => {
                for part in parts {
                    if let Some(value) = part.value(rows, row)? {
                        return Ok(Some(value));
                    }
                }
                None
            }
            Self::Text(part) => match part.value(rows, row)? {
                Some(value) => value.text()?.map(Cell::Text),
                None => None,
            },
            Self::Removed(part, pattern) => match part.value(rows, row)? {
                Some(Cell::Text(text)) => Some(Cell::Text(match pattern.replace_all(&text, "") {
                    Cow::Owned(replaced) => Cow::Owned(replaced),
                    Cow::Borrowed(_) => text,
                })),
                Some(Cell::Other(_)) => return unfit("a replacement in a value of a rare type"),
                _ => None,
            },
            Self::Arithmetic(operation, parts) => match both(parts)? {
                Some([one, other]) => calculated(*operation, &one, &other)?,
                None => None,
            },
        })
    }

    /// Whether it holds as a condition; `None` if it is an error.
    pub(super) fn truth(&self, rows: &Rows<'_>, row: usize) -> Result<Option<bool>, Stop> {
        // Most conditions are of this kind: they need no cell.
        if let Self::Counts(place) = self {
            return rows.counts(*place, row);
        }
        match self.value(rows, row)? {
            Some(cell) => cell.truth(),
            None => Ok(None),
        }
    }
}

fn is_replace(function: &NamedNode) -> bool {
    TEXT_FUNCTIONS
        .iter()
        .any(|(name, iri, _)| *name == "REPLACE" && *iri == function.as_str())
}

fn calculated<'a>(
    operation: Operation,
    one: &Cell<'a>,
    other: &Cell<'a>,
) -> Result<Option<Cell<'a>>, Stop> {
    let doubles = |one: f64, other: f64| {
        Cell::Double(match operation {
            Operation::Add => one + other,
            Operation::Subtract => one - other,
            Operation::Multiply => one * other,
        })
    };
    Ok(match (one, other) {
        (Cell::Integer(one), Cell::Integer(other)) => match operation {
            Operation::Add => one.checked_add(*other),
            Operation::Subtract => one.checked_sub(*other),
            Operation::Multiply => one.checked_mul(*other),
        }
        .map(Cell::Integer),
        (Cell::Double(one), Cell::Double(other) | Cell::Decimal(other))
        | (Cell::Decimal(one), Cell::Double(other)) => Some(doubles(*one, *other)),
        (Cell::Double(one), Cell::Integer(other)) => Some(doubles(*one, *other as f64)),
        (Cell::Integer(one), Cell::Double(other)) => Some(doubles(*one as f64, *other)),
        (Cell::Other(_) | Cell::Decimal(_), _) | (_, Cell::Other(_) | Cell::Decimal(_)) => {
            return unfit("arithmetic on values of a rare type");
        }
        _ => None,
    })
}
