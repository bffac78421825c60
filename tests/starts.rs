//! The robot at the start of a run: inside furniture or the floor it can't begin.

use std::path::Path;

use serde_json::Value;

use crate::support::{COARSE, actcheck, edit, shipped_project, stderr, stdout};

/// A project with the fixed arm, of which a campaign picks a can, in another home posture.
fn with_home(home: &str) -> tempfile::TempDir {
    let project = shipped_project();
    let robots = project.path().join("models/robots");
    edit(
        &robots.join("fixed_arm.toml"),
        "home = [-1.3, -0.5, 0.0, 2.0, 0.0, 1.64, 0.0]",
        &format!("home = {home}"),
    );
    let text = format!(
        "tests = [[\"Pick\"]]\ntest_count = 3\nseed = 7\nmodel_dir = \"models\"\nontology = \"ontology/actions.ttl\"\n\
        [robot]\nprofile = \"fixed_arm\"\n[objectSurface]\nobject_surfaces = [\"coffee_table\"]\n\
        [pickObject]\nmodel_list = [\"can\"]\n{COARSE}"
    );
    std::fs::write(project.path().join("c.toml"), text).unwrap();
    project
}

/// The exit code of a command, and its output, in one line.
fn said(folder: &Path, arguments: &[&str]) -> (i32, String) {
    let output = actcheck(folder, arguments);
    let words = (stdout(&output) + &stderr(&output)).replace('│', " ");
    (
        output.status.code().unwrap(),
        words.split_whitespace().collect::<Vec<_>>().join(" "),
    )
}

#[test]
fn a_robot_in_the_table_is_an_error_of_the_configuration() {
    let project = with_home("[0.0, 1.0, 0.0, 1.6, 0.0, 0.5, 0.0]");
    for command in [
        &["check", "c.toml"][..],
        &["run", "c.toml", "--jobs", "1", "--history", "h"],
    ] {
        let (code, said) = said(project.path(), command);
        assert_eq!(code, 2, "{said}");
        assert!(
            said.contains("S025") && said.contains("cm inside `coffee_table_1` at the start"),
            "{said}"
        );
        assert!(
            said.contains("the robot's `") && said.contains("_link` is "),
            "{said}"
        );
        assert!(!said.contains("panic"), "{said}");
    }
    assert!(
        !project.path().join("h").exists(),
        "no run was charged to the robot, and no campaign begun"
    );
}

#[test]
fn a_robot_beside_the_table_overlaps_nothing() {
    let project = with_home("[-1.3, -0.5, 0.0, 2.0, 0.0, 1.64, 0.0]");
    let (code, said) = said(project.path(), &["check", "c.toml"]);
    assert!(code == 0 && !said.contains("S025"), "{said}");
}

/// The hand is just above the table, where there is a can in some scenes: these are discarded and
/// counted.
#[test]
fn scenes_in_which_the_robot_overlaps_by_chance_are_discarded() {
    let project = with_home("[0.0, 0.5, 0.0, 2.05, 0.0, 0.6, 0.0]");
    let folder = project.path();
    edit(
        &folder.join("c.toml"),
        "tests = [[\"Pick\"]]\ntest_count = 3",
        "tests = [[\"PerceivePlane\"]]\ntest_count = 8",
    );
    let (code, checked) = said(folder, &["check", "c.toml"]);
    assert_eq!(code, 0, "{checked}");
    assert!(
        checked.contains("S025") && checked.contains("scenes: such scenes are discarded"),
        "{checked}"
    );
    let ran = actcheck(
        folder,
        &[
            "run",
            "c.toml",
            "--jobs",
            "1",
            "--history",
            "h",
            "--format",
            "json",
        ],
    );
    let summary: Value =
        serde_json::from_str(&stdout(&ran)).unwrap_or_else(|_| panic!("{}", stderr(&ran)));
    assert_eq!(
        summary["runs"].as_array().map(Vec::len),
        Some(8),
        "{summary:#}"
    );
    let (_, health) = said(folder, &["health", "--history", "h", "--format", "json"]);
    assert!(health.contains("at the start"), "{health}");
}

/// A place that is on no map is a mistake, also where no world has any places, or where there is no
/// world.
#[test]
fn misspelt_places_are_errors_also_without_maps() {
    let folder = tempfile::tempdir().unwrap();
    let worlds = folder.path().join("models/worlds");
    std::fs::create_dir_all(&worlds).unwrap();
    let world = "<sdf version=\"1.9\"><world name=\"bare\"></world></sdf>";
    std::fs::write(worlds.join("bare.sdf"), world).unwrap();
    let config = "tests = [[\"MoveTo\"]]\ntest_count = 2\nmodel_dir = \"models\"\n[world]\nworlds = [\"bare\"]\n\
        [objectLocation]\nlocation_list = [\"kitchen_counter\"]\n";
    std::fs::write(folder.path().join("c.toml"), config).unwrap();
    let nowhere = config.replace("[world]\nworlds = [\"bare\"]\n", "");
    std::fs::write(folder.path().join("nowhere.toml"), nowhere).unwrap();
    let both = config
        .replace("[\"bare\"]", "[\"bare\", \"lab\"]")
        .replace("kitchen_counter", "door");
    std::fs::write(folder.path().join("both.toml"), both).unwrap();
    for (file, why) in [
        ("c.toml", "the world `bare` has none"),
        ("both.toml", "the world `bare` has none of the locations"),
        ("nowhere.toml", "names no world"),
    ] {
        for command in [&["check", file][..], &["run", file, "--history", "h"]] {
            let (code, said) = said(folder.path(), command);
            assert_eq!(code, 2, "{said}");
            assert!(said.contains("C021") && said.contains(why), "{said}");
        }
    }
}
