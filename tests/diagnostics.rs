//! Wrong configurations, ontologies and scene spaces, each with all its diagnostics.
//!
//! A case is a file below `tests/diagnostics/`; its diagnostics are beside it, in a file of the
//! same name with `.expected` appended. A new case needs no Rust: run with `UPDATE_EXPECT=1` to
//! write the files, and review them.

use std::path::{Path, PathBuf};

use actcheck::base::{Diagnostics, Files};
use actcheck::config::{self, Overrides};
use actcheck::ontology;
use actcheck::scenario::Space;

use crate::support::expected::assert_diagnostics;

fn cases(kind: &str) -> Vec<PathBuf> {
    let folder = Path::new("tests/diagnostics").join(kind);
    let is_case = |path: &PathBuf| {
        path.extension()
            .is_some_and(|ending| ["toml", "ttl", "owl", "rdf"].iter().any(|e| ending == *e))
    };
    Files::Disk
        .list(&folder)
        .into_iter()
        .filter(is_case)
        .collect()
}

fn check(kind: &str, least: usize, load: impl Fn(&Path) -> Result<(), Diagnostics>) {
    let report = |case: PathBuf| {
        let diagnostics = load(&case)
            .err()
            .map_or_else(String::new, |found| found.to_string());
        (case.with_added_extension("expected"), diagnostics)
    };
    assert_diagnostics(least, cases(kind).into_iter().map(report));
}

#[test]
fn all_faults_of_a_configuration_are_reported_at_once() {
    check("config", 20, |path| {
        config::load(path, &Overrides::default()).map(drop)
    });
}

#[test]
fn all_faults_of_an_ontology_are_reported_at_once() {
    check("ontology", 12, |path| {
        ontology::load(&Files::Disk, path).map(drop)
    });
}

#[test]
fn all_mismatches_of_configuration_and_ontology_are_reported_at_once() {
    check("scenario", 6, |path| {
        let campaign = config::load(path, &Overrides::default())?;
        let ontology = ontology::load(&campaign.ontology.0, &campaign.ontology.1)?;
        Space::check(&campaign, &ontology)
    });
}
