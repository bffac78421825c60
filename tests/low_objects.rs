//! Low and flat objects: the shipped robots take them from tables of all heights, and report the
//! obstacle if not.

use std::path::Path;

use serde_json::Value;

use crate::support::{actcheck, copy, root, shipped_project, stderr, stdout};

/// A configuration with a lone object on a surface and perfect sensors.
fn configuration(robot: &str, surface: &str, object: &str) -> String {
    let text = std::fs::read_to_string(root().join("configs/lone_glass.toml")).unwrap();
    let text = text
        .replace("\"glass\"", &format!("\"{object}\""))
        .replace("\"coffee_table\"", &format!("\"{surface}\""));
    format!("{text}\n[robot]\nprofile = \"{robot}\"\n")
}

fn project() -> tempfile::TempDir {
    let project = shipped_project();
    copy(
        &root().join("tests/models/low"),
        &project.path().join("models/objects"),
    );
    project
}

fn run(folder: &Path, (robot, surface, object): (&str, &str, &str), runs: &str) -> (String, u64) {
    let name = format!("configs/{robot}_{surface}_{object}.toml");
    std::fs::write(folder.join(&name), configuration(robot, surface, object)).unwrap();
    let history = format!("h_{robot}_{surface}_{object}");
    let output = actcheck(
        folder,
        &[
            "run",
            &name,
            "--runs",
            runs,
            "--history",
            &history,
            "--format",
            "json",
        ],
    );
    let text = stdout(&output);
    let json: Value = serde_json::from_str(&text).unwrap_or_else(|_| panic!("{}", stderr(&output)));
    let passed = json["runs_passed"]["count"].as_u64().unwrap();
    (format!("{text}{}", stderr(&output)), passed)
}

/// Regression: on surfaces higher than a coffee table, or in the middle of wide ones, the hand
/// can't point straight down, and the only other grasp put the fingertips into the surface.
#[test]
fn low_objects_are_picked_from_high_and_wide_surfaces() {
    let project = project();
    let cases = [
        ("mobile_manipulator", "workbench", "cube"),
        ("mobile_manipulator", "shelf", "cube"),
        ("mobile_manipulator", "table", "brick"),
        ("mobile_manipulator", "table", "spoon"),
        ("fixed_arm", "coffee_table", "cube"),
    ];
    for case in cases {
        let (said, passed) = run(project.path(), case, "3");
        assert_eq!(passed, 3, "{case:?}: {said}");
    }
}

/// A cube of 5 cm is 7 cm wide across its corners: between fingers that open 6 cm, it was treated
/// as round, and they came down on it.
#[test]
fn a_narrow_gripper_takes_a_cube_across_its_sides() {
    let project = project();
    let robots = project.path().join("models/robots");
    let urdf = std::fs::read_to_string(robots.join("fixed_arm.urdf")).unwrap();
    let narrow = urdf.replace("lower=\"0\" upper=\"0.07\"", "lower=\"0\" upper=\"0.03\"");
    assert_eq!(narrow.matches("upper=\"0.03\"").count(), 2);
    std::fs::write(robots.join("narrow.urdf"), narrow).unwrap();
    std::fs::write(robots.join("narrow_arm.toml"), "urdf = \"narrow.urdf\"\n").unwrap();
    let (said, passed) = run(project.path(), ("narrow_arm", "coffee_table", "cube"), "6");
    assert!(passed >= 5, "{passed} of 6: {said}");
}

/// A bowl is wider than any hand here: one finger goes inside, and the wall turns until it lies
/// between both.
#[test]
fn a_bowl_is_taken_at_its_rim() {
    let project = project();
    for robot in ["mobile_manipulator", "fixed_arm"] {
        let case = (robot, "coffee_table", "bowl");
        let (said, passed) = run(project.path(), case, "4");
        assert_eq!(passed, 4, "{case:?}: {said}");
        let checked = check(
            project.path(),
            &configuration(robot, "coffee_table", "bowl"),
            &[],
        );
        assert!(!checked.contains("S070"), "{checked}");
    }
}

/// The profile of the shipped arm with fingers that open less. Unit: metres.
fn narrow(folder: &Path, opening_m: &str) {
    let robots = folder.join("models/robots");
    let profile = std::fs::read_to_string(robots.join("fixed_arm.toml")).unwrap();
    let opens = format!("max_opening_m = {opening_m}");
    std::fs::write(
        robots.join("narrow.toml"),
        profile.replace("max_opening_m = 0.14", &opens),
    )
    .unwrap();
}

/// The can is 6.6 cm across: each finger passes it at a distance of 2 mm.
#[test]
fn a_can_that_hardly_fits_between_the_fingers_is_picked() {
    let project = project();
    narrow(project.path(), "0.07");
    let (said, passed) = run(project.path(), ("narrow", "coffee_table", "can"), "4");
    assert_eq!(passed, 4, "{said}");
    let checked = check(
        project.path(),
        &configuration("narrow", "coffee_table", "can"),
        &[],
    );
    assert!(!checked.contains("S070"), "{checked}");
}

#[test]
fn a_failed_plan_names_the_obstacle_or_the_distance() {
    let project = project();
    let (said, passed) = run(
        project.path(),
        ("mobile_manipulator", "high_shelf", "cube"),
        "1",
    );
    assert_eq!(passed, 0, "{said}");
    assert!(
        said.contains("no reachable, collision-free path to it was found: "),
        "{said}"
    );
    assert!(said.contains(" cm "), "{said}");
}

/// The warnings of `check`, on one line.
fn check(folder: &Path, text: &str, arguments: &[&str]) -> String {
    std::fs::write(folder.join("configs/c.toml"), text).unwrap();
    let output = actcheck(folder, &[&["check", "configs/c.toml"], arguments].concat());
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    format!("{}{}", stdout(&output), stderr(&output))
        .replace('│', " ")
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
}

#[test]
fn check_predicts_the_limits_of_gripper_arm_and_camera() {
    let project = project();
    narrow(project.path(), "0.065");
    let said = check(
        project.path(),
        &configuration("narrow", "coffee_table", "can"),
        &[],
    );
    assert!(
        said.contains("S070") && said.contains("6.6 cm × 6.6 cm across and needs 6.9 cm"),
        "{said}"
    );
    assert!(
        said.contains("open 6.5 cm") && said.contains("c.toml:17"),
        "{said}"
    );

    let said = check(
        project.path(),
        &configuration("mobile_manipulator", "high_shelf", "cube"),
        &[],
    );
    assert!(
        said.contains("S071") && said.contains("of 3 places on `high_shelf`"),
        "{said}"
    );

    let heavy = configuration("mobile_manipulator", "coffee_table", "can");
    let said = check(
        project.path(),
        &heavy.replace("mass_scale = [0.9, 1.1]", "mass_scale = [5, 9]"),
        &[],
    );
    assert!(
        said.contains("S072") && said.contains("it has at least 1.75 kg"),
        "{said}"
    );

    let blind = configuration("mobile_manipulator", "high_shelf", "cube")
        .replace("\"Pick\"", "\"PerceivePlane\"");
    let said = check(project.path(), &blind, &[]);
    assert!(
        said.contains("S073") && said.contains("the top at 150.0 cm"),
        "{said}"
    );
}

/// A prediction that is wrong for a configuration that works would make all others worthless.
#[test]
fn check_predicts_no_trouble_for_shipped_configurations() {
    for config in [
        "pick",
        "fixed_arm",
        "lone_glass",
        "clutter",
        "perceive",
        "pick_and_place",
        "quick",
        "move_to",
    ] {
        let output = actcheck(root(), &["check", &format!("configs/{config}.toml")]);
        let said = format!("{}{}", stdout(&output), stderr(&output));
        assert!(
            ["S070", "S071", "S072", "S073"]
                .iter()
                .all(|code| !said.contains(code)),
            "{config}: {said}"
        );
    }
}

#[test]
fn check_draws_the_robot_in_its_postures() {
    let project = project();
    let text = configuration("mobile_manipulator", "coffee_table", "glass");
    check(project.path(), &text, &["--picture", "robot.png"]);
    let picture =
        tiny_skia::Pixmap::decode_png(&std::fs::read(project.path().join("robot.png")).unwrap())
            .unwrap();
    assert!(
        picture.width() > 1000 && picture.height() > 1000,
        "{} × {}",
        picture.width(),
        picture.height()
    );
    check(project.path(), &text, &["--picture", "robot.svg"]);
    let lines = std::fs::read_to_string(project.path().join("robot.svg")).unwrap();
    for word in [
        "home, from the side",
        "posture 5, from behind",
        "grasp: grasp_link",
        "camera: head_camera_link",
    ] {
        assert!(lines.contains(word), "{word}");
    }
}
