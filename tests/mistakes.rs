//! Mistakes that people make at the command line, each with everything that the program prints
//! about it.
//!
//! A case is a file `tests/diagnostics/mistakes/AREA/NAME.case`; the output is beside it, in a file
//! of the same name with `.expected` appended. `UPDATE_EXPECT=1` writes these files. A case runs in
//! a copy of the shipped project:
//!
//! ```text
//! # What the person did.
//! $ check configs/pick.toml          (arguments)
//! --- rules/mine.rls                 (a file to write)
//! …
//! --- edit configs/pick.toml         (a file to edit: the text after `- ` becomes the text after `+ `; ⏎ ends a line)
//! - seed = 7
//! + sed = 7
//! ```
//!
//! A case whose first line contains `(history)` has a history of a campaign `k7f3` in `.actcheck`; in
//! one with `(Python package)`, `python3` has the package of `clients/python`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::support::expected::assert_expected;
use crate::support::{actcheck, copy, copy_made_history, edit, foreign, root, stderr, stdout};

/// Number of cases at least.
const LEAST: usize = 160;
/// A run's id in commands and outputs.
const RUN: &str = "k7f3-1";

fn cases() -> Vec<PathBuf> {
    let folder = root().join("tests/diagnostics/mistakes");
    let list = |folder: &Path| -> Vec<PathBuf> {
        std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .collect()
    };
    let mut cases: Vec<PathBuf> = list(&folder).iter().flat_map(|area| list(area)).collect();
    cases.retain(|path| path.extension().is_some_and(|ending| ending == "case"));
    cases.sort();
    cases
}

/// The id of the first run of a history.
pub fn first_run(history: &Path) -> String {
    let list = actcheck(history, &["list", "--history", ".", "--format", "csv"]);
    stdout(&list)
        .lines()
        .nth(1)
        .and_then(|line| line.split(',').next())
        .map(str::to_owned)
        .expect("a history with runs")
}

/// Writes and edits the files of a case. Returns its arguments.
pub fn set_up(text: &str, folder: &Path) -> Vec<String> {
    let mut parts = text.split("\n--- ");
    let head = parts.next().unwrap_or_default();
    for part in parts {
        let (title, body) = part.split_once('\n').unwrap_or((part, ""));
        match title.strip_prefix("edit ") {
            Some(file) => {
                let lines: Vec<&str> = body.lines().collect();
                for pair in lines.chunks(2) {
                    let [from, to] = pair else {
                        panic!("{title}: a line without its replacement")
                    };
                    let text = |line: &str, sign: char| {
                        let text = line
                            .strip_prefix(sign)
                            .unwrap_or_else(|| panic!("{title}: {line}"));
                        text.strip_prefix(' ').unwrap_or(text).replace('⏎', "\n")
                    };
                    edit(&folder.join(file), &text(from, '-'), &text(to, '+'));
                }
            }
            None => {
                let file = folder.join(title);
                std::fs::create_dir_all(file.parent().unwrap()).unwrap();
                std::fs::write(file, body).unwrap();
            }
        }
    }
    let command = head
        .lines()
        .find_map(|line| line.strip_prefix("$ "))
        .expect("a line `$ COMMAND`");
    // Every other part is in quotes.
    let parts = command.split('"').enumerate();
    let words = |(idx, part): (usize, &str)| match idx % 2 {
        0 => part.split_whitespace().map(str::to_owned).collect(),
        _ => vec![part.to_owned()],
    };
    parts.flat_map(words).collect()
}

/// Everything that the program prints about a case.
fn printed(case: &Path, history: &Path, run: &str) -> String {
    let text = std::fs::read_to_string(case).unwrap();
    let folder = tempfile::tempdir().unwrap();
    for part in ["configs", "models", "ontology", "rules"] {
        copy(&root().join(part), &folder.path().join(part));
    }
    if text.contains("(history)") {
        copy(history, &folder.path().join(".actcheck"));
    }
    let campaign = |id: &str| {
        id.rsplit_once('-')
            .map_or(id, |(campaign, _)| campaign)
            .to_owned()
    };
    let (of_run, shown) = (campaign(run), campaign(RUN));
    let arguments = set_up(&text, folder.path())
        .into_iter()
        .map(|word| word.replace(&shown, &of_run));
    let mut command = Command::new(env!("CARGO_BIN_EXE_actcheck"));
    if text.contains("(Python package)") {
        command.env("PATH", foreign::client_path());
    }
    let output = command
        .args(arguments)
        .current_dir(folder.path())
        .env_remove("CLICOLOR_FORCE")
        .envs([("NO_COLOR", "1"), ("COLUMNS", "100")])
        .output()
        .unwrap();
    let code = output
        .status
        .code()
        .map_or("none".to_owned(), |code| code.to_string());
    let all = format!("exit code {code}\n{}{}", stdout(&output), stderr(&output));
    let folder = folder.path().canonicalize().unwrap();
    let program = env!("CARGO_BIN_EXE_actcheck");
    all.replace(&*folder.to_string_lossy(), ".")
        .replace(program, "actcheck")
        .replace(&of_run, &shown)
}

/// Read each output as somebody who has never seen it: is it clear what is wrong, where, and what
/// to do?
#[test]
fn every_mistake_is_answered_with_its_place_and_a_way_out() {
    let cases = cases();
    assert!(cases.len() >= LEAST, "only {} cases", cases.len());
    let history = tempfile::tempdir().unwrap();
    copy_made_history(history.path());
    let run = first_run(history.path());
    let (next, done) = (AtomicUsize::new(0), Mutex::new(BTreeMap::new()));
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(2, usize::from) {
            scope.spawn(|| {
                while let Some(case) = cases.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let printed = printed(case, history.path(), &run);
                    done.lock()
                        .unwrap()
                        .insert(case.with_added_extension("expected"), printed);
                }
            });
        }
    });
    assert_expected(done.into_inner().unwrap());
}
