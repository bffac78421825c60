//! Mobile robots whose arms reach aside of the base, as Stretch's telescope does.

use crate::support::urdf::{joint, link};
use crate::support::{actcheck, stderr, stdout};

/// A square base, a lift, a telescope that extends to the right, a wrist of three joints, and two
/// fingers that slide.
fn helper() -> String {
    let mut text = "<robot name=\"helper\">\n".to_owned();
    text += &link("base", [0.34, 0.34, 0.15], [0.0, 0.0, 0.085], 20.0);
    text += &link("left_wheel", [0.1, 0.02, 0.1], [0.0, 0.0, 0.0], 0.5);
    text += &joint(
        "left_wheel_joint",
        "continuous",
        ["base", "left_wheel"],
        [0.0, 0.18, 0.05],
        "0 1 0",
        [0.0, 0.0],
    );
    let chain = [
        (
            "lift",
            "base",
            "prismatic",
            [-0.08, 0.12, 0.2],
            "0 0 1",
            [0.0, 1.0],
            [0.1, 0.1, 0.1],
            [0.0, 0.0, 0.0],
            1.0,
        ),
        (
            "telescope",
            "lift",
            "prismatic",
            [0.0, -0.05, 0.0],
            "0 -1 0",
            [0.0, 0.5],
            [0.04, 0.3, 0.04],
            [0.0, -0.15, 0.0],
            0.5,
        ),
        (
            "wrist",
            "telescope",
            "revolute",
            [0.0, -0.35, 0.0],
            "0 0 1",
            [-1.4, 1.6],
            [0.04, 0.04, 0.04],
            [0.0, 0.0, 0.0],
            0.2,
        ),
        (
            "pitch",
            "wrist",
            "revolute",
            [0.0, -0.03, 0.0],
            "1 0 0",
            [-0.6, 1.6],
            [0.03; 3],
            [0.0, -0.01, 0.0],
            0.2,
        ),
        (
            "palm",
            "pitch",
            "revolute",
            [0.0, -0.05, 0.0],
            "0 1 0",
            [-1.5, 1.5],
            [0.12, 0.04, 0.04],
            [0.0, -0.02, 0.0],
            0.2,
        ),
    ];
    for (part, parent, kind, at, axis, range, size, middle, mass) in chain {
        text += &link(part, size, middle, mass);
        text += &joint(
            &format!("{part}_joint"),
            kind,
            [parent, part],
            at,
            axis,
            range,
        );
    }
    for (side, sign) in [("left", -1.0), ("right", 1.0)] {
        let (finger, axis) = (format!("finger_{side}"), format!("{sign} 0 0"));
        text += &link(&finger, [0.01, 0.1, 0.02], [sign * 0.005, -0.05, 0.0], 0.05);
        let name = format!("{finger}_joint");
        text += &joint(
            &name,
            "prismatic",
            ["palm", &finger],
            [0.0, -0.04, 0.0],
            &axis,
            [0.0, 0.05],
        );
    }
    text + "</robot>\n"
}

/// With the hand ahead of the base, half of the base would have to be in the table.
#[test]
fn an_arm_that_reaches_aside_keeps_the_base_off_the_table() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("helper.urdf"), helper()).unwrap();
    let made = actcheck(folder.path(), &["new", "robot", "helper.urdf"]);
    assert_eq!(made.status.code(), Some(0), "{}", stderr(&made));
    let config = "tests = [[\"Pick\"]]\ntest_count = 6\nseed = 5\n[objectSurface]\nobject_surfaces = [\"coffee_table\"]\n\
        [pickObject]\nmodel_list = [\"can\"]\n[robot]\nprofile = \"helper.toml\"\n";
    std::fs::write(folder.path().join("c.toml"), config).unwrap();
    let ran = actcheck(
        folder.path(),
        &["run", "c.toml", "--history", "h", "--format", "json"],
    );
    let json: serde_json::Value =
        serde_json::from_str(&stdout(&ran)).unwrap_or_else(|_| panic!("{}", stderr(&ran)));
    let passed = json["runs_passed"]["count"].as_u64().unwrap();
    let profile = std::fs::read_to_string(folder.path().join("helper.toml")).unwrap();
    assert!(passed >= 5, "{passed} of 6 picks passed: {}", stderr(&ran));
    let numbers = |line: &str| -> Option<Vec<f64>> {
        let list = line.split_once("{ arm = [")?.1.split_once(']')?.0;
        list.split(", ").map(|number| number.parse().ok()).collect()
    };
    let wrists: Vec<f64> = profile
        .lines()
        .filter_map(numbers)
        .map(|posture| posture[2])
        .collect();
    let is = |turn: f64| move |wrist: &&f64| (**wrist - turn).abs() < 0.1;
    assert!(
        wrists.iter().filter(is(1.571)).count() > 3,
        "the hand points ahead: {wrists:?}"
    );
    assert!(
        wrists.iter().filter(is(0.0)).count() > 3,
        "the hand points along the telescope: {wrists:?}"
    );
}
