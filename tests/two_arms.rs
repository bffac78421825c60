//! A robot with two arms performs with either: the proposed profile is for the hand that is asked
//! for, and parks the other arm.

use std::fmt::Write as _;
use std::path::Path;

use crate::support::urdf::{joint, link};
use crate::support::{actcheck, stderr, stdout};

/// The URDF of a torso with two arms of five joints, which are stretched out at 0.
fn two_arms() -> String {
    let mut text = "<robot name=\"two_arms\">\n".to_owned();
    text += &link("torso", [0.15, 0.2, 0.5], [0.0, 0.0, 0.25], 20.0);
    for (side, sign) in [("left", 1.0), ("right", -1.0)] {
        let of = |part: &str| format!("{side}_{part}");
        let chain = [
            (
                "shoulder",
                "torso",
                [0.0, 0.2 * sign, 0.4],
                "0 0 1",
                [-2.5, 2.5],
                [0.06, 0.06, 0.06],
                0.0,
            ),
            (
                "upper_arm",
                "shoulder",
                [0.0, 0.0, 0.0],
                "0 1 0",
                [-1.6, 1.6],
                [0.22, 0.05, 0.05],
                0.17,
            ),
            (
                "forearm",
                "upper_arm",
                [0.3, 0.0, 0.0],
                "0 1 0",
                [-2.6, 2.6],
                [0.22, 0.05, 0.05],
                0.17,
            ),
            (
                "wrist",
                "forearm",
                [0.3, 0.0, 0.0],
                "0 1 0",
                [-2.0, 2.0],
                [0.04, 0.04, 0.04],
                0.03,
            ),
            (
                "palm",
                "wrist",
                [0.06, 0.0, 0.0],
                "1 0 0",
                [-3.0, 3.0],
                [0.03, 0.1, 0.05],
                0.03,
            ),
        ];
        for (part, parent, at, axis, range, size, middle) in chain {
            let parent = if parent == "torso" {
                parent.to_owned()
            } else {
                of(parent)
            };
            text += &link(&of(part), size, [middle, 0.0, 0.0], 0.4);
            text += &joint(
                &of(&format!("{part}_joint")),
                "revolute",
                [&parent, &of(part)],
                at,
                axis,
                range,
            );
        }
        for (finger, outwards) in [("finger_a", 1.0), ("finger_b", -1.0)] {
            text += &link(
                &of(finger),
                [0.07, 0.012, 0.025],
                [0.035, 0.006 * outwards, 0.0],
                0.05,
            );
            let ends = [&*of("palm"), &*of(finger)];
            let axis = format!("0 {outwards} 0");
            text += &joint(
                &of(&format!("{finger}_joint")),
                "prismatic",
                ends,
                [0.05, 0.0, 0.0],
                &axis,
                [0.0, 0.05],
            );
        }
    }
    let _ = write!(text, "<link name=\"head_camera\"/>");
    text += "<joint name=\"neck\" type=\"fixed\"><parent link=\"torso\"/><child link=\"head_camera\"/>\
        <origin xyz=\"0.1 0 0.7\" rpy=\"0 0.6 0\"/></joint>\n</robot>\n";
    text
}

fn profile(folder: &Path, hand: &str) -> String {
    let out = format!("{hand}.toml");
    let made = actcheck(
        folder,
        &[
            "new",
            "robot",
            "two_arms.urdf",
            "--hand",
            hand,
            "--out",
            &out,
        ],
    );
    assert_eq!(made.status.code(), Some(0), "{}", stderr(&made));
    assert!(
        stdout(&made).contains("this robot has another hand"),
        "{}",
        stdout(&made)
    );
    std::fs::read_to_string(folder.join(out)).unwrap()
}

#[test]
fn a_robot_with_two_arms_picks_with_either() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("two_arms.urdf"), two_arms()).unwrap();
    for (hand, other) in [("left", "right"), ("right", "left")] {
        let text = profile(folder.path(), hand);
        let line = |key: &str| {
            text.lines()
                .find(|line| line.starts_with(key))
                .unwrap_or_default()
                .to_owned()
        };
        assert!(
            line("arm_joints").contains(&format!("{hand}_upper_arm_joint")),
            "{text}"
        );
        assert!(
            line("finger_joints").contains(&format!("{hand}_finger_a_joint")),
            "{text}"
        );
        assert!(
            line("parked_joints").contains(&format!("{other}_upper_arm_joint")),
            "{text}"
        );
        assert!(!text.contains(&format!("{other}_finger")), "{text}");
        let config = format!(
            "tests = [[\"Pick\"]]\ntest_count = 4\nseed = 5\n[objectSurface]\nobject_surfaces = [\"coffee_table\"]\n\
            [pickObject]\nmodel_list = [\"can\"]\n[robot]\nprofile = \"{hand}.toml\"\n"
        );
        std::fs::write(folder.path().join("c.toml"), config).unwrap();
        let history = format!("of-{hand}");
        let ran = actcheck(
            folder.path(),
            &["run", "c.toml", "--history", &history, "--format", "json"],
        );
        assert!(matches!(ran.status.code(), Some(0 | 1)), "{}", stderr(&ran));
        let json: serde_json::Value = serde_json::from_str(&stdout(&ran)).unwrap();
        let passed = json["runs_passed"]["count"].as_u64().unwrap();
        assert!(passed >= 2, "{hand}: {}{}", stdout(&ran), stderr(&ran));
    }
    let unknown = actcheck(
        folder.path(),
        &[
            "new",
            "robot",
            "two_arms.urdf",
            "--hand",
            "middle",
            "--out",
            "m.toml",
        ],
    );
    assert_eq!(unknown.status.code(), Some(2));
    let said = stderr(&unknown);
    assert!(
        said.contains("no hand has `middle` in a name") && said.contains("left_palm"),
        "{said}"
    );
    assert!(!folder.path().join("m.toml").exists());
}

/// A torso that turns moves both arms: arms of six joints leave it out.
#[test]
fn a_torso_that_turns_is_not_part_of_an_arm() {
    let folder = tempfile::tempdir().unwrap();
    let spine = link("pelvis", [0.15, 0.2, 0.1], [0.0, 0.0, -0.1], 20.0);
    let waist = joint(
        "waist_joint",
        "revolute",
        ["pelvis", "torso"],
        [0.0; 3],
        "0 0 1",
        [-1.0, 1.0],
    );
    let mut urdf = two_arms().replace(
        "<link name=\"torso\">",
        &format!("{spine}{waist}<link name=\"torso\">"),
    );
    let proposed = |urdf: &str| {
        std::fs::write(folder.path().join("two_arms.urdf"), urdf).unwrap();
        let _ = std::fs::remove_file(folder.path().join("left.toml"));
        let text = profile(folder.path(), "left");
        let arm = text
            .lines()
            .find(|line| line.starts_with("arm_joints"))
            .unwrap_or_default()
            .to_owned();
        (arm, text)
    };
    assert!(
        proposed(&urdf).0.contains("waist_joint"),
        "arms of five joints need it"
    );
    for side in ["left", "right"] {
        let forearm = format!("<link name=\"{side}_forearm\">");
        let parent = format!("<parent link=\"{side}_forearm\"/>");
        let turned = link(&format!("{side}_forearm_turn"), [0.02; 3], [0.0; 3], 0.1);
        let ends = [
            &*format!("{side}_forearm"),
            &*format!("{side}_forearm_turn"),
        ];
        let joint = joint(
            &format!("{side}_turn_joint"),
            "revolute",
            ends,
            [0.15, 0.0, 0.0],
            "1 0 0",
            [-2.0, 2.0],
        );
        assert!(urdf.contains(&forearm) && urdf.contains(&parent));
        urdf = urdf.replace(&parent, &format!("<parent link=\"{side}_forearm_turn\"/>"));
        urdf = urdf.replace(&forearm, &format!("{turned}{joint}{forearm}"));
    }
    let (arm, text) = proposed(&urdf);
    assert!(
        arm.contains("left_turn_joint") && !arm.contains("waist_joint"),
        "{text}"
    );
    assert!(
        text.contains("but not `waist_joint`, which moves the other arm too and stays at 0"),
        "{text}"
    );
    assert!(
        !text.contains("parked_joints = [\"waist_joint") && !text.contains("\"waist_joint\""),
        "{text}"
    );
}
