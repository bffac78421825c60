//! What a campaign depended on and is no longer the same, by digest.

use std::collections::BTreeMap;

use crate::history::CampaignRecord;

/// One thing that changed since a campaign ran.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Change {
    /// What kind of thing it is.
    pub kind: ChangeKind,
    /// Its name: of a model or robot, of a rule file, or of the configuration.
    pub name: String,
    /// Version or digest then; nothing where it was not there.
    pub was: Option<String>,
    /// Version or digest now; nothing where it is gone.
    pub is: Option<String>,
}

/// What can change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ChangeKind {
    /// This program, by its version.
    Program,
    /// The configuration's text.
    Config,
    /// The file of an object model or a robot.
    Model,
    /// The ontology.
    Ontology,
    /// A rule file with its libraries.
    Rule,
}

impl ChangeKind {
    /// The word for it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Program => "program",
            Self::Config => "configuration",
            Self::Model => "model",
            Self::Ontology => "ontology",
            Self::Rule => "rule",
        }
    }
}

/// What differs between two campaigns' records, sorted by kind and name. What judges counts too: it changes outcomes,
/// though no trace.
pub fn changes(was: &CampaignRecord, is: &CampaignRecord) -> Vec<Change> {
    let single = |kind, name: &str, was: &str, is: &str| Change {
        kind,
        name: name.to_owned(),
        was: Some(was.to_owned()),
        is: Some(is.to_owned()),
    };
    let mut all = vec![
        single(ChangeKind::Program, "actcheck", &was.program_version, &is.program_version),
        single(ChangeKind::Config, &was.name, &was.config_digest, &is.config_digest),
        single(ChangeKind::Ontology, "all files", &was.ontology_digest, &is.ontology_digest),
    ];
    let models = |record: &CampaignRecord| record.models.iter().cloned().collect();
    all.extend(named(ChangeKind::Model, &models(was), &models(is)));
    let rules = |record: &CampaignRecord| {
        record.rules.iter().map(|(_, path, digest)| (path.clone(), digest.clone())).collect::<BTreeMap<_, _>>()
    };
    all.extend(named(ChangeKind::Rule, &rules(was), &rules(is)));
    all.retain(|change| change.was != change.is);
    all.sort_by(|a, b| (a.kind, &a.name).cmp(&(b.kind, &b.name)));
    all
}

/// One entry for every name that either side has.
fn named(kind: ChangeKind, was: &BTreeMap<String, String>, is: &BTreeMap<String, String>) -> Vec<Change> {
    let mut names: Vec<&String> = was.keys().chain(is.keys()).collect();
    names.sort();
    names.dedup();
    names
        .into_iter()
        .map(|name| Change { kind, name: name.clone(), was: was.get(name).cloned(), is: is.get(name).cloned() })
        .collect()
}
