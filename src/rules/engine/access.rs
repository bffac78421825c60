//! Rows of predicates in any column order, during one evaluation.

use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::Arc;

use crate::check::stratify::Stratum;
use crate::engine::equal::{Keyed, KeyedRows};
use crate::engine::evaluate::{Grown, Layers};
use crate::engine::meter::{Meter, Stop};
use crate::engine::plan::{Indexes, Part};
use crate::engine::relation::{Batch, permuted_rows};
use crate::engine::variant::UNQUESTIONED;
use crate::model::program::{PredicateId, Predicates};
use crate::model::universe::Universe;
use actcheck_base::TermId;

/// The tuples of a recursive stratum while they grow.
#[derive(Clone, Copy)]
pub(crate) struct Own<'b> {
    pub(crate) stratum: &'b Stratum,
    pub(crate) grown: &'b Grown,
}

impl Own<'_> {
    /// Returns the place of a predicate among those of the stratum.
    pub(crate) fn place(&self, predicate: PredicateId) -> Option<usize> {
        self.stratum.predicates.binary_search(&predicate).ok()
    }
}

/// The indexes that the plans of all rules share, and those added by one evaluation.
pub(crate) struct Access<'a> {
    pub(crate) predicates: &'a Predicates,
    planned: &'a Indexes,
    pub(crate) indexes: Cow<'a, Indexes>,
    added: HashMap<(PredicateId, usize), Arc<[TermId]>>,
    /// Rows sorted by computed values.
    keyed: HashMap<PredicateId, HashMap<String, KeyedRows>>,
    /// Number of distinct values of each column, with the number of rows when they were counted.
    distinct: HashMap<PredicateId, (usize, Vec<f64>)>,
    /// Memory of the added indexes that the budget doesn't know yet. Unit: bytes.
    pub(crate) unaccounted: usize,
    /// Number of rows that all joins have read.
    pub(crate) rows_read: u64,
    /// Number of rows that a variant reads before its order is questioned.
    pub(crate) unquestioned: u64,
}

impl<'a> Access<'a> {
    pub(crate) fn new(predicates: &'a Predicates, planned: &'a Indexes) -> Self {
        Self {
            predicates,
            planned,
            indexes: Cow::Borrowed(planned),
            added: HashMap::new(),
            keyed: HashMap::new(),
            distinct: HashMap::new(),
            unaccounted: 0,
            rows_read: 0,
            unquestioned: UNQUESTIONED,
        }
    }

    /// Returns the rows of a part of a predicate in the order of an index, as sorted batches.
    pub(crate) fn batches<'b>(
        &mut self,
        predicate: PredicateId,
        part: Part,
        index: usize,
        layers: &'b Layers<'_>,
        own: Option<Own<'b>>,
    ) -> Vec<Batch<'b>> {
        let mut found = Vec::new();
        if let Some((own, place)) = own.and_then(|own| Some((own, own.place(predicate)?))) {
            own.grown[place].batches(part, index, &mut found);
            return found;
        }
        let Some(table) = layers.get(predicate) else {
            return found;
        };
        // Tables of other evaluations know the planned indexes only.
        if index < self.planned.of(predicate).len() {
            found.push(Batch::Plain(table.index(index)));
            return found;
        }
        let (width, order) = (
            self.predicates.get(predicate).width,
            &self.indexes.of(predicate)[index],
        );
        let unaccounted = &mut self.unaccounted;
        let rows = self.added.entry((predicate, index)).or_insert_with(|| {
            *unaccounted += size_of_val(table.index(0));
            permuted_rows(width, table.index(0), order)
        });
        found.push(Batch::Shared(Arc::clone(rows)));
        found
    }

    /// Returns the rows of a part of a predicate that are sorted by a computed value.
    pub(crate) fn keyed<'b>(
        &mut self,
        keyed: &Arc<Keyed>,
        part: Part,
        layers: &'b Layers<'_>,
        own: Option<Own<'b>>,
        universe: &mut Universe<'_>,
        meter: &mut Meter,
    ) -> Result<Vec<Batch<'b>>, Stop> {
        let (predicate, name) = keyed.id();
        if !self
            .keyed
            .get(&predicate)
            .is_some_and(|known| known.contains_key(name))
        {
            let [old, recent] =
                [Part::Old, Part::Recent].map(|part| self.batches(predicate, part, 0, layers, own));
            // The parts of finished tuples are equal.
            let is_own = own.is_some_and(|own| own.place(predicate).is_some());
            let recent = if is_own { recent } else { Vec::new() };
            let width = self.predicates.get(predicate).width;
            let rows = KeyedRows::new(keyed, (&old, &recent), width, universe, meter)?;
            self.keyed
                .entry(predicate)
                .or_default()
                .insert(name.to_owned(), rows);
        }
        let mut found = Vec::new();
        if let Some(rows) = self.keyed.get(&predicate).and_then(|known| known.get(name)) {
            rows.batches(part, &mut found);
        }
        Ok(found)
    }

    /// Begins a round of a recursive stratum for the rows that are sorted by computed values.
    /// `places`: the predicates of the stratum that may have changed.
    pub(crate) fn advance(
        &mut self,
        places: &[usize],
        own: Own<'_>,
        universe: &mut Universe<'_>,
        meter: &mut Meter,
    ) -> Result<(), Stop> {
        for place in places {
            let predicate = own.stratum.predicates[*place];
            let Some(known) = self.keyed.get_mut(&predicate) else {
                continue;
            };
            let mut recent = Vec::new();
            own.grown[*place].batches(Part::Recent, 0, &mut recent);
            for rows in known.values_mut() {
                rows.advance(
                    &recent,
                    self.predicates.get(predicate).width,
                    universe,
                    meter,
                )?;
            }
        }
        Ok(())
    }

    /// Returns an index that begins with some columns (in any order) and is there already, or
    /// quickly made.
    pub(crate) fn index_at_hand(
        &mut self,
        predicate: PredicateId,
        columns: &[usize],
        layers: &Layers<'_>,
        own: Option<Own<'_>>,
    ) -> Option<usize> {
        if let Some((own, place)) = own.and_then(|own| Some((own, own.place(predicate)?))) {
            return self
                .indexes
                .all_beginning_with(predicate, columns)
                .find(|index| own.grown[place].has_index(*index));
        }
        if let Some(index) = self.indexes.all_beginning_with(predicate, columns).next() {
            return Some(index);
        }
        let rows = layers.rows(predicate).len() / self.predicates.get(predicate).width;
        (rows <= QUICK_INDEX).then(|| self.indexes.to_mut().beginning_with(predicate, columns))
    }

    /// Returns the number of distinct values of a column.
    pub(crate) fn distinct(
        &mut self,
        predicate: PredicateId,
        column: usize,
        layers: &Layers<'_>,
        own: Option<Own<'_>>,
    ) -> f64 {
        let batches = self.batches(predicate, Part::All, 0, layers, own);
        let width = self.predicates.get(predicate).width;
        let count = batches.iter().map(|rows| rows.len() / width).sum();
        let known = self.distinct.entry(predicate).or_default();
        if known.0 != count || known.1.is_empty() {
            *known = (
                count,
                (0..width)
                    .map(|column| distinct_values(&batches, width, column))
                    .collect(),
            );
        }
        known.1.get(column).copied().unwrap_or(1.0).max(1.0)
    }
}

/// Maximum number of rows for which an index is made only to estimate with.
const QUICK_INDEX: usize = 1 << 20;

/// Counts the distinct values of a column with one bit for each term.
fn distinct_values(batches: &[Batch<'_>], width: usize, column: usize) -> f64 {
    let mut seen: Vec<u64> = Vec::new();
    let mut count = 0u32;
    for row in batches.iter().flat_map(|rows| rows.chunks_exact(width)) {
        let (word, bit) = (row[column] as usize / 64, 1 << (row[column] % 64));
        if word >= seen.len() {
            seen.resize(word + 1, 0);
        }
        if seen[word] & bit == 0 {
            seen[word] |= bit;
            count += 1;
        }
    }
    f64::from(count)
}
