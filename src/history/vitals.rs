//! Values of a run that show the health of its campaign.

use std::collections::HashMap;

use oxigraph::model::{GraphNameRef, NamedOrBlankNode, Quad};
use oxigraph::store::{StorageError, Store};

use crate::read::{Node, text_of};
use crate::statements::iri;
use crate::wanted::Wanted;
use crate::write_run::run_node;
use crate::{RunRow, detail};
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
    /// Deepest penetration of two bodies. Unit: metres. `None` if the run was not simulated.
    pub deepest_penetration_m: Option<f64>,
    /// Energy that the simulation created by error. Unit: joules. `None` if the run was not
    /// simulated.
    pub energy_gain_j: Option<f64>,
}

/// Values of many runs, read by property: a store finds all values of one property at once, which
/// takes a tenth of the time of all properties of each run.
pub(super) struct Columns {
    discards: HashMap<String, f64>,
    wall_secs: HashMap<String, f64>,
    deepest_penetration_m: HashMap<String, f64>,
    energy_gain_j: HashMap<String, f64>,
}

/// The statements that [`Columns`] reads.
pub(super) fn wanted() -> Wanted {
    let columns = [
        "act:discards",
        "act:wallSeconds",
        "act:deepestPenetration",
        "act:energyGain",
    ];
    let discards = ["act:ofRun", "act:attempt", "act:reason"];
    let mut wanted = Wanted::values(&[&columns[..], &discards[..]].concat());
    wanted.add(Wanted::individuals("act:Discard"));
    wanted
}

impl Columns {
    /// Reads the values of all runs of a store.
    pub(super) fn read(store: &Store) -> Result<Self, StorageError> {
        Ok(Self {
            discards: column(store, "act:discards")?,
            wall_secs: column(store, "act:wallSeconds")?,
            deepest_penetration_m: column(store, "act:deepestPenetration")?,
            energy_gain_j: column(store, "act:energyGain")?,
        })
    }

    /// The values of one run. The caller reads its choices from its trace file.
    pub(super) fn of(
        &self,
        store: &Store,
        row: &RunRow,
        choices: Vec<Choice>,
    ) -> Result<RunVitals, StorageError> {
        let node = run_node(&row.run);
        let value = |column: &HashMap<String, f64>| column.get(node.as_str()).copied();
        let discards = match value(&self.discards) {
            Some(count) if count > 0.0 => {
                detail::discards(store, &node, &Node::read(store, &node)?)?
            }
            _ => Vec::new(),
        };
        Ok(RunVitals {
            run: row.run.clone(),
            index: row.index,
            choices,
            discards,
            is_weighted: row.weight.is_some(),
            repetition: row.repetition.map_or(0, |repetition| repetition.number),
            wall_secs: value(&self.wall_secs).unwrap_or_default(),
            deepest_penetration_m: value(&self.deepest_penetration_m),
            energy_gain_j: value(&self.energy_gain_j),
        })
    }
}

/// The numbers that subjects have as values of a property, by IRI.
fn column(store: &Store, property: &str) -> Result<HashMap<String, f64>, StorageError> {
    let property = iri(property);
    let quads = store.quads_for_pattern(
        None,
        Some(property.as_ref()),
        None,
        Some(GraphNameRef::DefaultGraph),
    );
    let value = |quad: Quad| match (quad.subject, text_of(&quad.object).parse::<f64>()) {
        (NamedOrBlankNode::NamedNode(node), Ok(value)) => Some((node.into_string(), value)),
        _ => None,
    };
    quads
        .filter_map(|quad| quad.map(value).transpose())
        .collect()
}
