//! Rates count each scene once: a campaign that runs twice, and a regression that runs before each,
//! add no evidence.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::OnceLock;

use serde_json::Value;

use tempfile::TempDir;

use crate::support::{actcheck, project, stderr, stdout};

const RUN: [&str; 7] = [
    "run",
    "configs/lone_glass.toml",
    "--runs",
    "3",
    "--jobs",
    "2",
    "--history",
];

fn said(folder: &Path, arguments: &[&str]) -> String {
    let output = actcheck(folder, arguments);
    assert!(
        output.status.success(),
        "{arguments:?}: {}{}",
        stdout(&output),
        stderr(&output)
    );
    stdout(&output)
}

fn json(folder: &Path, arguments: &[&str]) -> Value {
    let output = actcheck(folder, &[arguments, &["--format", "json"]].concat());
    serde_json::from_str(&stdout(&output)).unwrap_or_else(|e| panic!("{e}: {}", stderr(&output)))
}

/// A project whose campaign of three passing runs ran twice, after a regression that fails.
fn twice() -> &'static Path {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    let project = FOLDER.get_or_init(|| {
        let project = project();
        let folder = project.path();
        let output = actcheck(
            folder,
            &[
                "run",
                "configs/clutter.toml",
                "--runs",
                "1",
                "--history",
                "other",
            ],
        );
        assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
        let run = said(folder, &["list", "--history", "other", "--format", "csv"]);
        let run = run.lines().nth(1).unwrap().split(',').next().unwrap();
        said(
            folder,
            &["export", "run", run, "--regression", "--history", "other"],
        );
        for _ in 0..2 {
            let output = actcheck(folder, &[&RUN[..], &["h"]].concat());
            assert_eq!(
                output.status.code(),
                Some(1),
                "the regression fails: {}",
                stderr(&output)
            );
            assert!(
                stdout(&output).contains("1 fails again"),
                "{}",
                stdout(&output)
            );
        }
        project
    });
    project.path()
}

/// Six of eight picks seemed to grasp without a collision, because a regression that fails ran
/// twice, and the interval was that of eight independent runs.
#[test]
fn a_repeated_campaign_and_its_regression_have_the_rates_of_three_scenes() {
    let folder = twice();
    let list = said(folder, &["list", "--history", "h", "--format", "csv"]);
    assert_eq!(
        list.lines().count(),
        9,
        "two regressions and six runs: {list}"
    );

    let rules = json(folder, &["list", "--rules", "--history", "h"]);
    let grasp = rules
        .as_array()
        .unwrap()
        .iter()
        .find(|row| row["property"] == "NoGraspCollisions")
        .unwrap();
    assert_eq!(
        [&grasp["passed"], &grasp["failed"]],
        [&Value::from(3), &Value::from(0)],
        "{grasp}"
    );
    assert!(
        (grasp["low"].as_f64().unwrap() - 0.438).abs() < 0.001,
        "Wilson's interval of 3 of 3: {grasp}"
    );

    let found = json(folder, &["analyse", "--history", "h"]);
    assert_eq!(
        [&found["runs"], &found["twins"]],
        [&Value::from(6), &Value::from(3)]
    );
    for property in found["properties"].as_array().unwrap() {
        assert_eq!(property["outcomes"]["passed"], 3, "{property}");
        assert!(
            (property["failing"]["high"].as_f64().unwrap() - 0.562).abs() < 0.001,
            "{property}"
        );
    }
    let share = &found["failure_modes"][0]["share"];
    assert!(
        (share["low"].as_f64().unwrap() - 0.438).abs() < 0.001,
        "{share}"
    );
    let trend = &found["properties"][0]["trend"]["campaigns"];
    assert_eq!(
        trend.as_array().map(Vec::len),
        Some(2),
        "a trend shows both campaigns: {trend}"
    );

    let markdown = said(folder, &["report", "--history", "h", "--markdown"]);
    assert!(
        markdown.contains("NoGraspCollisions | 100 % [44–100] (3 of 3)"),
        "{markdown}"
    );
    assert!(
        markdown.contains("3 more runs are bit-for-bit duplicates"),
        "{markdown}"
    );
}

#[test]
fn named_queries_and_queries_with_act_counts_count_each_trace_once() {
    let folder = twice();
    let query = |arguments: &[&str]| {
        said(
            folder,
            &[&["query", "--history", "h", "--format", "csv"], arguments].concat(),
        )
    };
    for line in query(&["--named", "failure-rates"]).lines().skip(1) {
        assert!(line.contains(",3,0,"), "{line}");
    }
    let counted = query(&["SELECT ?run { ?run a act:Run FILTER(act:counts(?run)) }"]);
    assert_eq!(counted.lines().count(), 4, "{counted}");
    // The newest of alike runs counts.
    let newest = said(folder, &["list", "--history", "h", "--format", "csv"]);
    let newest: BTreeSet<&str> = newest
        .lines()
        .rev()
        .take(3)
        .map(|line| line.split(',').next().unwrap())
        .collect();
    assert!(
        newest.iter().all(|run| counted.contains(run)),
        "{newest:?} {counted}"
    );
    for name in [
        "failure-rates-by-category",
        "held-before",
        "targets-of-failures",
        "worst-failures",
        "moved-neighbours",
    ] {
        query(&["--named", name]);
    }
    let completed = query(&["--named", "durations"]);
    assert!(
        completed.lines().nth(1).unwrap().contains(",3,"),
        "{completed}"
    );
}

#[test]
fn exported_rows_say_whether_their_run_counts() {
    let folder = twice();
    said(
        folder,
        &["export", "tables", "tables", "--csv", "--history", "h"],
    );
    let rows = std::fs::read_to_string(folder.join("tables/outcomes.csv")).unwrap();
    let mut lines = rows.lines();
    assert!(lines.next().unwrap().ends_with(",counts"));
    let (counted, others): (Vec<&str>, Vec<&str>) = lines.partition(|line| line.ends_with(",true"));
    assert_eq!(
        (counted.len(), others.len()),
        (15, 15),
        "five properties of three runs, twice, and no regression"
    );
    let schema: Value =
        serde_json::from_str(&std::fs::read_to_string(folder.join("tables.schema.json")).unwrap())
            .unwrap();
    assert!(
        schema["columns"]
            .as_array()
            .unwrap()
            .iter()
            .any(|column| column["name"] == "counts")
    );
    // Of one campaign alone, every run counts.
    let first = rows.lines().nth(1).unwrap().split(',').nth(1).unwrap();
    said(
        folder,
        &[
            "export",
            "tables",
            "one",
            "--csv",
            "--history",
            "h",
            "--campaign",
            first,
        ],
    );
    let rows = std::fs::read_to_string(folder.join("one/outcomes.csv")).unwrap();
    assert_eq!(
        rows.lines().filter(|line| line.ends_with(",true")).count(),
        15
    );
}

#[test]
fn the_newest_campaign_is_never_a_regression() {
    let folder = twice();
    let compared = json(folder, &["compare", "h", "h"]);
    assert_eq!(
        [&compared["a"]["runs"], &compared["b"]["runs"]],
        [3, 3],
        "{compared:#}"
    );
}
