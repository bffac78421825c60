//! Values of a run that show the health of its campaign.

use oxigraph::store::{StorageError, Store};

use crate::detail;
use crate::read::Node;
use crate::write_run::run_node;
use actcheck_data::Choice;

/// The values of one run.
#[derive(Debug, Clone, PartialEq)]
pub struct RunVitals {
    /// Its id.
    pub run: String,
    /// Position in the campaign, from 0.
    pub index: u64,
    /// Every choice, in order.
    pub choices: Vec<Choice>,
    /// Reasons why scenes were discarded before its own.
    pub discards: Vec<String>,
    /// Whether a search chose its scene, so that the run has an importance weight.
    pub is_weighted: bool,
    /// Position among the runs of its scene, from 0.
    pub repetition: u64,
    /// Unit: seconds.
    pub wall_secs: f64,
    /// Deepest penetration of two bodies. Unit: metres. `None` in runs of earlier versions, which did not measure it.
    pub deepest_penetration_m: Option<f64>,
    /// Energy that the simulation created by error. Unit: joules. `None` in runs of earlier versions, which did not
    /// measure it.
    pub energy_gain_j: Option<f64>,
}

/// Reads an existing run. The caller reads its choices from its trace file.
pub(super) fn read(store: &Store, run: &str, choices: Vec<Choice>) -> Result<RunVitals, StorageError> {
    let node_name = run_node(run);
    let node = Node::read(store, &node_name)?;
    Ok(RunVitals {
        run: run.to_owned(),
        index: node.count("act:index").unwrap_or_default(),
        choices,
        discards: detail::discards(store, &node_name, &node)?,
        is_weighted: node.number("act:weight").is_some(),
        repetition: node.count("act:repetition").unwrap_or_default(),
        wall_secs: node.number("act:wallSeconds").unwrap_or_default(),
        deepest_penetration_m: node.number("act:deepestPenetration"),
        energy_gain_j: node.number("act:energyGain"),
    })
}
