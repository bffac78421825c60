//! Budgets end campaigns and runs, and the output says so.

use std::path::Path;

use serde_json::Value;

use crate::support::look::looking;
use crate::support::{actcheck, edit, project, stderr, stdout};

fn json(folder: &Path, arguments: &[&str]) -> Value {
    let output = actcheck(folder, &[arguments, &["--format", "json"]].concat());
    let text = stdout(&output);
    serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}\n{}", stderr(&output)))
}

fn listed(folder: &Path, history: &str) -> String {
    stdout(&actcheck(
        folder,
        &["list", "--history", history, "--format", "csv"],
    ))
}

/// A failure count or an interval width ends a campaign at the same run with any number of workers.
#[test]
fn failure_and_width_budgets_end_at_the_same_run_with_any_number_of_workers() {
    let project = looking();
    for (name, budget) in [
        ("failures", ["--max-failures", "2"]),
        ("width", ["--until-width", "0.6"]),
    ] {
        let of = |jobs: &str| {
            let history = format!("{name}{jobs}");
            let all = [
                "run",
                "configs/look.toml",
                "--runs",
                "40",
                "--jobs",
                jobs,
                "--history",
                &history,
            ];
            let summary = json(project.path(), &[&all[..], &budget].concat());
            let text = listed(project.path(), &history);
            assert_eq!(summary["ended_by"], name);
            assert_eq!(
                (&summary["interrupted"], &summary["planned_runs"]),
                (&Value::from(false), &Value::from(40))
            );
            assert_eq!(
                summary["finished_runs"].as_u64().unwrap() as usize,
                text.lines().count() - 1
            );
            (summary, text)
        };
        let (one, three) = (of("1"), of("3"));
        assert_eq!(one.1, three.1, "{name}");
        let runs = one.0["runs"].as_array().unwrap();
        let failed = |run: &Value| run.to_string().contains("\"failed\"");
        if name == "failures" {
            assert_eq!(runs.iter().filter(|run| failed(run)).count(), 2);
            assert!(
                failed(&runs[runs.len() - 1]),
                "the last run is the second failed run"
            );
            // The rate is Haldane's: the last failure would bias it.
            let (passed, of) = (&one.0["runs_passed"]["count"], runs.len() as f64);
            assert_eq!(
                (passed.as_u64(), &one.0["stopped_by_outcomes"]),
                (Some(runs.len() as u64 - 2), &true.into())
            );
            let rate = one.0["runs_passed"]["rate"].as_f64().unwrap();
            assert!(
                (rate - (of - 2.0) / (of - 1.0)).abs() < 1e-12,
                "{:#}",
                one.0["runs_passed"]
            );
            assert_eq!(one.0["exit_code"], 1);
        } else {
            for property in one.0["properties"].as_array().unwrap() {
                let rate = &property["pass_rate"];
                assert!(
                    rate["high"].as_f64().unwrap() - rate["low"].as_f64().unwrap() <= 0.6,
                    "{property}"
                );
            }
        }
    }
}

#[test]
fn a_time_budget_ends_a_campaign_without_a_run_count() {
    let project = project();
    let summary = json(
        project.path(),
        &[
            "run",
            "configs/lone_glass.toml",
            "--time",
            "4s",
            "--history",
            "h",
        ],
    );
    assert_eq!(
        (&summary["ended_by"], &summary["interrupted"]),
        (&Value::from("time"), &Value::from(false))
    );
    assert_eq!(summary["planned_runs"], 10_000_000);
    let kept = listed(project.path(), "h");
    assert_eq!(
        kept.lines().count() - 1,
        summary["finished_runs"].as_u64().unwrap() as usize
    );
    // The kept runs are the beginning of the plan.
    let indices: Vec<usize> = kept
        .lines()
        .skip(1)
        .map(|line| line.split(',').nth(1).unwrap().parse().unwrap())
        .collect();
    assert_eq!(indices, (0..indices.len()).collect::<Vec<_>>());
}

/// A run that the clock ends is a timeout. Replay repeats it without the clock, and says how far it
/// compares.
#[test]
fn a_run_over_the_wall_clock_limit_is_a_timeout_and_can_be_replayed() {
    let project = project();
    let config = project.path().join("configs/lone_glass.toml");
    let text = std::fs::read_to_string(&config).unwrap();
    let text = match text.contains("[budget]") {
        true => text.replace("[budget]", "[budget]\nrun_secs = 0.000001"),
        false => format!("{text}\n[budget]\nrun_secs = 0.000001\n"),
    };
    std::fs::write(&config, text).unwrap();
    let summary = json(
        project.path(),
        &[
            "run",
            "configs/lone_glass.toml",
            "--runs",
            "2",
            "--history",
            "h",
        ],
    );
    assert_eq!(summary["exit_code"], 2);
    for run in summary["runs"].as_array().unwrap() {
        assert_eq!(run["status"], "timeout");
        assert!(
            run["reason"].as_str().unwrap().contains("run_secs"),
            "{run}"
        );
    }
    assert_eq!(
        summary["counts"]["timeout"],
        summary["properties"].as_array().unwrap().len() * 2
    );
    let id = summary["campaign"].as_str().unwrap();
    let output = actcheck(
        project.path(),
        &["replay", "--campaign", id, "--history", "h"],
    );
    let text = stdout(&output);
    assert_eq!(output.status.code(), Some(0), "{text}{}", stderr(&output));
    assert!(
        text.contains("2 of 2 runs are the same")
            && text.contains("the wall-clock limit had ended the run"),
        "{text}"
    );
}

#[test]
fn invalid_budgets_are_refused() {
    let project = project();
    for (arguments, word) in [
        (["--time", "ten"], "not a duration such as"),
        (["--until-width", "1"], "between 0 and 1"),
        (["--max-failures", "0"], "--max-failures"),
    ] {
        let output = actcheck(
            project.path(),
            &[&["run", "configs/pick.toml"][..], &arguments].concat(),
        );
        assert_eq!(output.status.code(), Some(2));
        assert!(stderr(&output).contains(word), "{}", stderr(&output));
    }
    edit(
        &project.path().join("configs/pick.toml"),
        "action_secs = 60",
        "time = \"soon\"\nuntil_width = 2\nrun_secs = 0",
    );
    let output = actcheck(project.path(), &["check", "configs/pick.toml"]);
    let text = stderr(&output);
    for word in [
        "`budget.time`",
        "budget.until_width",
        "budget.run_secs",
        "3 errors",
    ] {
        assert!(text.contains(word), "no {word} in {text}");
    }
}
