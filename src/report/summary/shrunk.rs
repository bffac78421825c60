//! The result of shrinking a run.

use actcheck_history::RunDetail;

/// The result of shrinking, as plain data.
#[derive(Debug, Clone, PartialEq)]
pub struct ShrunkSummary {
    /// Id of the run that was shrunk.
    pub original: String,
    /// The shrunk run, as stored in the history.
    pub run: RunDetail,
    /// IRIs of the properties that failed in the original.
    pub failed: Vec<String>,
    /// Number of other objects in the original.
    pub others_before: usize,
    /// Number of choices that were not nominal in the original.
    pub special_before: usize,
    /// Choices that are not nominal now.
    pub choices: Vec<ShrunkChoice>,
    /// Whether the scene is minimal: nothing more can be removed.
    pub minimal: bool,
    /// Number of simulations for shrinking.
    pub simulations: u64,
    /// Number of simulations for the explanation.
    pub explaining: u64,
    /// The property that was shrunk for; `None` for all that failed. A value passes if it passes,
    /// or if everything does.
    pub property: Option<String>,
    /// The nearest scene that passes: name and value of the choice that differs.
    pub neighbour: Option<(String, PassingValue)>,
    /// Number of failures with fresh noise, and number of repetitions.
    pub fresh: Option<(u32, u32)>,
    /// Whether the recorded noise had to be kept.
    pub noise_kept: bool,
    /// Explanation of each failed property, as text.
    pub why: Vec<String>,
}

/// One choice that is not nominal.
#[derive(Debug, Clone, PartialEq)]
pub struct ShrunkChoice {
    /// Its name.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its nominal value.
    pub nominal: f64,
    /// Unit of the values; empty for factors and for list indices.
    pub unit: &'static str,
    /// Whether the run no longer fails in this way if only this choice is set to its nominal value.
    /// `None` if that was not tried.
    pub matters: Option<bool>,
    /// Range of values with which the run fails.
    pub fails: (f64, f64),
    /// Nearest values below and above that range with which the run was replayed and passes.
    pub passes: (Option<PassingValue>, Option<PassingValue>),
}

/// A value with which a run was replayed and passes.
#[derive(Debug, Clone, PartialEq)]
pub struct PassingValue {
    /// The value.
    pub value: f64,
    /// Names of other properties that fail there; none unless a single property was shrunk for.
    pub others: Vec<String>,
}

impl ShrunkSummary {
    /// Number of other objects left.
    pub fn others(&self) -> usize {
        self.run
            .objects
            .iter()
            .filter(|object| object.role.is_bystander())
            .count()
    }
}
