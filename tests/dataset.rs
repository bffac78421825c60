//! `actcheck export tables --dataset`: its contents, read by an independent reader, and their
//! agreement with the history.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

use crate::support::{actcheck, copy_made_history, foreign, made_history, root, stderr, stdout};

/// The tables of facts from which outcomes follow.
const FACTS: [&str; 13] = [
    "actions",
    "percepts",
    "planes",
    "states",
    "bodies",
    "links",
    "contacts",
    "self_contacts",
    "extremes",
    "intervals",
    "joint_extremes",
    "shapes",
    "places",
];

/// Exports a history into the folder `data` of a temporary folder.
fn export(arguments: &[&str]) -> (tempfile::TempDir, Output) {
    let folder = tempfile::tempdir().unwrap();
    copy_made_history(&folder.path().join("history"));
    let output = actcheck(
        folder.path(),
        &[
            &[
                "export",
                "tables",
                "data",
                "--dataset",
                "--history",
                "history",
            ],
            arguments,
        ]
        .concat(),
    );
    (folder, output)
}

fn exported(arguments: &[&str]) -> (tempfile::TempDir, String) {
    let (folder, output) = export(arguments);
    assert!(output.status.success(), "{}", stderr(&output));
    (folder, stdout(&output))
}

fn schema(folder: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(folder.join("data/schema.json")).unwrap())
        .unwrap()
}

#[test]
fn every_table_is_listed_and_described() {
    let (folder, printed) = exported(&[]);
    let schema = schema(folder.path());
    let files: Vec<&str> = schema["tables"]
        .as_array()
        .unwrap()
        .iter()
        .map(|table| table["file"].as_str().unwrap())
        .collect();
    let courses = ["joints", "robot", "objects"];
    let expected: Vec<String> = FACTS
        .iter()
        .chain(&courses)
        .chain(&["outcomes"])
        .map(|name| format!("{name}.parquet"))
        .collect();
    assert_eq!(files, expected);
    for file in files {
        assert!(
            folder.path().join("data").join(file).is_file() && printed.contains(file),
            "{printed}"
        );
    }
    for table in schema["tables"].as_array().unwrap() {
        for column in table["columns"].as_array().unwrap() {
            assert!(
                !column["description"].as_str().unwrap().is_empty(),
                "{column}"
            );
        }
    }
}

/// The course at the control rate: every sample has a row, with velocities, and every force between
/// two bodies.
#[test]
fn the_course_has_every_sample_on_request() {
    let (folder, printed) = exported(&["--course"]);
    let tables = schema(folder.path());
    let described = tables["tables"].as_array().unwrap();
    let columns = |file: &str| -> Vec<String> {
        let table = described
            .iter()
            .find(|table| table["file"] == format!("{file}.parquet"))
            .expect(file);
        table["columns"]
            .as_array()
            .unwrap()
            .iter()
            .map(|column| column["name"].as_str().unwrap().to_owned())
            .collect()
    };
    for name in ["x_m", "qw", "vx_m_s", "wz_rad_s", "held"] {
        assert!(
            columns("course_bodies").iter().any(|column| column == name),
            "{name}"
        );
    }
    assert_eq!(
        columns("course_forces"),
        ["run", "step", "time_s", "first", "second", "force_n"]
    );
    assert!(columns("phases").ends_with(&["start_s".to_owned()]));
    // Ten rows a second against sixty.
    let (coarse, fine) = (rows(&printed, "robot"), rows(&printed, "course_robot"));
    assert!(
        coarse > 0 && fine > 5 * coarse && fine < 7 * coarse,
        "{printed}"
    );
    assert_eq!(rows(&printed, "course_joints") % fine, 0);
    assert!(
        rows(&printed, "course_bodies") > 0 && rows(&printed, "course_forces") > 0,
        "{printed}"
    );
    // Without a dataset there is nothing to add it to.
    assert_eq!(
        export_of(
            folder.path(),
            &[
                "export",
                "tables",
                "t",
                "--course",
                "--csv",
                "--history",
                "history"
            ]
        ),
        Some(2)
    );
}

fn export_of(folder: &Path, arguments: &[&str]) -> Option<i32> {
    actcheck(folder, arguments).status.code()
}

#[test]
fn the_tables_are_consistent_for_an_independent_reader() {
    let Some(python) = foreign::python() else {
        return;
    };
    let (folder, _) = exported(&[]);
    let output = Command::new(python)
        .arg(root().join("tests/foreign/check_dataset.py"))
        .arg(folder.path().join("data"))
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}{}",
        stdout(&output),
        stderr(&output)
    );
}

#[test]
fn the_dataset_has_only_the_requested_runs() {
    let (_folder, printed) = exported(&["--since", "2999-01-01"]);
    assert!(
        printed.contains("joints.parquet holds 0 rows") && printed.contains("of 0 runs"),
        "{printed}"
    );
    assert_eq!(export(&["--campaign", "none"]).1.status.code(), Some(2));
}

/// The number of rows that the program printed for a table.
fn rows(printed: &str, table: &str) -> usize {
    let name = format!("{table}.parquet holds ");
    let line = printed
        .lines()
        .find_map(|line| line.split_once(&name))
        .expect(table);
    line.1
        .split(' ')
        .next()
        .and_then(|count| count.parse().ok())
        .expect(line.1)
}

#[test]
fn complete_exports_have_every_fact_in_tables_and_in_rdf() {
    let folder = made_history();
    let export = |words: &[&str]| {
        let output = actcheck(
            folder.path(),
            &[&["export"], words, &["--history", "."]].concat(),
        );
        assert!(output.status.success(), "{}", stderr(&output));
        stdout(&output)
    };
    let printed = export(&["tables", "tables", "--complete"]);
    export(&["rdf", "all.nq", "--complete"]);
    for table in FACTS {
        assert!(
            folder
                .path()
                .join(format!("tables/{table}.parquet"))
                .is_file(),
            "{printed}"
        );
    }
    assert!(!folder.path().join("tables/joints.parquet").exists());
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    // The description of outcomes is in the same place as without the other tables.
    let schema: Value = serde_json::from_str(&read("tables/schema.json")).unwrap();
    assert_eq!(
        schema["columns"],
        schema["tables"].as_array().unwrap().last().unwrap()["columns"]
    );
    let count = |text: &str, parts: [&str; 2]| {
        text.lines()
            .filter(|line| parts.iter().all(|part| line.contains(part)))
            .count()
    };
    let all = read("all.nq");
    let type_of = |class: &str| format!("#type> <https://w3id.org/actcheck/world#{class}> ");
    let property = |name: &str| format!(" <https://w3id.org/actcheck/world#{name}> ");
    assert_eq!(
        count(&all, [&type_of("Contact"), "/during> ."]),
        rows(&printed, "contacts")
    );
    for name in ["minX", "mass"] {
        assert_eq!(
            count(&all, [&property(name), "/state/"]),
            rows(&printed, "bodies"),
            "{name}"
        );
    }
    assert_eq!(
        count(&all, [&property("baseX"), "/state/"]),
        rows(&printed, "states")
    );
    // The graphs of runs have only facts that queries ask for.
    export(&["rdf", "stored.nq"]);
    let stored = read("stored.nq");
    assert_eq!(count(&stored, [&property("minX"), "/state/"]), 0);
    // Everything else is the same.
    let rest = |text: &str| {
        let mut lines: Vec<String> = text
            .lines()
            .filter(|line| !is_fact(line))
            .map(str::to_owned)
            .collect();
        lines.sort();
        lines
    };
    assert!(rest(&all) == rest(&stored) && rest(&all).len() > 100);
}

#[test]
fn complete_tables_and_rdf_have_the_same_numbers() {
    let Some(python) = foreign::python() else {
        return;
    };
    let folder = made_history();
    for kind in [["tables", "tables"], ["rdf", "all.nq"]] {
        let words = [&["export"], &kind[..], &["--complete", "--history", "."]].concat();
        let output = actcheck(folder.path(), &words);
        assert!(output.status.success(), "{}", stderr(&output));
    }
    let output = Command::new(python)
        .arg(root().join("tests/foreign/check_complete.py"))
        .args(["all.nq", "tables"])
        .current_dir(folder.path())
        .env("PYTHONPATH", root().join("notebooks"))
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}{}",
        stdout(&output),
        stderr(&output)
    );
}

/// Whether a quad is in the graph of a state or an action.
fn is_fact(line: &str) -> bool {
    let graph = line.rsplit('<').next().unwrap_or_default();
    graph.contains("/state/") || graph.ends_with("/during> .")
}

#[test]
fn complete_needs_a_format_with_facts() {
    let folder = made_history();
    for (words, said) in [
        (
            &["export", "tables", "t", "--complete", "--csv"][..],
            "--csv",
        ),
        (&["export", "rdf", "all.ttl", "--complete"], "FILE.nq"),
        (&["export", "rdf", "all"], "FILE.ttl"),
    ] {
        let output = actcheck(folder.path(), &[words, &["--history", "."]].concat());
        assert_eq!(output.status.code(), Some(2), "{words:?}");
        assert!(stderr(&output).contains(said), "{}", stderr(&output));
    }
}
