//! Messages lead on: none advises the command that printed it, and stored outcomes are reported
//! whatever else is missing.

use std::path::Path;
use std::process::Output;

use crate::support::{actcheck, shipped, stderr, stdout};

fn asked(folder: &Path, arguments: &[&str]) -> (Option<i32>, String, String) {
    let output: Output = actcheck(folder, arguments);
    (output.status.code(), stdout(&output), stderr(&output))
}

/// A query about `act:Botle` had no answers, and succeeded.
#[test]
fn a_query_with_an_unknown_class_fails_and_names_the_known_one() {
    let project = shipped("pick").copied();
    let ask = |query: &str| asked(project.path(), &["query", query, "--history", "h"]);
    let (code, _, said) = ask("SELECT ?thing { ?thing a act:Botle }");
    assert_eq!(code, Some(2), "{said}");
    assert!(
        said.contains("R028") && said.contains("did you mean `act:Bottle`?"),
        "{said}"
    );
    let (code, _, said) = ask("SELECT ?thing { ?thing a act:Xylophone }");
    assert_eq!(code, Some(2), "{said}");
    assert!(
        said.contains("actcheck query --named") && !said.contains("describe it"),
        "{said}"
    );
    // Nothing is wrong with a query that has no answers.
    let (code, _, said) = ask("SELECT ?run { ?run a act:Run ; act:score 17.0 }");
    assert_eq!(code, Some(0), "{said}");
}

/// The outcomes are in the history; a rule is only needed to explain them.
#[test]
fn a_missing_rule_file_does_not_block_the_report_of_stored_outcomes() {
    let project = shipped("pick").copied();
    std::fs::remove_file(project.path().join("rules/close_object.rls")).unwrap();
    for command in [
        ["report", "--html", "report.html", "--history", "h"].as_slice(),
        &["report", "--junit", "report.xml", "--history", "h"],
        &["analyse", "--history", "h"],
    ] {
        let (code, printed, said) = asked(project.path(), command);
        assert_eq!(code, Some(0), "{said}");
        assert!(command[1] == "--junit" || said.contains("O009"), "{said}");
        assert!(
            command[0] == "report" || printed.contains("CloseObject"),
            "{printed}"
        );
    }
    // To judge, the rule is needed.
    let (code, _, said) = asked(
        project.path(),
        &["recheck", "CloseObject", "--history", "h"],
    );
    assert_eq!(code, Some(2), "{said}");
}

/// A report without the replays of deleted files did not mention them, and the examination of a
/// history advised itself.
#[test]
fn deleted_motion_is_mentioned_and_no_command_advises_itself() {
    let project = shipped("pick").copied();
    let campaigns = project.path().join("h/campaigns");
    let campaign = std::fs::read_dir(&campaigns)
        .unwrap()
        .next()
        .unwrap()
        .unwrap()
        .path();
    let of = |ending: &str| {
        let files = std::fs::read_dir(&campaign)
            .unwrap()
            .map(|entry| entry.unwrap().path());
        files
            .filter(|path| path.extension().is_some_and(|it| it == ending))
            .collect::<Vec<_>>()
    };
    for file in of("motion") {
        std::fs::remove_file(file).unwrap();
    }
    let (code, _, said) = asked(
        project.path(),
        &["report", "--html", "report.html", "--history", "h"],
    );
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("can't be replayed in the report"), "{said}");
    for file in of("runs") {
        std::fs::write(file, "not a segment").unwrap();
    }
    let (code, _, said) = asked(project.path(), &["health", "--integrity", "--history", "h"]);
    assert!(
        code != Some(0) && !said.contains("health --integrity"),
        "{said}"
    );
}

#[test]
fn a_part_of_an_mjcf_model_is_called_one() {
    let folder = tempfile::tempdir().unwrap();
    for (root, is_part) in [
        ("mujocoinclude", true),
        ("worldbody", true),
        ("thing", false),
    ] {
        let file = folder.path().join("arm.xml");
        std::fs::write(&file, format!("<{root}><body name=\"a\"/></{root}>")).unwrap();
        let (code, _, said) = asked(folder.path(), &["new", "robot", "arm.xml"]);
        assert_eq!(code, Some(2), "{said}");
        let words = said.split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(
            words.contains("a part of an MJCF model"),
            is_part,
            "{root}: {said}"
        );
        assert_eq!(
            words.contains("a URDF file begins with"),
            !is_part,
            "{root}: {said}"
        );
    }
}
