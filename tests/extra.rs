//! The invariants of `ontology/extra.ttl` over real runs: judged in the campaign and afterwards, in
//! addition to the paper's properties, whose number they do not change.

use std::path::Path;

use crate::support::{actcheck, edit, project, stderr, stdout};

const EXTRA: [&str; 4] = [
    "GentleContacts",
    "JointLimitsKept",
    "NoSelfCollision",
    "SteadyInHand",
];

/// Outcomes of the invariants by name, of all runs in a table of outcomes.
fn outcomes(table: &str, property: &str) -> Vec<String> {
    let mut lines = table
        .lines()
        .map(|line| line.split(',').collect::<Vec<_>>());
    let header = lines.next().unwrap();
    let column = |name: &str| header.iter().position(|title| *title == name).unwrap();
    let (properties, values) = (column("property"), column("outcome"));
    let of_it = lines.filter(|row| row[properties].ends_with(property));
    of_it.map(|row| row[values].to_owned()).collect()
}

fn shown(folder: &Path, run: &str) -> String {
    stdout(&actcheck(
        folder,
        &["show", run, "--history", "h", "--format", "csv"],
    ))
}

fn runs(folder: &Path) -> Vec<String> {
    let list = stdout(&actcheck(
        folder,
        &["list", "--history", "h", "--format", "csv"],
    ));
    list.lines()
        .skip(1)
        .map(|line| line.split(',').next().unwrap().to_owned())
        .collect()
}

#[test]
fn invariants_are_judged_if_a_configuration_selects_them() {
    let project = project();
    edit(
        &project.path().join("configs/pick.toml"),
        "../ontology/actions.ttl",
        "../ontology/extra.ttl",
    );
    let output = actcheck(
        project.path(),
        &["run", "configs/pick.toml", "--runs", "3", "--history", "h"],
    );
    assert!(output.status.code() < Some(2), "{}", stderr(&output));
    let runs = runs(project.path());
    assert_eq!(runs.len(), 3);
    for run in runs {
        let table = shown(project.path(), &run);
        for property in EXTRA {
            let found = outcomes(&table, property);
            assert_eq!(found.len(), 1, "{table}");
            // Invariants about a held object are inapplicable if nothing was held.
            let decided = ["passed", "failed"].contains(&found[0].as_str());
            assert!(
                decided || (property == "SteadyInHand" && found[0] == "inapplicable"),
                "{property}: {table}"
            );
        }
        assert_eq!(outcomes(&table, "ObjectInGripper").len(), 1, "{table}");
    }
}

/// Runs of the shipped ontology, judged by the invariants afterwards. With a threshold that no
/// contact keeps, all fail.
#[test]
fn stored_runs_can_be_judged_by_the_invariants_afterwards() {
    let project = project();
    let output = actcheck(
        project.path(),
        &["run", "configs/pick.toml", "--runs", "2", "--history", "h"],
    );
    assert!(output.status.code() < Some(2), "{}", stderr(&output));
    let recheck = || {
        let judge = [
            "recheck",
            "GentleContacts",
            "JointLimitsKept",
            "--ontology",
            "ontology/extra.ttl",
        ];
        let output = actcheck(
            project.path(),
            &[&judge[..], &["--history", "h", "--format", "csv"]].concat(),
        );
        assert!(output.status.code() < Some(2), "{}", stderr(&output));
        stdout(&output)
    };
    let first = recheck();
    assert_eq!(first.matches("JointLimitsKept").count(), 2, "{first}");
    assert_eq!(first.matches("GentleContacts").count(), 2, "{first}");
    edit(
        &project.path().join("rules/extra/gentle_contacts.rls"),
        "?force > 80.0",
        "?force > 0.5",
    );
    let stricter = recheck();
    assert_eq!(stricter.matches("failed").count(), 2, "{stricter}");
}
