//! What patterns are looked for in: runs that passed or failed, and the parameters of their scenes.

/// Decided runs with their parameters. Every list has one entry for each run.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Subject {
    /// Whether the run failed.
    pub failed: Vec<bool>,
    /// Whether the run takes no part in finding patterns, but confirms them.
    pub held_out: Vec<bool>,
    /// What may make a difference.
    pub parameters: Vec<Parameter>,
}

/// One parameter of the scenes.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Its name, such as `target_friction`.
    pub name: String,
    /// Unit of its numbers, where they have one.
    pub unit: Option<String>,
    /// Its value in each run.
    pub values: Values,
}

/// Values of a parameter.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Numbers; NaN where it has none.
    Numbers(Vec<f64>),
    /// One of several kinds, each of which may belong to kinds above it.
    Kinds {
        /// For each run the place of its kind in `names`, which are in the order in which they are met; nothing where it has none.
        of_run: Vec<Option<u32>>,
        /// Names of the kinds that occur.
        names: Vec<String>,
        /// For each of them the kinds above it, the nearest first.
        above: Vec<Vec<String>>,
    },
}

impl Subject {
    /// Decided runs.
    pub fn len(&self) -> usize {
        self.failed.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.failed.is_empty()
    }
}
