//! The facts of one run, by snapshot and action.

use crate::{TermId, Terms};

/// Subject, predicate and object, as IDs in the run's [`Terms`].
pub type Triple = [TermId; 3];

/// All facts of a run. The state between two actions is stored once.
#[derive(Debug, Clone, Default)]
pub struct RunFacts {
    /// The terms of the IDs.
    pub terms: Terms,
    /// One list for each snapshot of the trace, sorted.
    pub snapshots: Vec<Vec<Triple>>,
    /// One list for each action of the trace, sorted: the events during it.
    pub during: Vec<Vec<Triple>>,
    /// One list for each action: pairs of designator and value, sorted.
    pub parameters: Vec<Vec<[TermId; 2]>>,
}

/// The facts of one action, as the input of rules.
#[derive(Debug, Clone, Copy)]
pub struct ActionFacts<'a> {
    /// The terms of the IDs.
    pub terms: &'a Terms,
    /// State before the action.
    pub before: &'a [Triple],
    /// State after the action.
    pub after: &'a [Triple],
    /// Events during the action.
    pub during: &'a [Triple],
    /// Pairs of designator and value.
    pub parameters: &'a [[TermId; 2]],
}

impl RunFacts {
    /// Returns the facts of one action, counted from 0, or `None` if it was never reached.
    pub fn action(&self, step: usize) -> Option<ActionFacts<'_>> {
        Some(ActionFacts {
            terms: &self.terms,
            before: self.snapshots.get(step)?,
            after: self.snapshots.get(step + 1)?,
            during: self.during.get(step)?,
            parameters: self.parameters.get(step)?,
        })
    }
}
