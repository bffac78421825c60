//! Processes killed at any moment lose nothing: stored data is complete, and the same command
//! completes the rest.
//!
//! `ACTCHECK_KILLS` sets the number of kills.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use actcheck::history::{History, RunFilter};

use crate::history::run_ids;
use crate::support::planted::Dice;
use crate::support::{actcheck, copy_made_history, root, stderr, stdout};

const RUNS: usize = 4;

/// Starts a command in the checkout's root and kills it after a time. Returns whether it was still
/// running.
fn killed(arguments: &[String], after: Duration) -> bool {
    let mut child = Command::new(env!("CARGO_BIN_EXE_actcheck"))
        .args(arguments)
        .current_dir(root())
        .env("NO_COLOR", "1")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    std::thread::sleep(after);
    let is_running = child.try_wait().unwrap().is_none();
    child.kill().unwrap();
    child.wait().unwrap();
    is_running
}

fn ids(dir: &Path) -> Vec<String> {
    let Ok(history) = History::open_to_read(dir) else {
        return Vec::new();
    };
    run_ids(&history)
}

/// The digests of the traces in a history that is intact.
fn intact(dir: &Path, place: &str) -> Vec<String> {
    let output = actcheck(
        root(),
        &[
            "health",
            "--integrity",
            "--history",
            &dir.display().to_string(),
        ],
    );
    assert_eq!(
        output.status.code(),
        Some(0),
        "{place}: {}{}",
        stdout(&output),
        stderr(&output)
    );
    let history = History::open_to_read(dir).unwrap();
    let warning = history.tail_warning().unwrap();
    assert!(warning.is_none(), "{place}: {warning:?}");
    history
        .runs(&RunFilter::default())
        .unwrap()
        .into_iter()
        .map(|run| run.trace_hash)
        .collect()
}

#[test]
fn killed_processes_lose_nothing() {
    let kills: usize = std::env::var("ACTCHECK_KILLS")
        .ok()
        .and_then(|n| n.parse().ok())
        .unwrap_or(5);
    let folder = tempfile::tempdir().unwrap();
    let at = |name: String| folder.path().join(name);
    copy_made_history(&at("whole".to_owned()));
    let right = intact(&at("whole".to_owned()), "the original");
    let whole = at("whole".to_owned()).display().to_string();
    let mut dice = Dice::new(7);
    let mut table: BTreeMap<&str, [usize; 2]> = BTreeMap::new();
    for number in 0..kills {
        let kind = ["run", "resume", "merge", "recheck", "export"][number % 5];
        let place = format!("kill {number}: {kind}");
        let export = if number % 2 == 0 {
            "export rdf DIR.nq --history DIR"
        } else {
            "export tables DIR.set --dataset --history DIR"
        };
        let dir = at(format!("h{number}"));
        let name = dir.display().to_string();
        let words = |text: &str| -> Vec<String> {
            text.split(' ')
                .map(|word| word.replace("DIR", &name))
                .collect()
        };
        let after = Duration::from_millis(20 + dice.below(900));
        let runs = format!("run configs/quick.toml --runs {RUNS} --jobs 2 --history DIR");
        let hit = match kind {
            "run" => killed(&words(&runs), after),
            "resume" => {
                killed(&words(&runs), Duration::from_millis(500));
                killed(
                    &words("run configs/quick.toml --resume --jobs 2 --history DIR"),
                    after,
                )
            }
            "merge" => killed(&words(&format!("merge {whole} --into DIR")), after / 4),
            other => {
                copy_made_history(&dir);
                let command = if other == "recheck" {
                    "recheck --history DIR"
                } else {
                    export
                };
                killed(&words(command), after / 4)
            }
        };
        let kept = ids(&dir);
        let again = match kind {
            "run" | "resume" => {
                let resumed = words("run configs/quick.toml --resume --jobs 2 --history DIR");
                let output = actcheck(
                    root(),
                    &resumed.iter().map(String::as_str).collect::<Vec<_>>(),
                );
                // It was killed before the campaign was recorded, or after its end.
                if output.status.code() == Some(2) && ids(&dir).is_empty() {
                    words(&runs)
                } else {
                    Vec::new()
                }
            }
            "merge" => words(&format!("merge {whole} --into DIR")),
            "recheck" => words("recheck --history DIR"),
            _ => words(export),
        };
        if kind == "export" {
            // Whole or absent.
            let text = std::fs::read_to_string(format!("{name}.nq")).unwrap_or_default();
            assert!(text.is_empty() || text.ends_with(" .\n"), "{place}");
        }
        if !again.is_empty() {
            let output = actcheck(
                root(),
                &again.iter().map(String::as_str).collect::<Vec<_>>(),
            );
            assert!(
                output.status.code().is_some_and(|code| code < 2),
                "{place}: {}",
                stderr(&output)
            );
        }
        let now = ids(&dir);
        assert!(
            kept.iter().all(|run| now.contains(run)),
            "{place}: {kept:?} {now:?}"
        );
        assert_eq!(intact(&dir, &place), right, "{place}");
        let beside = std::fs::read_dir(folder.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name());
        let leftovers: Vec<_> = beside
            .filter(|name| name.to_string_lossy().ends_with(".tmp"))
            .collect();
        assert!(leftovers.is_empty(), "{place}: {leftovers:?}");
        table.entry(kind).or_default()[usize::from(hit)] += 1;
    }
    for (kind, [ended, hit]) in table {
        println!("{kind:8} {hit:4} killed while running, {ended:4} after its end: nothing lost");
    }
}
