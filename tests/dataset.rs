//! `actcheck export --dataset`: what is in it, by other people's reader, and that it agrees with the history.

use std::path::Path;
use std::process::Command;

use serde_json::Value;

use crate::support::{actcheck, foreign, made_history, root, stderr, stdout};

fn exported(arguments: &[&str]) -> (tempfile::TempDir, String) {
    let folder = tempfile::tempdir().unwrap();
    let history = made_history().to_string_lossy().into_owned();
    let into = folder.path().to_string_lossy().into_owned();
    let output = actcheck(root(), &[&["export", "--history", &history, "--dataset", &into], arguments].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    (folder, stdout(&output))
}

fn schema(folder: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(folder.join("schema.json")).unwrap()).unwrap()
}

#[test]
fn every_table_is_told_and_described() {
    let (folder, told) = exported(&[]);
    let schema = schema(folder.path());
    let files: Vec<&str> =
        schema["tables"].as_array().unwrap().iter().map(|table| table["file"].as_str().unwrap()).collect();
    assert_eq!(
        files,
        ["actions", "joints", "robot", "objects", "percepts", "outcomes"].map(|name| format!("{name}.parquet"))
    );
    for file in files {
        assert!(folder.path().join(file).is_file() && told.contains(file), "{told}");
    }
    for table in schema["tables"].as_array().unwrap() {
        for column in table["columns"].as_array().unwrap() {
            assert!(!column["description"].as_str().unwrap().is_empty(), "{column}");
        }
    }
}

#[test]
fn the_tables_agree_with_each_other_by_another_reader() {
    let Some(python) = foreign::python() else { return };
    let (folder, _) = exported(&[]);
    let output = Command::new(python)
        .arg(root().join("tests/foreign/check_dataset.py"))
        .arg(folder.path())
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .output()
        .unwrap();
    assert!(output.status.success(), "{}{}", stdout(&output), stderr(&output));
}

#[test]
fn only_what_is_asked_for_is_in_it() {
    let (_folder, told) = exported(&["--since", "2999-01-01"]);
    assert!(told.contains("joints.parquet holds 0 rows") && told.contains("of 0 runs"), "{told}");
    let into = tempfile::tempdir().unwrap();
    let history = made_history().to_string_lossy().into_owned();
    let into = into.path().to_string_lossy().into_owned();
    let output = actcheck(root(), &["export", "--history", &history, "--dataset", &into, "--campaign", "none"]);
    assert_eq!(output.status.code(), Some(2));
}
