//! `list --failed`, `--outcome` and `--property`, and `run --last-failed`.

use std::collections::BTreeSet;
use std::path::Path;

use serde_json::Value;

use crate::support::{actcheck, project, stderr, stdout};

const RUN: [&str; 6] = ["run", "configs/pick.toml", "--runs", "6", "--history", "h"];

fn rows(folder: &Path, options: &[&str]) -> Vec<Value> {
    let arguments = [&["list", "--history", "h", "--format", "json"], options].concat();
    let output = actcheck(folder, &arguments);
    assert!(output.status.success(), "{}", stderr(&output));
    serde_json::from_str(&stdout(&output)).expect("a JSON array")
}

fn column<'a>(rows: &'a [Value], name: &str) -> Vec<&'a str> {
    rows.iter().map(|row| row[name].as_str().unwrap()).collect()
}

/// Checks that the arguments are refused with this text.
fn refused(folder: &Path, arguments: &[&str], text: &str) {
    let output = actcheck(folder, arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    assert!(
        stderr(&output).contains(text),
        "{arguments:?}: {}",
        stderr(&output)
    );
}

#[test]
fn runs_are_listed_by_outcome_and_property() {
    let project = project();
    let folder = project.path();
    actcheck(folder, &RUN);
    let (all, failed) = (rows(folder, &[]), rows(folder, &["--failed"]));
    assert!(
        !failed.is_empty() && failed.len() < all.len(),
        "{} of {} failed",
        failed.len(),
        all.len()
    );
    assert_eq!(failed, rows(folder, &["--outcome", "failed"]));
    for row in &all {
        let below_one = row["score"].as_f64().unwrap() < 1.0;
        assert_eq!(failed.contains(row), below_one, "{row}");
    }
    let judged = rows(folder, &["--property", "ObjectInGripper"]);
    assert_eq!(judged.len(), all.len());
    let words: BTreeSet<&str> = column(&judged, "ObjectInGripper").into_iter().collect();
    assert_eq!(words, BTreeSet::from(["passed", "failed"]));
    let dropped = rows(folder, &["--property", "ObjectInGripper", "--failed"]);
    assert!(
        column(&dropped, "ObjectInGripper")
            .iter()
            .all(|word| *word == "failed")
    );
    assert_eq!(
        dropped.len(),
        column(&judged, "ObjectInGripper")
            .iter()
            .filter(|word| **word == "failed")
            .count()
    );

    let light = rows(folder, &["--where", "target_mass_kg < 0.3"]);
    let heavy = rows(
        folder,
        &[
            "--where",
            "target_mass_kg >= 0.3",
            "--where",
            "target_category = Glass",
        ],
    );
    assert!(
        !light.is_empty() && !heavy.is_empty() && light.len() + heavy.len() == all.len(),
        "{light:?} {heavy:?}"
    );
    let far = rows(
        folder,
        &[
            "--failed",
            "--property",
            "ObjectInGripper",
            "--where",
            "score <= 1",
        ],
    );
    assert_eq!(far, dropped);
    assert!(
        rows(
            folder,
            &[
                "--failed",
                "--property",
                "ObjectInGripper",
                "--where",
                "outcome = passed"
            ]
        )
        .is_empty()
    );

    let list = |options: &[&str], text: &str| {
        refused(
            folder,
            &[&["list", "--history", "h"], options].concat(),
            text,
        )
    };
    list(
        &["--property", "ObjectInGriper"],
        "did you mean `ObjectInGripper`?",
    );
    list(&["--outcome", "fail"], "failed");
    list(
        &["--where", "target_mass < 0.3"],
        "did you mean `target_mass_kg`?",
    );
    list(&["--failed", "--outcome", "passed"], "cannot be used with");
    list(&["--campaign", "zzzz"], "H014");
}

#[test]
fn the_failed_runs_of_the_last_campaign_run_again_from_the_same_choices() {
    let project = project();
    let folder = project.path();
    let again = [
        "run",
        "configs/pick.toml",
        "--last-failed",
        "--history",
        "h",
        "--format",
        "json",
    ];
    refused(folder, &again, "H003");
    actcheck(folder, &RUN);
    let failed = rows(folder, &["--failed"]);

    let output = actcheck(folder, &again);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    let summary: Value = serde_json::from_str(&stdout(&output)).expect("JSON");
    let id = summary["campaign"].as_str().unwrap();
    let repeated = rows(folder, &["--campaign", id]);
    assert_eq!(
        column(&repeated, "trace_hash"),
        column(&failed, "trace_hash"),
        "bit for bit the same states"
    );
    assert_eq!(column(&repeated, "run")[0], format!("{id}-1"));
    // Statistics leave the campaign out, and it can't be resumed.
    let health = stdout(&actcheck(
        folder,
        &["health", "--history", "h", "--format", "json"],
    ));
    assert!(!health.contains(id), "{health}");
    refused(
        folder,
        &["run", "--history", "h", &format!("--resume={id}")],
        "X050",
    );

    // The current rules judge: with rules that always hold, no run fails.
    let holds = "@prefix act: <http://actions#> .\nsuccess(?object) :- parameter(act:pickObject, ?object) .\n";
    for rule in [
        "close_object",
        "moved_object",
        "no_grasp_collisions",
        "object_in_gripper",
    ] {
        std::fs::write(folder.join(format!("rules/{rule}.rls")), holds).unwrap();
    }
    std::fs::write(folder.join("rules/object_grasped.rq"), "ASK { }\n").unwrap();
    let output = actcheck(folder, &again);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let summary: Value = serde_json::from_str(&stdout(&output)).expect("JSON");
    assert_eq!(
        rows(
            folder,
            &["--campaign", summary["campaign"].as_str().unwrap()]
        )
        .len(),
        failed.len()
    );
    let output = actcheck(folder, &again);
    assert_eq!(output.status.code(), Some(0));
    assert!(
        stderr(&output).contains("X039") && stdout(&output).is_empty(),
        "{}",
        stderr(&output)
    );

    for wrong in [&["--runs", "3"][..], &["--shrink"], &["--resume"]] {
        refused(folder, &[&again[..], wrong].concat(), "cannot be used with");
    }
    refused(folder, &["run", "--last-failed"], "X014");
    std::fs::copy(
        folder.join("configs/pick.toml"),
        folder.join("configs/other.toml"),
    )
    .unwrap();
    refused(
        folder,
        &[
            "run",
            "configs/other.toml",
            "--last-failed",
            "--history",
            "h",
        ],
        "X038",
    );
}
