//! A second judgement of shipped campaigns from their exports alone, in Python, without the rules:
//! it agrees with the stored outcomes, or names the reason.

use std::path::Path;
use std::process::{Command, Output};

use tempfile::TempDir;

use crate::support::{actcheck, edit, foreign, project, root, shipped, stderr, stdout};

/// A shipped campaign, run completely; of whole tasks, half of the runs with coarse physics, which
/// take a sixth of the time.
fn made(campaign: &str) -> (TempDir, u64) {
    if campaign == "pick" {
        return (shipped("pick").copied(), 15);
    }
    let folder = project();
    let config = format!("configs/{campaign}.toml");
    let ran = actcheck(
        folder.path(),
        &[
            "run",
            &config,
            "--runs",
            "8",
            "--jobs",
            "2",
            "--history",
            "h",
        ],
    );
    assert!(
        ran.status.code().is_some_and(|code| code < 2),
        "{}",
        stderr(&ran)
    );
    (folder, 8)
}

/// Exports the history `h` of a folder with all facts, and judges it anew.
fn judged_anew(python: &Path, folder: &Path) -> Output {
    let exported = actcheck(
        folder,
        &["export", "tables", "tables", "--complete", "--history", "h"],
    );
    assert!(exported.status.success(), "{}", stderr(&exported));
    Command::new(python)
        .args(["-m", "second_judge", "tables"])
        .current_dir(folder)
        .env("PYTHONPATH", root().join("notebooks"))
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .output()
        .unwrap()
}

/// The number of outcomes of a property on which both agree.
fn agreed(report: &str, property: &str) -> u64 {
    let line = report
        .lines()
        .find(|line| line.starts_with(&format!("{property} ")))
        .expect(property);
    let count = line
        .split("agree:")
        .nth(1)
        .and_then(|rest| rest.split_whitespace().next());
    count.and_then(|count| count.parse().ok()).expect(line)
}

#[test]
fn a_second_judgement_without_the_rules_agrees_with_every_outcome() {
    let Some(python) = foreign::python() else {
        return;
    };
    for (campaign, properties) in [
        (
            "pick",
            [
                "CloseObject",
                "ObjectGrasped",
                "NoGraspCollisions",
                "MovedObject",
                "ObjectInGripper",
            ]
            .as_slice(),
        ),
        (
            "pick_and_place",
            &[
                "CloseObject",
                "ObjectGrasped",
                "NoGraspCollisions",
                "MovedObject",
                "ObjectInGripper",
                "PlaneReported",
                "PlaneFound",
                "ObjectsDetected",
                "PlaceReported",
                "ObjectOnSurface",
                "ObjectReleased",
                "NoPlaceCollisions",
                "GoalReported",
                "NoDriveCollisions",
                "GoalReached",
                "LocalisationAgrees",
                "StayedInZone",
            ],
        ),
    ] {
        let (folder, runs) = made(campaign);
        let output = judged_anew(python, folder.path());
        let report = stdout(&output);
        assert!(
            output.status.success(),
            "{campaign}: {report}{}",
            stderr(&output)
        );
        // All runs, up to outcomes on their limit.
        for property in properties {
            assert!(
                agreed(&report, property) >= runs - 1,
                "{campaign}: {property}: {report}"
            );
        }
        assert!(!report.contains("not judged"), "{report}");
    }
}

#[test]
fn a_second_judgement_notices_a_wrong_rule() {
    let Some(python) = foreign::python() else {
        return;
    };
    let folder = project();
    edit(
        &folder.path().join("rules/moved_object.rls"),
        "?d > 0.02",
        "?d < 0.02",
    );
    let ran = actcheck(
        folder.path(),
        &["run", "configs/pick.toml", "--runs", "2", "--history", "h"],
    );
    assert!(
        ran.status.code().is_some_and(|code| code < 2),
        "{}",
        stderr(&ran)
    );
    let output = judged_anew(python, folder.path());
    assert_eq!(
        output.status.code(),
        Some(1),
        "{}{}",
        stdout(&output),
        stderr(&output)
    );
    let unexplained = stdout(&output)
        .lines()
        .filter(|line| line.ends_with("(unexplained)"))
        .count();
    assert!(
        stdout(&output).contains(" MovedObject: stored ") && unexplained == 2,
        "{}",
        stdout(&output)
    );
}

/// Properties about time are judged from the exported course alone, as their labels say.
#[test]
fn properties_about_time_can_be_judged_from_the_exported_course() {
    let Some(python) = foreign::python() else {
        return;
    };
    let folder = project();
    let config = folder.path().join("configs/pick_and_place.toml");
    edit(
        &config,
        "ontology = \"../ontology/actions.ttl\"",
        "ontology = \"../ontology/time.ttl\"",
    );
    let ran = actcheck(
        folder.path(),
        &[
            "run",
            "configs/pick_and_place.toml",
            "--runs",
            "6",
            "--history",
            "h",
        ],
    );
    assert!(
        ran.status.code().is_some_and(|code| code < 2),
        "{}",
        stderr(&ran)
    );
    let exported = actcheck(
        folder.path(),
        &["export", "tables", "tables", "--course", "--history", "h"],
    );
    assert!(exported.status.success(), "{}", stderr(&exported));
    let judge = || {
        Command::new(python)
            .args(["-m", "second_judge.time_properties", "tables"])
            .current_dir(folder.path())
            .env("PYTHONPATH", root().join("notebooks"))
            .env("PYTHONDONTWRITEBYTECODE", "1")
            .output()
            .unwrap()
    };
    let output = judge();
    let report = stdout(&output);
    assert!(output.status.success(), "{report}{}", stderr(&output));
    let names = [
        "StillAtTheEnd",
        "SmoothHand",
        "SmoothDrive",
        "ShortPath",
        "UprightWhenLifted",
        "HeldWhileLifted",
        "OneGrasp",
    ];
    for property in names.into_iter().chain(["SettlesAfterRelease"]) {
        assert!(agreed(&report, property) >= 4, "{property}: {report}");
    }
}
