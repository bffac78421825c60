//! Properties written in SPARQL (feature `sparql`): prepared once, evaluated over the named graphs
//! of an action.
//!
//! Never: copies the ontology for an action, or exceeds the budget of an evaluation.

pub(crate) mod dataset;
pub(crate) mod facts_read;
mod ledger;
mod parsed;
pub(crate) mod query;
mod query_text;
pub(crate) mod snapshot;
pub(crate) mod unchanging;
mod varying;
