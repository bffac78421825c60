//! What is kept of a run that tells how healthy its campaign is.

use oxigraph::store::{StorageError, Store};

use crate::base::Choice;
use crate::history::detail;
use crate::history::read::Node;
use crate::history::write_run::run_node;

/// A run as one of the many that a campaign made.
#[derive(Debug, Clone, PartialEq)]
pub struct RunVitals {
    /// Its id.
    pub run: String,
    /// Position in the campaign, from 0.
    pub index: u64,
    /// Every decision, in order.
    pub choices: Vec<Choice>,
    /// Reasons of the scenes that were discarded before its own.
    pub discards: Vec<String>,
    /// Whether a search chose its scene, so that it stands for others of the space more or less than for itself.
    pub steered: bool,
    /// Position among the runs of its scene, from 0.
    pub repetition: u64,
    /// Unit: seconds.
    pub wall_secs: f64,
    /// How deep two things went into each other. Unit: metres. Nothing in runs of a program that did not measure it.
    pub deepest_penetration_m: Option<f64>,
    /// Energy that came from nowhere. Unit: joules. Nothing in runs of a program that did not measure it.
    pub energy_gain_j: Option<f64>,
}

/// Reads a run that is known to be there; its decisions come from its file.
pub(super) fn read(store: &Store, run: &str, choices: Vec<Choice>) -> Result<RunVitals, StorageError> {
    let node_name = run_node(run);
    let node = Node::read(store, &node_name)?;
    Ok(RunVitals {
        run: run.to_owned(),
        index: node.count("act:index").unwrap_or_default(),
        choices,
        discards: detail::discards(store, &node_name, &node)?,
        steered: node.number("act:weight").is_some(),
        repetition: node.count("act:repetition").unwrap_or_default(),
        wall_secs: node.number("act:wallSeconds").unwrap_or_default(),
        deepest_penetration_m: node.number("act:deepestPenetration"),
        energy_gain_j: node.number("act:energyGain"),
    })
}
