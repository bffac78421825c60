//! Verdicts beside people's labels, and a campaign that is compared while it runs.

use actcheck::history::{History, RunFilter};
use serde_json::Value;

use crate::support::{actcheck, root, stderr, stdout};

/// Makes picks in a folder. Returns the program's output.
fn picks(folder: &std::path::Path, more: &[&str]) -> std::process::Output {
    let config = root().join("configs/pick.toml");
    let mut arguments = vec!["run", config.to_str().unwrap(), "-q", "--history", "h"];
    arguments.extend(more);
    actcheck(folder, &arguments)
}

#[test]
fn labels_are_compared_and_faults_of_a_file_are_reported_together() {
    let folder = tempfile::tempdir().unwrap();
    picks(folder.path(), &["--runs", "6", "--seed", "5"]);
    let history = History::open_to_read(&folder.path().join("h")).unwrap();
    let outcomes = history.outcomes(&RunFilter::default()).unwrap();
    let mut text = "run,property,label\n".to_owned();
    for (number, row) in outcomes
        .iter()
        .filter(|row| row.property.ends_with("MovedObject"))
        .enumerate()
    {
        // The label of the first run is wrong.
        let passes = (row.outcome.word() == "passed") != (number == 0);
        text += &format!(
            "{},MovedObject,{}\n",
            row.run,
            if passes { "pass" } else { "fail" }
        );
    }
    std::fs::write(folder.path().join("labels.csv"), &text).unwrap();
    let compared = actcheck(
        folder.path(),
        &[
            "calibrate",
            "labels.csv",
            "--history",
            "h",
            "--format",
            "json",
        ],
    );
    assert_eq!(compared.status.code(), Some(1), "{}", stderr(&compared));
    let found: Value = serde_json::from_str(&stdout(&compared)).unwrap();
    assert_eq!(found[0]["property"], "MovedObject");
    assert_eq!(
        (found[0]["labels"].as_u64(), found[0]["agreeing"].as_u64()),
        (Some(6), Some(5))
    );
    assert_eq!(found[0]["limit"], 0.02, "the limit of its rule");
    assert_eq!(
        found[0]["contradicting"][0]["run"],
        outcomes[0].run.as_str()
    );
    assert_eq!(found[0]["fitted"], Value::Null, "too few labels");

    std::fs::write(
        folder.path().join("bad.csv"),
        format!(
            "{text}k0k0-1,MovedObject,pass\n{run},MovedObjct,pass\n{run},MovedObject,maybe\n",
            run = outcomes[0].run
        ),
    )
    .unwrap();
    let refused = actcheck(folder.path(), &["calibrate", "bad.csv", "--history", "h"]);
    assert_eq!(refused.status.code(), Some(2));
    let faults = stderr(&refused);
    for part in [
        "line 8",
        "line 9",
        "line 10",
        "k0k0-1",
        "MovedObject`?",
        "maybe",
    ] {
        assert!(faults.contains(part), "{part}: {faults}");
    }
    for (name, text, part) in [
        ("no_column.csv", "run,label\n", "property"),
        ("empty.csv", "run,property,label\n", "no labels"),
    ] {
        std::fs::write(folder.path().join(name), text).unwrap();
        let refused = actcheck(folder.path(), &["calibrate", name, "--history", "h"]);
        assert_eq!(refused.status.code(), Some(2), "{name}");
        assert!(
            stderr(&refused).contains(part),
            "{name}: {}",
            stderr(&refused)
        );
    }
}

/// A campaign whose robot sees badly is soon known to be worse than its baseline; it ends at the
/// same run for any number of workers.
#[test]
fn a_campaign_ends_when_the_comparison_is_decided() {
    let folder = tempfile::tempdir().unwrap();
    picks(folder.path(), &["--runs", "40", "--seed", "5"]);
    let history = History::open_to_read(&folder.path().join("h")).unwrap();
    let base = history.campaigns().unwrap()[0].id.clone();
    let text = std::fs::read_to_string(root().join("configs/pick.toml")).unwrap();
    let worse = text
        .replace("position_noise_m = 0.025", "position_noise_m = 0.06")
        .replace("\"../", &format!("\"{}/", root().display()));
    assert_ne!(text, worse);
    std::fs::write(folder.path().join("worse.toml"), worse).unwrap();
    let mut ends = Vec::new();
    for jobs in ["1", "2"] {
        let run = actcheck(
            folder.path(),
            &[
                "run",
                "worse.toml",
                "--runs",
                "40",
                "--seed",
                "5",
                "--jobs",
                jobs,
                "--history",
                "h",
                "--against",
                &base,
                "--until-decided",
            ],
        );
        assert_eq!(run.status.code(), Some(1), "{}", stderr(&run));
        let said = stdout(&run);
        assert!(
            said.contains("answer: worse") && said.contains("--until-decided"),
            "{said}"
        );
        let history = History::open_to_read(&folder.path().join("h")).unwrap();
        let last = history.campaigns().unwrap().last().unwrap().id.clone();
        let filter = RunFilter {
            campaign: Some(last.clone()),
            ..RunFilter::default()
        };
        ends.push(history.runs(&filter).unwrap().len());
        // The comparison afterwards says the same.
        let compared = actcheck(
            folder.path(),
            &[
                "compare",
                &base,
                &last,
                "--sequential",
                "--decide",
                "--history",
                "h",
            ],
        );
        assert_eq!(compared.status.code(), Some(1), "{}", stdout(&compared));
    }
    assert!(ends[0] == ends[1] && ends[0] < 40, "{ends:?}");
    // Another seed has other scenes.
    let other = picks(
        folder.path(),
        &["--runs", "2", "--seed", "6", "--against", &base],
    );
    assert_eq!(other.status.code(), Some(2));
    assert!(
        stderr(&other).contains("add `--seed 5`"),
        "{}",
        stderr(&other)
    );
}
