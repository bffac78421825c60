//! The notebooks run from top to bottom on fresh campaigns, and the committed output is that of
//! such a run.

use std::path::Path;
use std::process::Command;

use regex::Regex;
use serde_json::Value;

use crate::judge_in_python;
use crate::support::{foreign, root, stderr};

fn notebooks() -> Vec<(String, Value)> {
    let mut found: Vec<(String, Value)> = std::fs::read_dir(root().join("notebooks"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "ipynb"))
        .map(|path| {
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            (
                name,
                serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap(),
            )
        })
        .collect();
    found.sort_by(|a, b| a.0.cmp(&b.0));
    found
}

fn code(book: &Value) -> Vec<&Value> {
    book["cells"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|cell| cell["cell_type"] == "code")
        .collect()
}

#[test]
fn committed_notebooks_were_run_in_order() {
    let found = notebooks();
    let names: Vec<&str> = found.iter().map(|(name, _)| name.as_str()).collect();
    let expected = [
        "comparing",
        "failure_patterns",
        "first_look",
        "judge_robosuite",
        "second_judgement",
        "sparql",
    ];
    assert_eq!(names, expected.map(|name| format!("{name}.ipynb")));
    for (name, book) in &found {
        for (number, cell) in (1..).zip(code(book)) {
            assert_eq!(cell["execution_count"], number, "{name}");
            let outputs = cell["outputs"].as_array().unwrap();
            assert!(
                outputs
                    .iter()
                    .all(|output| output["output_type"] != "error"),
                "{name}: cell {number}"
            );
            assert!(
                outputs.iter().all(|output| output["name"] != "stderr"),
                "{name}: cell {number} warns"
            );
        }
        let text = book.to_string();
        assert!(
            !text.contains("/tmp/") && !text.contains("/home/") && !text.contains("/root/"),
            "{name} contains a machine-specific path"
        );
    }
    let pictures = |book: &Value| book.to_string().matches("image/png").count();
    assert!(found.iter().map(|(_, book)| pictures(book)).sum::<usize>() >= 5);
}

/// A reader of a notebook did not know what to install.
#[test]
fn every_notebook_names_the_packages_that_it_imports() {
    for (name, book) in notebooks() {
        let first = book["cells"][0]["source"].to_string();
        assert!(first.contains("pip install "), "{name}: {first}");
        let imports = code(&book)
            .iter()
            .map(|cell| cell["source"].to_string())
            .collect::<String>();
        for package in ["polars", "matplotlib", "pyoxigraph"] {
            let is_named = first.contains(package) || first.contains("requirements");
            let is_used = imports.contains(&format!("import {package}"));
            assert!(
                is_named || !is_used || name == "judge_robosuite.ipynb",
                "{name}: {package}"
            );
        }
    }
}

/// The palette of Okabe and Ito.
const OKABE_ITO: [&str; 8] = [
    "#000000", "#e69f00", "#56b4e9", "#009e73", "#f0e442", "#0072b2", "#d55e00", "#cc79a7",
];

#[test]
fn plots_use_colours_that_colour_blind_people_can_distinguish() {
    let colour = Regex::new("#[0-9a-fA-F]{6}").unwrap();
    let is_grey = |text: &str| {
        let [red, green, blue] =
            [1, 3, 5].map(|at| i32::from_str_radix(&text[at..at + 2], 16).unwrap());
        [green, blue].iter().all(|part| (part - red).abs() <= 16)
    };
    for (name, book) in notebooks() {
        for cell in code(&book) {
            let source = cell["source"].to_string();
            for found in colour.find_iter(&source).map(|found| found.as_str()) {
                assert!(
                    OKABE_ITO.contains(&found) || is_grey(found),
                    "{name}: {found}"
                );
            }
        }
    }
}

/// Fails if the notebooks were saved after a campaign with too few runs.
#[test]
fn committed_notebooks_confirm_a_pattern_and_a_difference() {
    let texts = |wanted: &str| {
        let (_, book) = notebooks()
            .into_iter()
            .find(|(name, _)| name == wanted)
            .unwrap();
        code(&book)
            .iter()
            .map(|cell| cell["outputs"].to_string())
            .collect::<String>()
    };
    let patterns = Regex::new(r"when \(\d+ tried, [1-9]\d* confirmed\)").unwrap();
    assert!(
        patterns.is_match(&texts("failure_patterns.ipynb")),
        "no confirmed pattern"
    );
    let better = Regex::new(r"everything in a run\s*┆\s*[1-9]\d+\s*┆").unwrap();
    assert!(better.is_match(&texts("comparing.ipynb")), "no difference");
}

#[test]
fn notebooks_run_on_fresh_campaigns() {
    let Some(python) = foreign::python() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new(python)
        .arg(root().join("notebooks/regenerate.py"))
        .args([
            "--actcheck",
            env!("CARGO_BIN_EXE_actcheck"),
            "--runs",
            "8",
            "--into",
        ])
        .arg(folder.path())
        // Ignores the user's settings.
        .env("HOME", folder.path())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    compare(folder.path(), |name| name != ROBOSUITE);
}

/// The notebook in which the rules decide about success in an environment of others.
#[test]
fn the_notebook_of_judge_runs_in_robosuite() {
    let Some(package) = judge_in_python::package() else {
        return;
    };
    let Some(python) = foreign::robosuite() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new(python)
        .arg(root().join("notebooks/regenerate.py"))
        .args(["--only", "judge_robosuite", "--into"])
        .arg(folder.path())
        .env("HOME", folder.path())
        .env("PYTHONPATH", package)
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    compare(folder.path(), |name| name == ROBOSUITE);
    let text = std::fs::read_to_string(folder.path().join(ROBOSUITE)).unwrap();
    for (episode, is_success) in [
        ("grasped", "True"),
        ("teleported", "False"),
        ("balanced", "False"),
    ] {
        let line = format!("{episode}: robosuite's own check True, the rules {is_success}");
        assert!(text.contains(&line), "{line}");
    }
}

const ROBOSUITE: &str = "judge_robosuite.ipynb";

/// Notebooks in a folder ran to their ends, and have the cells of the committed ones.
fn compare(folder: &Path, is_wanted: impl Fn(&str) -> bool) {
    for (name, committed) in notebooks() {
        if !is_wanted(&name) {
            continue;
        }
        let text = std::fs::read_to_string(folder.join(&name)).unwrap();
        let run: Value = serde_json::from_str(&text).unwrap();
        assert!(
            code(&run)
                .iter()
                .all(|cell| cell["execution_count"].is_u64()),
            "{name} did not run to its end"
        );
        let sources = |book: &Value| {
            book["cells"]
                .as_array()
                .unwrap()
                .iter()
                .map(|cell| cell["source"].clone())
                .collect::<Vec<_>>()
        };
        assert_eq!(sources(&run), sources(&committed), "{name}");
    }
}
