//! `actcheck bisect`: planted changes of rules, settings and programs are found in as few steps as
//! halving needs.

use std::path::Path;
use std::process::{Command, Output, Stdio};

use regex::Regex;

use crate::support::{
    COARSE, actcheck, copy, copy_made_history, edit, processes_in, project_with, root, script,
    shipped_project, signal, stderr, stdout,
};

/// Runs git in a folder, without the user's settings. Returns its output.
fn git(folder: &Path, args: &[&str]) -> String {
    let identity = ["-c", "user.name=Ada", "-c", "user.email=ada@example.org"];
    let output = Command::new("git")
        .args(identity)
        .args(args)
        .current_dir(folder)
        .env("GIT_CONFIG_GLOBAL", "/dev/null")
        .output()
        .unwrap();
    assert!(output.status.success(), "git {args:?}: {}", stderr(&output));
    stdout(&output)
}

fn commit(folder: &Path, message: &str) {
    git(
        folder,
        &[
            "commit",
            "--quiet",
            "--all",
            "--allow-empty",
            "--message",
            message,
        ],
    );
}

/// The program, with its own folder for temporary files, which must be empty at the end.
fn command(folder: &Path, args: &[&str]) -> Command {
    let temporary = folder.join(".git/temporary");
    std::fs::create_dir_all(&temporary).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_actcheck"));
    command
        .arg("bisect")
        .args(args)
        .current_dir(folder)
        .env("NO_COLOR", "1")
        .env("TMPDIR", temporary);
    command
}

fn bisect(folder: &Path, args: &[&str]) -> Output {
    let output = command(folder, args).output().unwrap();
    assert_eq!(
        leftovers(folder),
        Vec::<String>::new(),
        "temporary files remain"
    );
    output
}

fn leftovers(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder.join(".git/temporary")).unwrap();
    entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect()
}

/// The words of the steps, such as `good`, without the two ends.
fn steps(text: &str) -> Vec<&str> {
    let lines = text.lines().filter(|line| line.ends_with(" left)"));
    lines.map(|line| line.split(' ').next().unwrap()).collect()
}

/// A repository with the shipped project and a history of four runs in `h`. The first commit has
/// the tag `first`.
fn repository() -> tempfile::TempDir {
    let project = tempfile::tempdir().unwrap();
    for name in ["ontology", "rules"] {
        copy(&root().join(name), &project.path().join(name));
    }
    begin(project.path());
    copy_made_history(&project.path().join("h"));
    project
}

fn begin(folder: &Path) {
    git(folder, &["init", "--quiet", "--initial-branch", "main"]);
    git(folder, &["add", "."]);
    commit(folder, "Change 1");
    git(folder, &["tag", "first"]);
}

/// A rule that demands a way of 20 metres.
fn plant(folder: &Path) {
    edit(
        &folder.join("rules/moved_object.rls"),
        "?d > 0.02",
        "?d > 20.0",
    );
}

/// Commits 2 to 10: the third has the planted change, and the sixth, in the middle, does not parse.
fn ten_commits(folder: &Path) {
    for number in 2..=10 {
        match number {
            3 => plant(folder),
            6 => edit(
                &folder.join("rules/close_object.rls"),
                "success(",
                "success(((",
            ),
            7 => edit(
                &folder.join("rules/close_object.rls"),
                "success(((",
                "success(",
            ),
            _ => {}
        }
        commit(folder, &format!("Change {number}"));
    }
}

#[test]
fn a_planted_change_is_found_among_ten_commits_past_a_broken_one() {
    let project = repository();
    let folder = project.path();
    ten_commits(folder);
    std::fs::write(folder.join("rules/moved_object.rls"), "not a rule").unwrap();
    let state = || {
        (
            git(folder, &["status", "--porcelain"]),
            std::fs::read(folder.join(".git/index")).unwrap(),
        )
    };
    let before = state();
    let output = bisect(folder, &["--good", "first", "--history", "h"]);
    let text = stdout(&output);
    assert_eq!(output.status.code(), Some(0), "{text}{}", stderr(&output));
    assert!(state() == before, "the checkout or the index changed");
    let steps = steps(&text);
    assert!(steps.len() <= 4 && steps.contains(&"skipped"), "{text}");
    let planted = git(folder, &["rev-parse", "HEAD~7"]);
    assert!(
        text.contains(&format!("the first bad revision is {}", planted.trim())),
        "{text}"
    );
    for part in [
        "Change 3 (Ada, ",
        "since ",
        "MovedObject: passed → failed",
        "missing ?d > 20",
        "by rules/moved_object.rls:",
    ] {
        assert!(text.contains(part), "no `{part}` in\n{text}");
    }
    assert!(
        Regex::new(r"skipped  \w+ Change 6: rules/close_object.rls:\d+: ")
            .unwrap()
            .is_match(&text),
        "{text}"
    );
    // The history is as before.
    let again = bisect(
        folder,
        &[
            "--good",
            "first",
            "--history",
            "h",
            "--property",
            "MovedObject",
        ],
    );
    assert_eq!(stdout(&again), text);
}

#[test]
fn the_newer_end_may_be_good() {
    let project = repository();
    let folder = project.path();
    plant(folder);
    commit(folder, "Change 2");
    git(folder, &["tag", "planted"]);
    edit(
        &folder.join("rules/moved_object.rls"),
        "?d > 20.0",
        "?d > 0.02",
    );
    commit(folder, "Change 3");
    commit(folder, "Change 4");
    let output = bisect(
        folder,
        &["--good", "HEAD", "--bad", "planted", "--history", "h"],
    );
    let text = stdout(&output);
    assert_eq!(output.status.code(), Some(0), "{text}{}", stderr(&output));
    let mended = git(folder, &["rev-parse", "HEAD~1"]);
    assert!(
        text.contains(&format!("the first good revision is {}", mended.trim())),
        "{text}"
    );
    assert!(text.contains("MovedObject: failed → passed"), "{text}");
}

#[test]
fn skipped_neighbours_of_the_first_bad_revision_are_listed() {
    let project = repository();
    let folder = project.path();
    edit(
        &folder.join("rules/close_object.rls"),
        "success(",
        "success(((",
    );
    commit(folder, "Change 2");
    edit(
        &folder.join("rules/close_object.rls"),
        "success(((",
        "success(",
    );
    plant(folder);
    commit(folder, "Change 3");
    let output = bisect(folder, &["--good", "first", "--history", "h"]);
    let text = stdout(&output);
    assert_eq!(output.status.code(), Some(1), "{text}{}", stderr(&output));
    assert!(
        text.contains("is one of these") && text.ends_with(" Change 3\n"),
        "{text}"
    );
    // An end is not skipped.
    let output = bisect(folder, &["--good", "HEAD~1", "--history", "h"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        stderr(&output).contains("X065") && stderr(&output).contains("Change 2 can't be judged"),
        "{}",
        stderr(&output)
    );
}

#[test]
fn ends_between_which_nothing_can_be_found_are_refused_with_the_way_out() {
    let project = repository();
    let folder = project.path();
    plant(folder);
    commit(folder, "Change 2");
    commit(folder, "Change 3");
    git(folder, &["checkout", "--quiet", "-b", "side", "first"]);
    commit(folder, "Aside");
    let refused = |args: &[&str], code: &str, way_out: &str| {
        let output = bisect(folder, &[args, &["--history", "h"]].concat());
        let text = stderr(&output)
            .split_whitespace()
            .filter(|word| *word != "│")
            .collect::<Vec<_>>()
            .join(" ");
        assert_eq!(
            output.status.code(),
            Some(2),
            "{args:?}: {}{text}",
            stdout(&output)
        );
        assert!(
            text.contains(code) && text.contains(way_out),
            "{args:?}: {text}"
        );
    };
    refused(
        &["--good", "main", "--bad", "main~0"],
        "X063",
        "are the same revision",
    );
    refused(
        &["--good", "first", "--bad", "nowhere"],
        "X062",
        "`--bad nowhere`",
    );
    refused(
        &["--good", "side", "--bad", "main"],
        "X063",
        "begin at their last common revision: `--good",
    );
    refused(
        &["--good", "main~1", "--bad", "main"],
        "X064",
        "don't differ",
    );
    refused(
        &["--good", "main", "--bad", "first"],
        "X064",
        "swap the ends",
    );
    refused(
        &[
            "--good",
            "first",
            "--bad",
            "main",
            "--property",
            "MovdObject",
        ],
        "X045",
        "MovdObject",
    );
    refused(
        &["--good", "first", "--bad", "main", "--ontology", "none.ttl"],
        "X065",
        "it has no none.ttl",
    );
    let without_git = command(folder, &["--good", "first"])
        .env("PATH", "")
        .output()
        .unwrap();
    assert!(stderr(&without_git).contains("X060") && stderr(&without_git).contains("install git"));
    let outside = tempfile::tempdir().unwrap();
    let args = ["bisect", "--good", "first"];
    assert!(stderr(&actcheck(outside.path(), &args)).contains("X061"));
}

#[test]
fn a_setting_that_makes_a_campaign_worse_is_found_by_rates() {
    let project = project_with(COARSE);
    let folder = project.path();
    begin(folder);
    let config = folder.join("configs/pick.toml");
    commit(folder, "Change 2");
    edit(
        &config,
        "position_noise_m = 0.025",
        "position_noise_m = 0.25",
    );
    commit(folder, "Change 3");
    commit(folder, "Change 4");
    let output = bisect(
        folder,
        &[
            "configs/pick.toml",
            "--good",
            "first",
            "--scenes",
            "10",
            "--most-scenes",
            "20",
        ],
    );
    let text = stdout(&output);
    assert_eq!(output.status.code(), Some(0), "{text}{}", stderr(&output));
    let planted = git(folder, &["rev-parse", "HEAD~1"]);
    assert!(
        text.contains(&format!("the first bad revision is {}", planted.trim())),
        "{text}"
    );
    assert!(
        text.contains("scenes (good end: ") && text.contains(": passed → failed"),
        "{text}"
    );
}

#[test]
fn a_list_of_programs_is_searched_and_a_broken_one_is_skipped() {
    let project = project_with(COARSE);
    let folder = project.path();
    let text = std::fs::read_to_string(folder.join("configs/pick.toml")).unwrap();
    let blind = text.replace("position_noise_m = 0.025", "position_noise_m = 0.25");
    std::fs::write(folder.join("configs/blind.toml"), blind).unwrap();
    let program = env!("CARGO_BIN_EXE_actcheck");
    script(
        &folder.join("good"),
        &format!("#!/bin/sh\nexec {program} \"$@\"\n"),
    );
    script(
        &folder.join("bad"),
        &format!("#!/bin/sh\nshift 2\nexec {program} run configs/blind.toml \"$@\"\n"),
    );
    script(
        &folder.join("broken"),
        "#!/bin/sh\necho out of order >&2\nexit 3\n",
    );
    let all = [
        "--programs",
        "./good",
        "./broken",
        "./good",
        "./bad",
        "./bad",
    ];
    let args = [
        &["configs/pick.toml", "--by", "outcome", "--scenes", "3"],
        &all[..],
    ]
    .concat();
    std::fs::create_dir(folder.join(".git")).unwrap();
    let output = bisect(folder, &args);
    let text = stdout(&output);
    assert_eq!(output.status.code(), Some(0), "{text}{}", stderr(&output));
    assert!(text.contains("the first bad program is ./bad"), "{text}");
    let args = [
        "configs/pick.toml",
        "--by",
        "outcome",
        "--scenes",
        "3",
        "--programs",
        "./good",
        "./broken",
        "./bad",
    ];
    let output = bisect(folder, &args);
    let text = stdout(&output);
    assert_eq!(output.status.code(), Some(1), "{text}{}", stderr(&output));
    assert!(
        text.contains("skipped  ./broken: it can't run the scenes: exit status: 3, out of order"),
        "{text}"
    );
}

#[test]
fn ctrl_c_ends_the_build_and_leaves_nothing() {
    let project = shipped_project();
    let folder = project.path();
    begin(folder);
    commit(folder, "Change 2");
    let build = "touch started; sleep 1000 & wait";
    let args = ["configs/pick.toml", "--good", "first", "--build", build];
    let child = command(folder, &args)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let tree = loop {
        let scratch = leftovers(folder)
            .pop()
            .map(|name| folder.join(".git/temporary").join(name).join("tree"));
        if let Some(tree) = scratch.filter(|tree| tree.join("started").exists()) {
            break std::fs::canonicalize(tree).unwrap();
        }
        std::thread::yield_now();
    };
    assert!(!processes_in(&tree).is_empty());
    signal(child.id(), "INT");
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", stderr(&output));
    assert!(
        processes_in(&tree).is_empty(),
        "processes of the build remain"
    );
    assert_eq!(leftovers(folder), Vec::<String>::new());
}
