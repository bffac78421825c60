//! The input of pattern mining: decided runs, and the parameters of their scenes.

use crate::Sampling;

/// Decided runs with their parameters. Every list has one entry for each run.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PatternInput {
    /// Whether the run failed.
    pub failed: Vec<bool>,
    /// Whether the run is held out of the search, to confirm patterns.
    pub held_out: Vec<bool>,
    /// Parameters that may affect the outcome.
    pub parameters: Vec<Parameter>,
    /// How the number of runs was decided.
    pub sampling: Sampling,
}

/// One parameter of the scenes.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Name, such as `target_friction`.
    pub name: String,
    /// Unit of its numbers, if any.
    pub unit: Option<String>,
    /// Values, one for each run.
    pub values: Values,
}

/// Values of a parameter.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Numbers, NaN if missing.
    Numbers(Vec<f64>),
    /// Directions in [-π, π], NaN if missing. -π and π are equal. Unit: radians.
    Angles(Vec<f64>),
    /// Categories, each of which may have superkinds.
    Kinds {
        /// Index in `names` of each run's kind, `None` if missing. Names are in the order of first
        /// occurrence.
        of_run: Vec<Option<u32>>,
        /// Names of the kinds.
        names: Vec<String>,
        /// Superkinds of each kind, nearest first.
        above: Vec<Vec<String>>,
    },
}

impl Values {
    /// Returns numbers or angles, or `None` for categories.
    pub fn numbers(&self) -> Option<&[f64]> {
        match self {
            Self::Numbers(numbers) | Self::Angles(numbers) => Some(numbers),
            Self::Kinds { .. } => None,
        }
    }
}

impl PatternInput {
    /// Number of decided runs.
    pub fn len(&self) -> usize {
        self.failed.len()
    }

    /// Whether there are no runs.
    pub fn is_empty(&self) -> bool {
        self.failed.is_empty()
    }
}
