//! The facts of one run, by snapshot and action.

use crate::{Course, TermId, Terms};

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
    /// One course for each action; `None` if it was not recorded or not read.
    pub courses: Vec<Option<Course>>,
    /// IRIs of the properties whose facts were not recorded, and of the things about which nothing
    /// was recorded, sorted.
    pub lacks: Vec<String>,
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
    /// Quantities over time; `None` if they were not recorded or not read.
    pub course: Option<&'a Course>,
    /// IRIs of the properties whose facts were not recorded, and of the things about which nothing
    /// was recorded, sorted.
    pub lacks: &'a [String],
}

impl RunFacts {
    /// Returns the facts of the first state; empty without states.
    pub fn start(&self) -> &[Triple] {
        self.snapshots.first().map_or(&[], Vec::as_slice)
    }

    /// Returns the facts of one action, counted from 0, or `None` if it was never reached.
    pub fn action(&self, step: usize) -> Option<ActionFacts<'_>> {
        Some(ActionFacts {
            terms: &self.terms,
            before: self.snapshots.get(step)?,
            after: self.snapshots.get(step + 1)?,
            during: self.during.get(step)?,
            parameters: self.parameters.get(step)?,
            course: self.courses.get(step).and_then(Option::as_ref),
            lacks: &self.lacks,
        })
    }
}

/// Properties whose values in the states before and after an action are the same, by their local
/// names in the world vocabulary.
pub const CONSTANT_PROPERTIES: [&str; 21] = [
    "friction",
    "fixed",
    "highX",
    "highY",
    "inRoom",
    "lower",
    "lowX",
    "lowY",
    "mass",
    "maxEffort",
    "maxVelocity",
    "name",
    "ofSurface",
    "restitution",
    "sizeX",
    "sizeY",
    "sizeZ",
    "surfaceHeight",
    "surfaceLength",
    "surfaceWidth",
    "upper",
];
