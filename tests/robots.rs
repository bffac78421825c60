//! Robots: those that ship with the project do their task, and what is wrong with one is told with its place.

use serde_json::Value;

use crate::support::{actcheck, project, root, stderr, stdout};

/// The lone glass of `configs/lone_glass.toml`, for the arm that can't drive.
fn lone_glass_for_fixed_arm() -> String {
    let text = std::fs::read_to_string(root().join("configs/lone_glass.toml")).unwrap();
    format!("{text}\n[robot]\nprofile = \"fixed_arm\"\n")
}

#[test]
fn a_fixed_arm_takes_a_lone_glass_nearly_always() {
    let project = project();
    std::fs::write(project.path().join("configs/lone.toml"), lone_glass_for_fixed_arm()).unwrap();
    let arguments = ["run", "configs/lone.toml", "--runs", "30", "--history", "h", "--format", "json"];
    let output = actcheck(project.path(), &arguments);
    let json: Value = serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)));
    let passed = json["runs_passed"]["count"].as_u64().unwrap();
    assert!(passed >= 28, "{passed} of 30 runs passed fully with a lone object and no noise");
}

/// Where the arm has to find ways around things, the same seed still gives the same bits, whatever the number of workers, and
/// every run can be made again from its record.
#[test]
fn a_campaign_of_the_fixed_arm_comes_out_the_same_and_replays() {
    let project = project();
    let run = |history: &str, jobs: &str| {
        let arguments =
            ["run", "configs/fixed_arm.toml", "--runs", "6", "--jobs", jobs, "--history", history, "--format", "csv"];
        stdout(&actcheck(project.path(), &arguments))
    };
    assert_eq!(run("h1", "1"), run("h2", "2"));
    let replayed = actcheck(project.path(), &["replay", "--sample", "3", "--history", "h1"]);
    assert_eq!(replayed.status.code(), Some(0), "{}{}", stdout(&replayed), stderr(&replayed));
}
