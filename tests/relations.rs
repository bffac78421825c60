//! Relations between pairs of runs: scenes that are run again with one change.

use std::path::Path;

use actcheck::history::History;
use serde_json::Value;

use crate::support::{actcheck, root, stderr, stdout};

/// Writes `pick_relations.toml` into a folder, edited, with absolute paths.
fn configuration(folder: &Path, edits: &[(&str, &str)]) {
    let text = std::fs::read_to_string(root().join("configs/pick_relations.toml")).unwrap();
    let mut text = text.replace("\"../", &format!("\"{}/", root().display()));
    for (old, new) in edits {
        assert!(text.contains(old), "{old}");
        text = text.replace(old, new);
    }
    std::fs::write(folder.join("pairs.toml"), text).unwrap();
}

fn json(folder: &Path, arguments: &[&str]) -> Value {
    let output = actcheck(folder, arguments);
    serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)))
}

fn relation<'a>(found: &'a Value, name: &str) -> &'a Value {
    let relations = found["relations"].as_array().unwrap();
    relations.iter().find(|it| it["relation"] == name).unwrap()
}

#[test]
fn the_pairs_of_a_campaign_are_the_same_for_any_number_of_workers_and_no_rate_counts_them() {
    let folder = tempfile::tempdir().unwrap();
    configuration(folder.path(), &[]);
    let run = |history: &str, jobs: &str| {
        json(
            folder.path(),
            &[
                "run",
                "pairs.toml",
                "--runs",
                "10",
                "--history",
                history,
                "--jobs",
                jobs,
                "--format",
                "json",
                "-q",
            ],
        )
    };
    let [one, two] = [run("one", "1"), run("two", "2")];
    assert_eq!(one["relations"], two["relations"]);
    let found = &one["relations"];
    for name in ["more_friction", "less_mass", "renamed", "mirrored"] {
        let relation = relation(found, name);
        assert_eq!(
            (&relation["inapplicable"], &relation["unjudged"]),
            (&0.into(), &0.into()),
            "{name}"
        );
        assert_eq!(relation["of"], 10, "{name}");
        let least = if name == "mirrored" { 8 } else { 10 };
        assert!(
            relation["holds"].as_u64().unwrap() >= least,
            "{name}: {relation}"
        );
    }
    let without = relation(found, "without_far_object");
    assert_eq!(
        without["of"].as_u64().unwrap() + without["inapplicable"].as_u64().unwrap(),
        10
    );
    let rules = json(
        folder.path(),
        &["list", "--rules", "--history", "one", "--format", "json"],
    );
    let moved = rules
        .as_array()
        .unwrap()
        .iter()
        .find(|it| it["property"] == "MovedObject")
        .unwrap();
    let counted = moved["passed"].as_u64().unwrap() + moved["failed"].as_u64().unwrap();
    assert_eq!(counted, 10, "{moved}");

    let id = found["campaign"].as_str().unwrap();
    let again = json(
        folder.path(),
        &["relate", id, "--history", "one", "--format", "json"],
    );
    assert_eq!(again, *found, "no pair is made twice");
    let merged = actcheck(folder.path(), &["merge", "one", "--into", "both"]);
    assert!(merged.status.success(), "{}", stderr(&merged));
    let merged = json(
        folder.path(),
        &["relate", id, "--history", "both", "--format", "json"],
    );
    assert_eq!(merged, *found, "the pairs come with their campaign");
    let page = actcheck(
        folder.path(),
        &["report", "--history", "one", "--html", "one.html"],
    );
    assert!(page.status.success(), "{}", stderr(&page));
}

#[test]
fn a_hand_that_is_2_cm_to_the_left_breaks_the_mirror_and_is_shrunk() {
    let folder = tempfile::tempdir().unwrap();
    let robots = folder.path().join("robots");
    std::fs::create_dir(&robots).unwrap();
    for file in ["mobile_manipulator.toml", "mobile_manipulator.urdf"] {
        let text = std::fs::read_to_string(root().join("models/robots").join(file)).unwrap();
        let text = text.replace(
            "grasp_link = \"grasp_link\"",
            "grasp_link = \"grasp_link\"\ngrasp_offset_m = [0.0, 0.02, 0.0]",
        );
        std::fs::write(robots.join(file), text).unwrap();
    }
    configuration(
        folder.path(),
        &[(
            "profile = \"mobile_manipulator\"",
            "profile = \"robots/mobile_manipulator.toml\"",
        )],
    );
    let arguments = [
        "run",
        "pairs.toml",
        "--runs",
        "20",
        "--history",
        "h",
        "--format",
        "json",
        "-q",
    ];
    let found = json(folder.path(), &arguments);
    let mirrored = relation(&found["relations"], "mirrored");
    assert!(mirrored["holds"].as_u64().unwrap() < 18, "{mirrored}");
    let renamed = relation(&found["relations"], "renamed");
    assert_eq!(renamed["holds"], 20, "names have no left and right");
    let pairs = found["relations"]["pairs"].as_array().unwrap();
    let broken = pairs
        .iter()
        .find(|it| it["relation"] == "mirrored" && it["outcome"] == "failed")
        .unwrap();
    let run = broken["run"].as_str().unwrap();
    let arguments = [
        "shrink",
        run,
        "--property",
        "mirrored",
        "--history",
        "h",
        "--format",
        "json",
    ];
    let shrunk = json(folder.path(), &arguments);
    assert_eq!(shrunk["failed"][0], "http://actions#mirrored", "{shrunk}");
    let words = shrunk["why"][0].as_str().unwrap();
    assert!(words.contains("then"), "{words}");
}

#[test]
fn faults_of_relations_name_their_place_and_the_way_out() {
    let folder = tempfile::tempdir().unwrap();
    configuration(folder.path(), &[("mirrored =", "mirored =")]);
    let output = actcheck(folder.path(), &["check", "pairs.toml"]);
    let said = stderr(&output);
    assert!(
        said.contains("mirored") && said.contains("did you mean `mirrored`"),
        "{said}"
    );

    let missing = "rules/relations/same_verdicts.rls\"\nrenamed";
    configuration(
        folder.path(),
        &[(missing, "rules/relations/no_such.rls\"\nrenamed")],
    );
    let said = stderr(&actcheck(folder.path(), &["check", "pairs.toml"]));
    assert!(
        said.contains("C022") && said.contains("no_such.rls"),
        "{said}"
    );

    let rule = folder.path().join("bad.rls");
    std::fs::write(
        &rule,
        "@prefix act: <http://actions#> .\nviolation(?p) :- before(?p, act:outcom, \"failed\") .\n",
    )
    .unwrap();
    let old = format!(
        "renamed = \"{}/rules/relations/same_verdicts.rls\"",
        root().display()
    );
    configuration(folder.path(), &[(&old, "renamed = \"bad.rls\"")]);
    let said = stderr(&actcheck(folder.path(), &["check", "pairs.toml"]));
    assert!(
        said.contains("bad.rls") && said.contains("act:outcome"),
        "{said}"
    );

    let config = root().join("configs/pick.toml");
    let arguments = [
        "run",
        config.to_str().unwrap(),
        "--runs",
        "1",
        "--history",
        "h",
        "-q",
    ];
    actcheck(folder.path(), &arguments);
    let history = History::open_to_read(&folder.path().join("h")).unwrap();
    let id = &history.campaigns().unwrap()[0].id;
    let output = actcheck(folder.path(), &["relate", id, "--history", "h"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("S055"), "{}", stderr(&output));
}
