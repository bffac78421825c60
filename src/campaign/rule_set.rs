//! The rules for judging stored runs.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use actcheck_base::{Diagnostic, Diagnostics, Files, did_you_mean, names};
use actcheck_ontology as ontology;
use actcheck_ontology::{Action, Ontology};
use actcheck_rules::RuleBook;

/// A prepared ontology with its rules, and the success properties to judge.
pub struct RuleSet {
    pub(super) ontology: Ontology,
    pub(super) rules: RuleBook,
    /// Actions by local name, with only the properties to judge.
    pub(super) actions: BTreeMap<String, Action>,
}

impl RuleSet {
    /// Reads an ontology, and checks and plans its rules. All success properties are judged.
    ///
    /// # Errors
    /// All faults of the ontology, or else all faults of its rules, each with its place.
    pub fn prepare(files: &Files, path: &Path) -> Result<Self, Diagnostics> {
        let ontology = ontology::load(files, path)?;
        let rules = RuleBook::prepare(&ontology)?;
        let actions = ontology.actions.clone();
        Ok(Self {
            ontology,
            rules,
            actions,
        })
    }

    /// Warnings of the ontology and of the rules, such as rules without effect.
    pub fn warnings(&self) -> &Diagnostics {
        self.rules.warnings()
    }

    /// The rules as a campaign's record lists them.
    pub(super) fn recorded(&self) -> Vec<(String, String, String)> {
        recorded_rules(&self.ontology, &self.rules)
    }

    /// Whether a rule reads quantities over time.
    pub fn reads_course(&self) -> bool {
        self.rules.reads_course()
    }

    /// Restricts it to some properties, given by local name or IRI. An empty list means all.
    ///
    /// # Errors
    /// `X037` for every name that is not a success property of any action. (The rules were checked
    /// before.)
    pub fn only(mut self, properties: &[String]) -> Result<Self, Diagnostics> {
        if properties.is_empty() {
            return Ok(self);
        }
        let named = |iri: &str| {
            properties
                .iter()
                .any(|name| name == iri || name == names::local(iri))
        };
        let all: BTreeSet<String> = self
            .actions
            .values()
            .flat_map(|action| &action.success_properties)
            .cloned()
            .collect();
        let mut faults = Diagnostics::new();
        for name in properties {
            if !all
                .iter()
                .any(|iri| name == iri || name == names::local(iri))
            {
                faults.push(
                    Diagnostic::error("X037", format!("no action has a success property `{name}`"))
                        .help(did_you_mean(name, all.iter().map(|iri| names::local(iri)))),
                );
            }
        }
        for action in self.actions.values_mut() {
            action.success_properties.retain(|iri| named(iri));
        }
        let mut only = faults.or(self)?;
        // Facts that only other properties read need not be loaded.
        let mut ontology = only.ontology.clone();
        let asked: BTreeSet<&String> = only
            .actions
            .values()
            .flat_map(|action| {
                action
                    .success_properties
                    .iter()
                    .chain(&action.preconditions)
                    .chain(&action.premises)
            })
            .collect();
        ontology.properties.retain(|iri, _| asked.contains(iri));
        only.rules = only.rules.restricted(&ontology)?;
        Ok(only)
    }
}

/// Returns the rules as a campaign's record lists them: each property's IRI, its rule file, and the
/// digest of its rule.
pub(super) fn recorded_rules(
    ontology: &Ontology,
    rules: &RuleBook,
) -> Vec<(String, String, String)> {
    ontology
        .properties
        .values()
        .map(|property| {
            (
                property.iri.clone(),
                property.rule.path.clone(),
                rules.digest(&property.iri).to_owned(),
            )
        })
        .collect()
}
