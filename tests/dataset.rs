//! `actcheck export --dataset`: its contents, read by an independent reader, and their agreement with the history.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

use crate::support::{actcheck, copy_made_history, foreign, root, stderr, stdout};

/// Exports a history into the folder `data` of a temporary folder.
fn export(arguments: &[&str]) -> (tempfile::TempDir, Output) {
    let folder = tempfile::tempdir().unwrap();
    copy_made_history(&folder.path().join("history"));
    let output =
        actcheck(folder.path(), &[&["export", "--history", "history", "--dataset", "data"], arguments].concat());
    (folder, output)
}

fn exported(arguments: &[&str]) -> (tempfile::TempDir, String) {
    let (folder, output) = export(arguments);
    assert!(output.status.success(), "{}", stderr(&output));
    (folder, stdout(&output))
}

fn schema(folder: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(folder.join("data/schema.json")).unwrap()).unwrap()
}

#[test]
fn every_table_is_listed_and_described() {
    let (folder, printed) = exported(&[]);
    let schema = schema(folder.path());
    let files: Vec<&str> =
        schema["tables"].as_array().unwrap().iter().map(|table| table["file"].as_str().unwrap()).collect();
    assert_eq!(
        files,
        ["actions", "joints", "robot", "objects", "percepts", "outcomes"].map(|name| format!("{name}.parquet"))
    );
    for file in files {
        assert!(folder.path().join("data").join(file).is_file() && printed.contains(file), "{printed}");
    }
    for table in schema["tables"].as_array().unwrap() {
        for column in table["columns"].as_array().unwrap() {
            assert!(!column["description"].as_str().unwrap().is_empty(), "{column}");
        }
    }
}

#[test]
fn the_tables_are_consistent_for_an_independent_reader() {
    let Some(python) = foreign::python() else { return };
    let (folder, _) = exported(&[]);
    let output = Command::new(python)
        .arg(root().join("tests/foreign/check_dataset.py"))
        .arg(folder.path().join("data"))
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .output()
        .unwrap();
    assert!(output.status.success(), "{}{}", stdout(&output), stderr(&output));
}

#[test]
fn the_dataset_has_only_the_requested_runs() {
    let (_folder, printed) = exported(&["--since", "2999-01-01"]);
    assert!(printed.contains("joints.parquet holds 0 rows") && printed.contains("of 0 runs"), "{printed}");
    assert_eq!(export(&["--campaign", "none"]).1.status.code(), Some(2));
}
