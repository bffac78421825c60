//! What a page is made of.

use std::collections::BTreeMap;

use crate::analysis::OutcomeTable;
use crate::history::CampaignRow;
use crate::report::FindingsSummary;
use crate::report::html::Replays;

/// Everything that a page shows.
#[derive(Debug)]
pub struct HtmlReport<'a> {
    /// Version of the program that makes it.
    pub version: &'a str,
    /// When it is made (RFC 3339).
    pub made: &'a str,
    /// What analysis found; its properties are those that are shown.
    pub findings: &'a FindingsSummary,
    /// The outcomes, with [`HTML_COLUMNS`](crate::report::HTML_COLUMNS) and the parameters of scenes.
    pub table: &'a OutcomeTable,
    /// All campaigns of the history, by their start.
    pub campaigns: &'a [CampaignRow],
    /// What properties are called, by their IRIs.
    pub words: &'a BTreeMap<String, PropertyWords>,
    /// Runs that can be watched.
    pub replays: &'a Replays,
}

/// What people call a property.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct PropertyWords {
    /// `rdfs:label`.
    pub label: String,
    /// `rdfs:comment`.
    pub comment: Option<String>,
    /// The file of its rule, as the ontology names it.
    pub rule: String,
}

/// Why an outcome is as it is: the proof, or what was missing.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Explained {
    /// Position of the action in the test, from 1.
    pub step: u32,
    /// IRI of the property.
    pub property: String,
    /// The explanation, indented.
    pub text: String,
}
