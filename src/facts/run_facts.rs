//! The facts of one run, cut by snapshot and by action.

use crate::base::{TermId, Terms};

/// Subject, predicate and object, by their numbers in the run's [`Terms`].
pub type Triple = [TermId; 3];

/// All facts of a run. A state between two actions is here once.
#[derive(Debug, Clone, Default)]
pub struct RunFacts {
    /// The terms that the numbers stand for.
    pub terms: Terms,
    /// One list for each snapshot of the trace, sorted.
    pub snapshots: Vec<Vec<Triple>>,
    /// One list for each action of the trace, sorted: what happened during it.
    pub during: Vec<Vec<Triple>>,
    /// One list for each action: designator and value, sorted.
    pub parameters: Vec<Vec<[TermId; 2]>>,
}

/// What the rules see of one action.
#[derive(Debug, Clone, Copy)]
pub struct ActionFacts<'a> {
    /// The terms that the numbers stand for.
    pub terms: &'a Terms,
    /// State before it.
    pub before: &'a [Triple],
    /// State after it.
    pub after: &'a [Triple],
    /// What happened meanwhile.
    pub during: &'a [Triple],
    /// Designator and value.
    pub parameters: &'a [[TermId; 2]],
}

impl RunFacts {
    /// The facts of one action, counted from 0; nothing where it was never reached.
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
