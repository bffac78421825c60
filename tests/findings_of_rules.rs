//! Findings about rules that say nothing: the same from `check`, `run`, `recheck` and `rules`, and
//! kept with the campaign.
//!
//! A case is a file `tests/findings_of_rules/NAME.case`, written as those of [`crate::mistakes`],
//! but its line `$` names the configuration and its ontology; the answers are beside it, in a file
//! of the same name with `.expected` appended. `UPDATE_EXPECT=1` writes these files.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use actcheck::base::Files;
use actcheck::ontology;
use actcheck::rules::RuleBook;

use crate::mistakes::{first_run, set_up};
use crate::support::expected::assert_expected;
use crate::support::{project, root, stderr, stdout};

/// Number of cases at least.
const LEAST: usize = 9;
/// Asks for the findings of all campaigns.
const STORED: &str = "SELECT ?code ?text ?place WHERE { ?campaign a act:Campaign ; act:ruleFinding ?found . ?found a act:RuleFinding ; \
                      act:findingCode ?code ; act:findingText ?text . OPTIONAL { ?found act:findingPlace ?place } } \
                      ORDER BY ?code ?text";

/// The error stream of a command, or its exit code if there is nothing. The history is in the
/// folder.
fn told(folder: &Path, arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_actcheck"))
        .args(arguments)
        .current_dir(folder)
        .env_remove("CLICOLOR_FORCE")
        .envs([("NO_COLOR", "1"), ("COLUMNS", "100")])
        .output()
        .unwrap();
    let plain =
        |text: String| text.replace(&*folder.canonicalize().unwrap().to_string_lossy(), ".");
    (
        output.status.code(),
        plain(stderr(&output)),
        plain(stdout(&output)),
    )
}

/// The diagnostics of each command; equal ones are given once.
fn answers(case: &Path) -> String {
    let folder = project();
    let inputs = set_up(&std::fs::read_to_string(case).unwrap(), folder.path());
    let [config, ontology] = inputs.as_slice() else {
        panic!("{}: {inputs:?}", case.display())
    };
    let (code, check, _) = told(folder.path(), &["check", config]);
    let mut text = format!("== check, exit code {}\n{check}", code.unwrap());
    let mut say = |name: &str, answer: String| {
        text.push_str(&match answer == check {
            true => format!("== {name}: the same\n"),
            false => format!("== {name}\n{answer}"),
        });
    };
    let history = ["--history", "history"];
    let run = ["run", config, "--runs", "1", "--jobs", "1", "--quiet"];
    say("run", told(folder.path(), &[&run[..], &history].concat()).1);
    let rules = ["list", "--rules", "--ontology", ontology];
    if code != Some(0) {
        say("rules", told(folder.path(), &rules).1);
        return text;
    }
    let recheck = ["recheck", "--jobs", "1", "--ontology", ontology];
    say(
        "recheck",
        told(folder.path(), &[&recheck[..], &history].concat()).1,
    );
    say(
        "rules",
        told(folder.path(), &[&rules[..], &history].concat()).1,
    );
    let stored = told(
        folder.path(),
        &[&["query", STORED, "--format", "csv"], &history[..]].concat(),
    );
    say("kept with the campaign", stored.1 + &stored.2);
    let run = first_run(&folder.path().join("history"));
    let shown = told(folder.path(), &[&["show", &run], &history[..]].concat()).2;
    let (of_findings, number) = (
        "finding about the rules",
        check.matches("\n  help: ").count(),
    );
    assert_eq!(
        shown
            .lines()
            .filter(|line| line.starts_with(of_findings))
            .count(),
        number,
        "{shown}"
    );
    text
}

#[test]
fn every_command_reports_the_same_findings() {
    let folder = root().join("tests/findings_of_rules");
    let mut cases: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    cases.retain(|path| path.extension().is_some_and(|ending| ending == "case"));
    assert!(cases.len() >= LEAST, "only {} cases", cases.len());
    let (next, done) = (AtomicUsize::new(0), Mutex::new(BTreeMap::new()));
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(2, usize::from) {
            scope.spawn(|| {
                while let Some(case) = cases.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let answers = answers(case);
                    done.lock()
                        .unwrap()
                        .insert(case.with_added_extension("expected"), answers);
                }
            });
        }
    });
    assert_expected(done.into_inner().unwrap());
}

/// As in a project: with files that no ontology of the three links by itself.
#[test]
fn the_shipped_ontologies_have_no_findings() {
    for name in ["actions", "extra", "time"] {
        let found =
            ontology::load(&Files::Disk, &root().join(format!("ontology/{name}.ttl"))).unwrap();
        let book = RuleBook::prepare(&found).unwrap();
        assert!(book.warnings().is_empty(), "{name}: {}", book.warnings());
    }
}

#[test]
fn a_new_project_has_no_findings() {
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(told(folder.path(), &["new", "campaign", "mine"]).0, Some(0));
    let (code, warnings, _) = told(folder.path(), &["check", "mine.toml"]);
    assert_eq!((code, warnings.as_str()), (Some(0), ""));
}
