//! Robots whose fingers are not found: the profile that `new robot` proposes has everything else, and
//! a gap that `check` and `run` report with its line until it is filled in.

use std::fmt::Write as _;
use std::path::Path;

use crate::support::{actcheck, root, stderr, stdout};

const GAP: &str = "finger_joints = []";

/// The shipped fixed arm with another gripper.
fn arm(gripper: impl Fn(&str) -> String) -> String {
    let urdf = std::fs::read_to_string(root().join("models/robots/fixed_arm.urdf")).unwrap();
    let from = urdf.find("<joint name=\"finger_left_joint\"").unwrap();
    let to = urdf.find("<joint name=\"grasp_joint\"").unwrap();
    [&urdf[..from], &gripper(&urdf[from..to]), &urdf[to..]].concat()
}

/// The text without its elements of this name.
fn without(text: &str, element: &str) -> String {
    let (open, close) = (format!("<{element}>"), format!("</{element}>"));
    let mut left = text.to_owned();
    while let Some(from) = left.find(&open) {
        let to = left.find(&close).unwrap() + close.len();
        left.replace_range(from..to, "");
    }
    left
}

/// Fingers without the names of such, which carry more joints than fingers without names may.
fn nameless(fingers: &str) -> String {
    let mut text = fingers
        .replace("finger_left", "m1")
        .replace("finger_right", "m2");
    for (side, idx) in ["m1", "m2"]
        .into_iter()
        .flat_map(|side| (0..5).map(move |idx| (side, idx)))
    {
        let parent = match idx {
            0 => format!("{side}_link"),
            _ => format!("{side}_{}", idx - 1),
        };
        let _ = write!(
            text,
            "<link name=\"{side}_{idx}\"/><joint name=\"{side}_{idx}\" type=\"revolute\"><parent link=\"{parent}\"/>\
             <child link=\"{side}_{idx}\"/><limit lower=\"0\" upper=\"1\" effort=\"1\" velocity=\"1\"/></joint>"
        );
    }
    text
}

fn campaign(folder: &Path) {
    let text = "tests = [[\"Pick\"]]\ntest_count = 1\n[robot]\nprofile = \"arm.toml\"\n\
                [pickObject]\nmodel_list = [\"can\"]\n[objectSurface]\nobject_surfaces = [\"coffee_table\"]\n";
    std::fs::write(folder.join("c.toml"), text).unwrap();
}

#[test]
fn a_robot_whose_fingers_are_not_found_gets_a_profile_with_a_gap() {
    let cases = [
        ("no gripper", arm(|_| String::new()), "has a name with"),
        (
            "no shapes",
            arm(|fingers| without(&without(fingers, "collision"), "visual")),
            "have no collision shapes",
        ),
        (
            "stiff",
            arm(|fingers| fingers.replace("upper=\"0.07\"", "upper=\"0\"")),
            "can't move",
        ),
        ("nameless", arm(nameless), "has a name with"),
    ];
    for (case, urdf, reason) in cases {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("arm.urdf"), urdf).unwrap();
        campaign(folder.path());
        let proposed = actcheck(folder.path(), &["new", "robot", "arm.urdf"]);
        let said = stderr(&proposed)
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ")
            .replace("│ ", "");
        assert_eq!(proposed.status.code(), Some(2), "{case}: {said}");
        assert!(
            said.contains("W024") && said.contains(reason),
            "{case}: {said}"
        );
        assert!(stdout(&proposed).contains("wrote arm.toml"), "{case}");
        let profile = std::fs::read_to_string(folder.path().join("arm.toml")).unwrap();
        let parsed: toml::Table = toml::from_str(&profile).unwrap();
        assert_eq!(
            parsed["arm_joints"].as_array().unwrap().len(),
            7,
            "{case}: {profile}"
        );
        assert!(
            profile.contains("# camera_link = \"camera_link\""),
            "{case}: {profile}"
        );
        assert!(profile.contains("# home = ["), "{case}: {profile}");
        let line = 1 + profile.lines().position(|line| line == GAP).unwrap();
        let place = format!("arm.toml:{line}:1");
        assert!(said.contains(&place), "{case}: {said}");
        for arguments in [
            &["check", "c.toml"][..],
            &["run", "c.toml", "--history", "h"],
        ] {
            let refused = actcheck(folder.path(), arguments);
            let said = stderr(&refused);
            assert_eq!(refused.status.code(), Some(2), "{case}: {said}");
            assert!(
                said.contains(&place) && said.contains("`finger_joints`"),
                "{case}: {said}"
            );
            assert!(said.contains("`finger_links`"), "{case}: {said}");
        }
    }
}

/// The candidates in the comments fill the gap.
#[test]
fn a_filled_gap_is_a_profile() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("arm.urdf"), arm(nameless)).unwrap();
    campaign(folder.path());
    let proposed = actcheck(folder.path(), &["new", "robot", "arm.urdf"]);
    assert_eq!(proposed.status.code(), Some(2), "{}", stderr(&proposed));
    let file = folder.path().join("arm.toml");
    let profile = std::fs::read_to_string(&file).unwrap();
    for line in [
        "#   joint `m1_joint` slides `m1_link` from 0 to 0.07 m\n",
        "#   joint `m2_joint` slides `m2_link` from 0 to 0.07 m; follows `m1_joint`, to be named instead\n",
        "#   joint `m1_4` turns `m1_4` from 0 to 1 rad; the last link of its finger; no collision shapes\n",
    ] {
        assert!(profile.contains(line), "{profile}");
    }
    let filled = profile
        .replace(GAP, "finger_joints = [\"m1_joint\"]")
        .replace(
            "finger_links = []",
            "finger_links = [\"m1_link\", \"m2_link\"]",
        );
    std::fs::write(&file, filled).unwrap();
    let checked = actcheck(folder.path(), &["check", "c.toml"]);
    assert!(checked.status.success(), "{}", stderr(&checked));
}
