//! Input of a page.

use std::collections::{BTreeMap, BTreeSet};

use crate::html::{PackedRuns, Replays};
use crate::{FindingsSummary, RelationsSummary};
use actcheck_analysis::OutcomeTable;
use actcheck_base::DecidingSignal;
use actcheck_history::CampaignRow;

/// The content of a page.
#[derive(Debug)]
pub struct HtmlReport<'a> {
    /// Version of the program that generates it.
    pub version: &'a str,
    /// Generation time (RFC 3339).
    pub made: &'a str,
    /// Findings of the analysis; their properties are the ones displayed.
    pub findings: &'a FindingsSummary,
    /// The outcomes, with [`HTML_COLUMNS`](crate::HTML_COLUMNS) and the columns of the findings.
    pub table: &'a OutcomeTable,
    /// Its runs, packed.
    pub runs: &'a PackedRuns,
    /// All campaigns of the history, in order of start.
    pub campaigns: &'a [CampaignRow],
    /// Names of properties, by IRI.
    pub words: &'a BTreeMap<String, PropertyWords>,
    /// Runs that can be played back.
    pub replays: &'a Replays,
    /// Runs whose verdict another physics engine contests, each with the local names of the
    /// properties that it decides otherwise.
    pub contested: &'a BTreeMap<String, BTreeSet<String>>,
    /// The relations between pairs of runs, of each campaign that has some.
    pub relations: &'a [RelationsSummary],
    /// Whether a server has the page: then it asks the server for replays and for changes.
    pub served: bool,
}

/// Names and descriptions of a property.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PropertyWords {
    /// `rdfs:label`.
    pub label: String,
    /// `rdfs:comment`.
    pub comment: Option<String>,
    /// Path of its rule file, as written in the ontology.
    pub rule: String,
    /// The values that its margins are measured from.
    pub bounds: Vec<MarginBound>,
}

/// A threshold of a margin: the margin is the difference between it and a measured value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MarginBound {
    /// The threshold, in the property's unit.
    pub at: f64,
    /// Whether the value is to be below it; otherwise above.
    pub below: bool,
}

/// Explanation of an outcome: the proof, or the missing facts.
#[derive(Debug, Clone, PartialEq)]
pub struct Explained {
    /// Position of the action in the test, from 1.
    pub step: u32,
    /// IRI of the property.
    pub property: String,
    /// The explanation, indented.
    pub text: String,
    /// The signals that decided formulas over the course of the action.
    pub deciding: Vec<DecidingSignal>,
}
