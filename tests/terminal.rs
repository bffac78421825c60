//! Width and colours of the output, and the failures that a campaign prints while it runs.
//!
//! `COLUMNS` replaces the width of a terminal, and `CLICOLOR_FORCE` a terminal with colours.

use std::path::Path;
use std::process::{Command, Output};

use crate::support::expected::assert_expected;
use crate::support::{edit, made_history, root, shipped_project, stderr, stdout};

fn run(folder: &Path, arguments: &[&str], variables: &[(&str, &str)]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_actcheck"));
    for name in ["NO_COLOR", "CLICOLOR", "CLICOLOR_FORCE", "COLUMNS", "TERM"] {
        command.env_remove(name);
    }
    command
        .args(arguments)
        .envs(variables.iter().copied())
        .current_dir(folder)
        .output()
        .unwrap()
}

/// A text without its colours.
fn plain(text: &str) -> String {
    regex::Regex::new("\u{1b}\\[[0-9;]*m")
        .unwrap()
        .replace_all(text, "")
        .into_owned()
}

fn ids(list: &str) -> Vec<&str> {
    list.lines()
        .skip(1)
        .filter_map(|line| line.split(',').next())
        .collect()
}

/// The commands that people look at, over a history in this folder.
fn looks(run: &str) -> Vec<Vec<&str>> {
    let commands = [
        "list --history .",
        "show RUN --history .",
        "why RUN --history .",
        "analyse --history .",
        "health --history .",
        "rules --history .",
        "explain C003",
        "explain",
        "query --named failure-rates --history .",
    ];
    commands
        .map(|command| {
            command
                .split(' ')
                .map(|word| if word == "RUN" { run } else { word })
                .collect()
        })
        .into()
}

#[test]
fn every_line_fits_the_terminal_and_no_word_is_broken() {
    let history = made_history();
    let list = stdout(&run(
        history.path(),
        &["list", "--history", ".", "--format", "csv"],
        &[],
    ));
    let names = ["ObjectInGripper", "NoGraspCollisions", "PlaneReported"];
    for command in looks(ids(&list)[0]) {
        let wide = stdout(&run(history.path(), &command, &[]));
        for width in ["50", "80", "200"] {
            let text = stdout(&run(history.path(), &command, &[("COLUMNS", width)]));
            let most: usize = width.parse().unwrap();
            for line in text.lines() {
                // A command to copy, or a long name, may be wider than the terminal.
                let has_long_word = line.split(' ').any(|word| word.chars().count() * 2 > most);
                let fits =
                    line.trim_end().chars().count() <= most || has_long_word || line.contains('`');
                assert!(fits, "{command:?} at {width}: {line}");
            }
            for name in names.iter().filter(|name| wide.contains(**name)) {
                assert!(
                    text.contains(name),
                    "{command:?} at {width} breaks {name}:\n{text}"
                );
            }
        }
    }
}

#[test]
fn colours_change_no_letter_and_can_be_forbidden() {
    let folder = shipped_project();
    edit(
        &folder.path().join("configs/pick.toml"),
        "seed = 7",
        "sed = 7",
    );
    let check = |variables: &[(&str, &str)]| {
        stderr(&run(
            folder.path(),
            &["check", "configs/pick.toml"],
            variables,
        ))
    };
    let bare = check(&[]);
    assert!(!bare.contains('\u{1b}'), "a pipe has no colours: {bare}");
    let coloured = check(&[("CLICOLOR_FORCE", "1")]);
    assert!(
        coloured.contains("\u{1b}[31m"),
        "the terminal's own red: {coloured:?}"
    );
    assert_eq!(plain(&coloured), bare);
    for forbidden in [
        &[("CLICOLOR_FORCE", "1"), ("NO_COLOR", "1")][..],
        &[("CLICOLOR", "1")],
        &[("TERM", "dumb")],
    ] {
        assert_eq!(check(forbidden), bare, "{forbidden:?}");
    }
}

/// `UPDATE_EXPECT=1` writes the files. Look at them in a light and in a dark terminal: `cat` shows
/// the colours.
#[test]
fn messages_and_tables_look_as_in_the_files_at_every_width() {
    let folder = shipped_project();
    edit(
        &folder.path().join("configs/pick.toml"),
        "seed = 7",
        "sed = 7",
    );
    let mut texts = Vec::new();
    for (name, arguments) in [
        ("mistake", &["check", "configs/pick.toml"][..]),
        ("rules", &["list", "--rules"]),
        ("explain", &["explain", "C021"]),
        ("help", &["help", "check"]),
    ] {
        for width in ["50", "200"] {
            for (colours, forced) in [("plain", "0"), ("colours", "1")] {
                let output = run(
                    folder.path(),
                    arguments,
                    &[("COLUMNS", width), ("CLICOLOR_FORCE", forced)],
                );
                let file = root().join(format!("tests/terminal/{name}.{width}.{colours}"));
                texts.push((file, stdout(&output) + &stderr(&output)));
            }
        }
    }
    assert_expected(texts);
}

/// A campaign of twelve runs, each of which breaks at once.
fn breaking(folder: &Path, more: &[&str], variables: &[(&str, &str)]) -> Output {
    run(
        folder,
        &[
            &["run", "configs/pick.toml", "--runs", "12", "--history", "h"],
            more,
        ]
        .concat(),
        variables,
    )
}

#[test]
fn a_failure_is_printed_once_when_it_happens_or_in_the_result() {
    let project = shipped_project();
    let config = project.path().join("configs/pick.toml");
    edit(
        &config,
        "test_launcher = \"reference\"",
        "test_launcher = \"sh ../skill.sh\"",
    );
    edit(&config, "[physics]", "[skill]\nmax_broken = 100\n[physics]");
    std::fs::write(project.path().join("skill.sh"), "exit 3\n").unwrap();
    let told = |output: &Output| -> Vec<String> {
        stderr(output)
            .lines()
            .filter(|line| line.starts_with("broken "))
            .map(str::to_owned)
            .collect::<Vec<String>>()
    };
    let usual = breaking(project.path(), &["--jobs", "2"], &[]);
    assert_eq!(told(&usual), [""; 0], "{}", stderr(&usual));
    let result = stdout(&usual);
    assert!(
        result.contains("12 runs broken:") && result.contains("… 9 more"),
        "{result}"
    );
    assert!(
        result.contains(" show ") && result.contains(" list --campaign "),
        "{result}"
    );
    let verbose = breaking(project.path(), &["--jobs", "2", "-v"], &[]);
    let lines = told(&verbose);
    let numbers: Vec<usize> = lines
        .iter()
        .map(|line| line.split(['-', ' ']).nth(2).unwrap().parse().unwrap())
        .collect();
    assert_eq!(numbers, (1..=12).collect::<Vec<_>>(), "{lines:?}");
    assert!(stderr(&verbose).contains("exited with code 3"));
    let result = stdout(&verbose);
    assert!(
        result.contains("12 runs broken\n") && !result.contains("exited with code 3"),
        "{result}"
    );
    let quiet = breaking(project.path(), &["-q"], &[]);
    assert_eq!(stderr(&quiet), "");
    let result = stdout(&quiet);
    assert!(
        result.contains("T = ")
            && result.contains("exited with code 3")
            && !result.contains("pass rate"),
        "{result}"
    );
    let forced = [("CLICOLOR_FORCE", "1"), ("COLUMNS", "50")];
    let narrow = stderr(&breaking(project.path(), &["-v"], &forced));
    assert!(
        narrow.starts_with("\u{1b}[33mbroken\u{1b}[0m "),
        "{narrow:?}"
    );
    let is_command = |line: &str| line.contains(" show ");
    assert!(
        plain(&narrow)
            .lines()
            .all(|line| line.chars().count() <= 50 || is_command(line)),
        "{}",
        plain(&narrow)
    );
}
