//! Wrong configurations, ontologies and scene spaces, each with all its diagnostics.
//!
//! A case is a file below `tests/diagnostics/`; its diagnostics are beside it, in a file of the same name with
//! `.expected` appended. A new case needs no Rust: run with `ACTCHECK_BLESS=1` to write missing files, and review
//! them.

use std::path::{Path, PathBuf};

use actcheck::base::{Diagnostics, Files};
use actcheck::config::{self, Overrides};
use actcheck::ontology;
use actcheck::scenario::Space;

fn cases(kind: &str) -> Vec<PathBuf> {
    let folder = Path::new("tests/diagnostics").join(kind);
    let is_case = |path: &PathBuf| {
        path.extension().is_some_and(|ending| ["toml", "ttl", "owl", "rdf"].iter().any(|e| ending == *e))
    };
    Files::Disk.list(&folder).into_iter().filter(is_case).collect()
}

fn check(kind: &str, least: usize, load: impl Fn(&Path) -> Result<(), Diagnostics>) {
    let bless = std::env::var_os("ACTCHECK_BLESS").is_some();
    let cases = cases(kind);
    assert!(cases.len() >= least, "only {} cases of {kind}", cases.len());
    let mut wrong = Vec::new();
    for case in cases {
        let said = load(&case).err().map_or_else(String::new, |found| found.to_string());
        let expected_path = case.with_added_extension("expected");
        if bless {
            std::fs::write(&expected_path, &said).unwrap();
        }
        let expected = std::fs::read_to_string(&expected_path).unwrap_or_default();
        if said.is_empty() || said != expected {
            wrong.push(format!("== {}\n-- expected\n{expected}-- said\n{said}", case.display()));
        }
        for line in said.lines().filter(|line| !line.starts_with("  help: ")) {
            assert!(line.contains(':') && !line.ends_with('.'), "{line}");
        }
        assert_eq!(said.matches("  help: ").count(), said.lines().count() / 2, "each fault has its help:\n{said}");
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn all_faults_of_a_configuration_are_reported_at_once() {
    check("config", 20, |path| config::load(path, &Overrides::default()).map(drop));
}

#[test]
fn all_faults_of_an_ontology_are_reported_at_once() {
    check("ontology", 12, |path| ontology::load(&Files::Disk, path).map(drop));
}

#[test]
fn all_mismatches_of_configuration_and_ontology_are_reported_at_once() {
    check("scenario", 6, |path| {
        let campaign = config::load(path, &Overrides::default())?;
        let ontology = ontology::load(&campaign.ontology.0, &campaign.ontology.1)?;
        Space::new(&campaign, &ontology).map(drop)
    });
}
