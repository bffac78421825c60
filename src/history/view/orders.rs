//! Statements as numbers of terms, sorted in the orders that lookups use.

use std::iter::Peekable;
use std::ops::Range;
use std::slice;
use std::sync::OnceLock;

use crate::view::interner::narrow;

/// Rows of numbers in ascending order, found by their first number.
///
/// `REST` is the count of the other numbers of a row.
#[derive(Debug, Default, Clone)]
struct Order<const REST: usize> {
    /// The rows that begin with `n` are `rows[starts[n]..starts[n + 1]]`.
    starts: Vec<u32>,
    /// The rows without their first number.
    rows: Vec<[u32; REST]>,
}

impl<const REST: usize> Order<REST> {
    /// Takes rows (of `REST + 1` numbers) that are sorted and differ.
    fn new<const ALL: usize>(sorted: Vec<[u32; ALL]>) -> Self {
        let n_starts = sorted.last().map_or(0, |row| row[0] as usize + 2);
        let mut starts = Vec::with_capacity(n_starts);
        let mut rows = Vec::with_capacity(sorted.len());
        for row in &sorted {
            if starts.len() <= row[0] as usize {
                starts.resize(row[0] as usize + 1, rows.len() as u32);
            }
            let mut rest = [0; REST];
            rest.copy_from_slice(&row[1..]);
            rows.push(rest);
        }
        starts.resize(n_starts, rows.len() as u32);
        Self { starts, rows }
    }

    /// Returns the rows that begin with a number.
    fn beginning_with(&self, first: u32) -> &[[u32; REST]] {
        let first = first as usize;
        match self.starts.get(first..first + 2) {
            Some(bounds) => &self.rows[bounds[0] as usize..bounds[1] as usize],
            None => &[],
        }
    }

    /// Returns the rows that begin with a number and continue with others (without the first).
    fn find(&self, first: u32, then: &[u32]) -> Cursor<'_, REST> {
        let mut rows = self.beginning_with(first);
        for (column, wanted) in then.iter().enumerate() {
            let start = rows.partition_point(|row| row[column] < *wanted);
            rows = &rows[start..];
            rows = &rows[..run_length(rows, column, *wanted)];
        }
        Cursor {
            order: self,
            first,
            rows: rows.iter(),
            upcoming: 0..0,
        }
    }

    fn all(&self) -> Cursor<'_, REST> {
        Cursor {
            order: self,
            first: 0,
            rows: [].iter(),
            upcoming: 0..narrow(self.starts.len().saturating_sub(1)),
        }
    }

    /// Returns all rows, with their columns in another order.
    fn arranged<const ALL: usize>(&self, columns: [usize; ALL]) -> Vec<[u32; ALL]> {
        let mut rows = Vec::with_capacity(self.rows.len());
        rows.extend(self.all().map(|(first, rest)| {
            let row = joined::<ALL, REST>(first, rest);
            columns.map(|column| row[column])
        }));
        rows
    }

    /// Adds rows. Returns whether any of them was new.
    fn merge<const ALL: usize>(&mut self, new: Vec<[u32; ALL]>, n_terms: usize) -> bool {
        let all_columns: [usize; ALL] = std::array::from_fn(|column| ALL - 1 - column);
        let mut new = sorted_by(new, &all_columns, n_terms);
        new.dedup();
        let n_before = self.rows.len();
        let merged = if n_before == 0 {
            new
        } else if new.is_empty() {
            return false;
        } else {
            let old = self.all().map(|(first, rest)| joined(first, rest));
            let mut merged = Vec::with_capacity(n_before + new.len());
            merge_into(&mut merged, old.peekable(), &new);
            merged
        };
        if merged.len() == n_before {
            return false;
        }
        *self = Self::new(merged);
        true
    }
}

/// Returns the length of the run of rows at the start that have a number in a column.
///
/// Runs are short: looking further and further ahead is faster than bisecting all rows.
fn run_length<const N: usize>(rows: &[[u32; N]], column: usize, wanted: u32) -> usize {
    let mut ahead = 1;
    while rows.get(ahead - 1).is_some_and(|row| row[column] == wanted) {
        ahead *= 2;
    }
    let checked = ahead / 2;
    let unsure = &rows[checked..rows.len().min(ahead)];
    checked + unsure.partition_point(|row| row[column] == wanted)
}

/// Returns a row with its first number.
fn joined<const ALL: usize, const REST: usize>(first: u32, rest: [u32; REST]) -> [u32; ALL] {
    let mut row = [first; ALL];
    row[1..].copy_from_slice(&rest);
    row
}

/// Merges two sorted sequences of rows without duplicates into one.
fn merge_into<const N: usize>(
    merged: &mut Vec<[u32; N]>,
    mut old: Peekable<impl Iterator<Item = [u32; N]>>,
    new: &[[u32; N]],
) {
    for row in new {
        while let Some(earlier) = old.next_if(|old| old < row) {
            merged.push(earlier);
        }
        if old.peek() != Some(row) {
            merged.push(*row);
        }
    }
    merged.extend(old);
}

/// Sorts rows by columns, the least significant column first. Rows that are equal in these columns
/// must be in their final order already.
fn sorted_by<const N: usize>(
    mut rows: Vec<[u32; N]>,
    columns: &[usize],
    n_terms: usize,
) -> Vec<[u32; N]> {
    // Counting needs a counter for each term: comparisons are faster for few rows.
    if rows.len() < n_terms / 8 || rows.len() < 64 {
        rows.sort_unstable();
        return rows;
    }
    let mut counts = vec![0_u32; n_terms + 1];
    let mut target = vec![[0; N]; rows.len()];
    for column in columns {
        if rows.is_sorted_by_key(|row| row[*column]) {
            continue;
        }
        counts.fill(0);
        for row in &rows {
            counts[row[*column] as usize + 1] += 1;
        }
        let mut sum = 0;
        for count in &mut counts {
            sum += *count;
            *count = sum;
        }
        for row in &rows {
            let place = &mut counts[row[*column] as usize];
            target[*place as usize] = *row;
            *place += 1;
        }
        std::mem::swap(&mut rows, &mut target);
    }
    rows
}

/// An iterator over found rows, as first number and other numbers.
#[derive(Debug)]
struct Cursor<'a, const REST: usize> {
    order: &'a Order<REST>,
    first: u32,
    rows: slice::Iter<'a, [u32; REST]>,
    /// First numbers of the rows after these.
    upcoming: Range<u32>,
}

impl<const REST: usize> Iterator for Cursor<'_, REST> {
    type Item = (u32, [u32; REST]);

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(row) = self.rows.next() {
                return Some((self.first, *row));
            }
            self.first = self.upcoming.next()?;
            self.rows = self.order.beginning_with(self.first).iter();
        }
    }
}

/// One statement, by numbers.
#[derive(Debug)]
pub(super) struct Row {
    pub subject: u32,
    pub property: u32,
    pub object: u32,
    pub graph: Option<u32>,
}

/// The statements of a default graph that match a pattern.
#[derive(Debug)]
pub(super) struct FoundTriples<'a> {
    rows: Cursor<'a, 2>,
    /// The columns with subject, property and object.
    columns: [usize; 3],
}

/// The statements of named graphs that match a pattern.
#[derive(Debug)]
pub(super) struct FoundQuads<'a> {
    rows: Cursor<'a, 3>,
    /// The columns with graph, subject, property and object.
    columns: [usize; 4],
}

/// The statements that match a pattern.
#[derive(Debug)]
pub(super) enum FoundRows<'a> {
    Nothing,
    Default(FoundTriples<'a>),
    Named(FoundQuads<'a>),
}

impl Iterator for FoundRows<'_> {
    type Item = Row;

    fn next(&mut self) -> Option<Row> {
        match self {
            Self::Nothing => None,
            Self::Default(found) => {
                let (first, [second, third]) = found.rows.next()?;
                let row = [first, second, third];
                let [subject, property, object] = found.columns.map(|column| row[column]);
                Some(Row {
                    subject,
                    property,
                    object,
                    graph: None,
                })
            }
            Self::Named(found) => {
                let (first, [second, third, fourth]) = found.rows.next()?;
                let row = [first, second, third, fourth];
                let [graph, subject, property, object] = found.columns.map(|column| row[column]);
                Some(Row {
                    subject,
                    property,
                    object,
                    graph: Some(graph),
                })
            }
        }
    }
}

/// The statements of the default graph, in the orders that lookups use: each is named for its
/// columns (`s`ubject, `p`roperty, `o`bject), and all but the first are made at first use.
#[derive(Debug, Default, Clone)]
pub(super) struct DefaultGraph {
    spo: Order<2>,
    pos: OnceLock<Order<2>>,
    osp: OnceLock<Order<2>>,
}

impl DefaultGraph {
    pub(super) fn merge(&mut self, new: Vec<[u32; 3]>, n_terms: usize) {
        if self.spo.merge(new, n_terms) {
            self.pos.take();
            self.osp.take();
        }
    }

    /// Number of statements.
    pub(super) fn len(&self) -> usize {
        self.spo.rows.len()
    }

    pub(super) fn find(&self, s: Option<u32>, p: Option<u32>, o: Option<u32>) -> FoundTriples<'_> {
        let (rows, columns) = match (s, p, o) {
            (Some(s), Some(p), Some(o)) => (self.spo.find(s, &[p, o]), [0, 1, 2]),
            (Some(s), Some(p), None) => (self.spo.find(s, &[p]), [0, 1, 2]),
            (Some(s), None, None) => (self.spo.find(s, &[]), [0, 1, 2]),
            (Some(s), None, Some(o)) => (self.osp().find(o, &[s]), [1, 2, 0]),
            (None, None, Some(o)) => (self.osp().find(o, &[]), [1, 2, 0]),
            (None, Some(p), Some(o)) => (self.pos().find(p, &[o]), [2, 0, 1]),
            (None, Some(p), None) => (self.pos().find(p, &[]), [2, 0, 1]),
            (None, None, None) => (self.spo.all(), [0, 1, 2]),
        };
        FoundTriples { rows, columns }
    }

    fn pos(&self) -> &Order<2> {
        self.pos.get_or_init(|| self.order_by([1, 2, 0], &[1, 0]))
    }

    fn osp(&self) -> &Order<2> {
        self.osp.get_or_init(|| self.order_by([2, 0, 1], &[0]))
    }

    /// Sorts the statements with their columns in another order. `unsorted` are the columns of the
    /// result, least significant first, that the present order does not sort already.
    fn order_by(&self, columns: [usize; 3], unsorted: &[usize]) -> Order<2> {
        let rows = self.spo.arranged(columns);
        let n_terms = n_terms(&rows);
        Order::new(sorted_by(rows, unsorted, n_terms))
    }
}

/// Returns the least count of terms in which all numbers of the rows occur.
fn n_terms<const N: usize>(rows: &[[u32; N]]) -> usize {
    let last = rows.iter().flatten().max();
    last.map_or(0, |last| *last as usize + 1)
}

/// The statements of the named graphs, in the orders that lookups use: each is named for its
/// columns (`g`raph, `s`ubject, `p`roperty, `o`bject), and all but the first are made at first use.
#[derive(Debug, Default, Clone)]
pub(super) struct NamedGraphs {
    /// The names of all graphs, also of those without statements, in ascending order.
    names: Vec<u32>,
    gspo: Order<3>,
    gpos: OnceLock<Order<3>>,
    gosp: OnceLock<Order<3>>,
    spog: OnceLock<Order<3>>,
    posg: OnceLock<Order<3>>,
    ospg: OnceLock<Order<3>>,
}

impl NamedGraphs {
    pub(super) fn merge(&mut self, new: Vec<[u32; 4]>, names: Vec<u32>, n_terms: usize) {
        if self.gspo.merge(new, n_terms) {
            let Self {
                gpos,
                gosp,
                spog,
                posg,
                ospg,
                ..
            } = self;
            for other in [gpos, gosp, spog, posg, ospg] {
                other.take();
            }
            let starts = self.gspo.starts.windows(2).zip(0..);
            let with_statements = starts.filter(|(bounds, _)| bounds[0] < bounds[1]);
            self.names.extend(with_statements.map(|(_, name)| name));
        }
        self.names.extend(names);
        self.names.sort_unstable();
        self.names.dedup();
    }

    /// Number of statements.
    pub(super) fn len(&self) -> usize {
        self.gspo.rows.len()
    }

    /// The names of all graphs, in ascending order.
    pub(super) fn names(&self) -> &[u32] {
        &self.names
    }

    pub(super) fn find(
        &self,
        g: Option<u32>,
        s: Option<u32>,
        p: Option<u32>,
        o: Option<u32>,
    ) -> FoundQuads<'_> {
        let (rows, columns) = match g {
            Some(g) => self.find_in(g, s, p, o),
            None => self.find_anywhere(s, p, o),
        };
        FoundQuads { rows, columns }
    }

    /// Finds statements in one graph.
    fn find_in(
        &self,
        g: u32,
        s: Option<u32>,
        p: Option<u32>,
        o: Option<u32>,
    ) -> (Cursor<'_, 3>, [usize; 4]) {
        match (s, p, o) {
            (Some(s), Some(p), Some(o)) => (self.gspo.find(g, &[s, p, o]), [0, 1, 2, 3]),
            (Some(s), Some(p), None) => (self.gspo.find(g, &[s, p]), [0, 1, 2, 3]),
            (Some(s), None, None) => (self.gspo.find(g, &[s]), [0, 1, 2, 3]),
            (Some(s), None, Some(o)) => (self.gosp().find(g, &[o, s]), [0, 2, 3, 1]),
            (None, None, Some(o)) => (self.gosp().find(g, &[o]), [0, 2, 3, 1]),
            (None, Some(p), Some(o)) => (self.gpos().find(g, &[p, o]), [0, 3, 1, 2]),
            (None, Some(p), None) => (self.gpos().find(g, &[p]), [0, 3, 1, 2]),
            (None, None, None) => (self.gspo.find(g, &[]), [0, 1, 2, 3]),
        }
    }

    /// Finds statements in all named graphs.
    fn find_anywhere(
        &self,
        s: Option<u32>,
        p: Option<u32>,
        o: Option<u32>,
    ) -> (Cursor<'_, 3>, [usize; 4]) {
        match (s, p, o) {
            (Some(s), Some(p), Some(o)) => (self.spog().find(s, &[p, o]), [3, 0, 1, 2]),
            (Some(s), Some(p), None) => (self.spog().find(s, &[p]), [3, 0, 1, 2]),
            (Some(s), None, None) => (self.spog().find(s, &[]), [3, 0, 1, 2]),
            (Some(s), None, Some(o)) => (self.ospg().find(o, &[s]), [3, 1, 2, 0]),
            (None, None, Some(o)) => (self.ospg().find(o, &[]), [3, 1, 2, 0]),
            (None, Some(p), Some(o)) => (self.posg().find(p, &[o]), [3, 2, 0, 1]),
            (None, Some(p), None) => (self.posg().find(p, &[]), [3, 2, 0, 1]),
            (None, None, None) => (self.gspo.all(), [0, 1, 2, 3]),
        }
    }

    fn gpos(&self) -> &Order<3> {
        self.gpos
            .get_or_init(|| self.order_by([0, 2, 3, 1], &[2, 1, 0]))
    }

    fn gosp(&self) -> &Order<3> {
        self.gosp
            .get_or_init(|| self.order_by([0, 3, 1, 2], &[1, 0]))
    }

    fn spog(&self) -> &Order<3> {
        self.spog
            .get_or_init(|| self.order_by([1, 2, 3, 0], &[2, 1, 0]))
    }

    fn posg(&self) -> &Order<3> {
        self.posg
            .get_or_init(|| self.order_by([2, 3, 1, 0], &[2, 1, 0]))
    }

    fn ospg(&self) -> &Order<3> {
        self.ospg
            .get_or_init(|| self.order_by([3, 1, 2, 0], &[2, 1, 0]))
    }

    /// Sorts the statements with their columns in another order. `unsorted` are the columns of the
    /// result, least significant first, that the present order does not sort already.
    fn order_by(&self, columns: [usize; 4], unsorted: &[usize]) -> Order<3> {
        let rows = self.gspo.arranged(columns);
        let n_terms = n_terms(&rows);
        Order::new(sorted_by(rows, unsorted, n_terms))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counting_sorts_like_comparing() {
        let mut state = 5_u64;
        let mut random = |below: usize| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 33) as u32 % below as u32
        };
        for n_terms in [1, 3, 100, 5000] {
            for n_rows in [0, 1, 63, 64, 700, 3000] {
                let rows: Vec<[u32; 4]> = (0..n_rows)
                    .map(|_| std::array::from_fn(|_| random(n_terms)))
                    .collect();
                let mut expected = rows.clone();
                expected.sort_unstable();
                assert_eq!(sorted_by(rows, &[3, 2, 1, 0], n_terms), expected);
            }
        }
    }
}
