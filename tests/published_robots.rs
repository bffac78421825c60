//! Robots as others publish them: weak, fast or unknown motors, fingers without collision shapes,
//! hands and linkages in the way of their fingers, joints of the whole robot, paths of meshes
//! without their folder, and hands that can't be tilted. Each is a shipped or a small robot changed
//! so.

use std::path::Path;

use serde_json::Value;

use crate::support::{actcheck, root, stderr, stdout};

/// Four picks of a lone object, whose name is to follow.
const PICKS: &str = "tests = [[\"Pick\"]]\ntest_count = 4\nseed = 5\n[robot]\nprofile = \"robot.toml\"\n\
    [objectSurface]\nobject_surfaces = [\"coffee_table\"]\n[pickObject]\nmodel_list = ";

/// The words that `check` prints, and the number of picks of a can that pass.
fn check_and_run(folder: &Path, urdf: &str, profile: &str) -> (String, u64) {
    check_and_run_with("can", folder, urdf, profile)
}

/// The words that `check` prints, and the number of picks of an object that pass.
fn check_and_run_with(object: &str, folder: &Path, urdf: &str, profile: &str) -> (String, u64) {
    std::fs::write(folder.join("robot.urdf"), urdf).unwrap();
    std::fs::write(
        folder.join("robot.toml"),
        format!("urdf = \"robot.urdf\"\n{profile}"),
    )
    .unwrap();
    std::fs::write(folder.join("c.toml"), format!("{PICKS}[\"{object}\"]\n")).unwrap();
    let checked = actcheck(folder, &["check", "c.toml"]);
    let said = format!("{}{}", stdout(&checked), stderr(&checked)).replace('│', " ");
    let output = actcheck(
        folder,
        &["run", "c.toml", "--history", "h", "--format", "json"],
    );
    let json: Value =
        serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)));
    let words = said.split_whitespace().collect::<Vec<_>>().join(" ");
    (words, json["runs_passed"]["count"].as_u64().unwrap())
}

fn fixed_arm() -> String {
    std::fs::read_to_string(root().join("models/robots/fixed_arm.urdf")).unwrap()
}

/// The PR2's shoulder has a spring that its URDF does not describe: the motor alone can't raise the
/// arm.
#[test]
fn an_arm_that_is_too_heavy_for_its_motors_is_balanced_and_check_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let (strong, weak) = (
        "upper=\"2.09\" effort=\"120\"",
        "upper=\"2.09\" effort=\"15\"",
    );
    assert!(fixed_arm().contains(strong));
    let (said, passed) = check_and_run(folder.path(), &fixed_arm().replacen(strong, weak, 1), "");
    assert!(
        said.contains("S074")
            && said.contains("`shoulder_pitch_joint` of robot can't hold the arm"),
        "{said}"
    );
    assert!(said.contains("its `effort` is 15.0"), "{said}");
    assert!(passed >= 3, "{passed} of 4 picks passed");
    let folder = tempfile::tempdir().unwrap();
    let (said, _) = check_and_run(folder.path(), &fixed_arm(), "");
    assert!(!said.contains("S074"), "{said}");
}

/// The SO-100 of a public package has shapes of its jaws only to be seen.
#[test]
fn fingers_without_collision_shapes_have_those_to_be_seen() {
    let folder = tempfile::tempdir().unwrap();
    let (mut urdf, mut in_finger) = (String::new(), false);
    for line in fixed_arm().lines() {
        in_finger = if line.contains("<link name=") {
            line.contains("\"finger_")
        } else {
            in_finger
        };
        if !(in_finger && line.contains("<collision>")) {
            urdf.push_str(line);
            urdf.push('\n');
        }
    }
    assert!(urdf.len() + 200 < fixed_arm().len());
    let (said, passed) = check_and_run(folder.path(), &urdf, "");
    for finger in ["finger_left_link", "finger_right_link"] {
        assert!(
            said.contains(&format!(
                "the link `{finger}` of the gripper has no `<collision>`"
            )),
            "{said}"
        );
    }
    assert!(passed >= 3, "{passed} of 4 picks passed");
}

/// Motors of many arms, as those of an OpenArm and a G1, reach 20 rad/s and more, which their
/// efforts can't accelerate the arm to.
#[test]
fn an_arm_with_fast_motors_moves_no_faster_than_their_efforts_allow() {
    let folder = tempfile::tempdir().unwrap();
    let mut urdf = fixed_arm();
    for speed in ["1.7", "2.2", "2.6"] {
        urdf = urdf.replace(&format!("velocity=\"{speed}\""), "velocity=\"25\"");
    }
    assert_eq!(urdf.matches("velocity=\"25\"").count(), 7);
    let (said, passed) = check_and_run(folder.path(), &urdf, "");
    assert!(passed >= 3, "{passed} of 4 picks passed: {said}");
}

/// Stretch 4's URDF has a colour of five numbers.
#[test]
fn a_colour_that_is_not_four_numbers_is_ignored() {
    let folder = tempfile::tempdir().unwrap();
    let seen = "<visual><geometry><sphere radius=\"0.01\"/></geometry>\
        <material name=\"grey\"><color rgba=\"0.5 0.5 0.5 0 1\"/></material></visual>";
    let urdf = fixed_arm().replacen("<collision>", &format!("{seen}<collision>"), 1);
    assert!(urdf.contains(seen));
    let (said, passed) = check_and_run(folder.path(), &urdf, "");
    assert!(
        said.contains("W036")
            && said.contains("`rgba` must be four numbers, but is `0.5 0.5 0.5 0 1`"),
        "{said}"
    );
    assert!(passed >= 3, "{passed} of 4 picks passed");
}

/// The H1 has materials without names, the youBot two limits of each joint, the AR4 efforts of -1,
/// and the Reachy cylinders without a size: other programs load them.
#[test]
fn faults_that_other_programs_overlook_are_repaired() {
    let folder = tempfile::tempdir().unwrap();
    let limit = "<limit lower=\"-2.9\" upper=\"2.9\" effort=\"120\" velocity=\"1.7\"/>";
    let twice = format!(
        "{}<limit lower=\"-0.1\" upper=\"0.1\" effort=\"1\" velocity=\"1\"/>",
        limit.replace("\"120\"", "\"-1\"")
    );
    let seen = "<visual><geometry><sphere radius=\"0.01\"/></geometry><material><color rgba=\"1 1 1 1\"/></material></visual>\
        <collision><geometry><cylinder radius=\"0.0\" length=\"0\"/></geometry></collision>";
    let urdf = fixed_arm().replacen(limit, &twice, 1).replacen(
        "<collision>",
        &format!("{seen}<collision>"),
        1,
    );
    assert!(urdf.contains(&twice) && urdf.contains(seen));
    let (said, passed) = check_and_run(folder.path(), &urdf, "");
    assert!(
        said.contains(
            "the joint `shoulder_yaw_joint` has more than one `<limit>`: the first counts"
        ),
        "{said}"
    );
    assert!(
        said.contains("this `<cylinder>` has no size: it is left out"),
        "{said}"
    );
    assert!(
        said.contains("S075") && said.contains("`shoulder_yaw_joint` of robot is 0 or -1"),
        "{said}"
    );
    assert!(passed >= 3, "{passed} of 4 picks passed: {said}");
    let negative = fixed_arm().replacen("effort=\"120\"", "effort=\"-120\"", 1);
    std::fs::write(folder.path().join("robot.urdf"), negative).unwrap();
    let said = stderr(&actcheck(folder.path(), &["check", "c.toml"]));
    assert!(said.contains("W034") && said.contains("`-120`"), "{said}");
}

/// The PR2 of a public package has a linkage whose coupling turns it backwards, although its limits
/// only allow the other direction: its fingers could not open.
#[test]
fn a_linkage_with_limits_against_its_coupling_does_not_block_the_fingers() {
    let folder = tempfile::tempdir().unwrap();
    let linkage = "<joint name=\"linkage_joint\" type=\"prismatic\"><parent link=\"palm_link\"/><child link=\"linkage\"/>\
        <axis xyz=\"0 1 0\"/><limit lower=\"0\" upper=\"0.07\" effort=\"60\" velocity=\"0.15\"/>\
        <mimic joint=\"finger_left_joint\" multiplier=\"-1\"/></joint><link name=\"linkage\"><inertial>\
        <mass value=\"0.05\"/><inertia ixx=\"1e-5\" ixy=\"0\" ixz=\"0\" iyy=\"1e-5\" iyz=\"0\" izz=\"1e-5\"/></inertial></link></robot>";
    let (said, passed) =
        check_and_run(folder.path(), &fixed_arm().replace("</robot>", linkage), "");
    let warning =
        "`linkage_joint` has the limits 0 to 0.07, but `finger_left_joint` moves it from -0.0";
    assert!(said.contains("W036") && said.contains(warning), "{said}");
    assert!(passed >= 3, "{passed} of 4 picks passed: {said}");
    let mirrored = linkage.replace("lower=\"0\" upper=\"0.07\"", "lower=\"-0.07\" upper=\"0\"");
    let (said, _) = check_and_run(
        folder.path(),
        &fixed_arm().replace("</robot>", &mirrored),
        "",
    );
    assert!(!said.contains("has the limits"), "{said}");
}

/// The Panda of another public package has fingers without shapes, and a hand whose shapes for
/// planning contain them.
#[test]
fn the_shape_of_a_hand_does_not_replace_those_of_its_fingers() {
    let folder = tempfile::tempdir().unwrap();
    let (mut urdf, mut link) = (String::new(), "");
    let named = fixed_arm().replace("palm_link", "hand_link");
    for line in named.lines() {
        link = if line.contains("<link name=") {
            line
        } else {
            link
        };
        let is_collision = line.contains("<collision>");
        if is_collision && link.contains("\"hand_link\"") {
            urdf.push_str(
                &line
                    .replace("0 0 0.03", "0 0 0.08")
                    .replace("0.06 0.17 0.06", "0.06 0.17 0.16"),
            );
        } else if !(is_collision && link.contains("\"finger_")) {
            urdf.push_str(line);
        }
        urdf.push('\n');
    }
    assert!(urdf.contains("0.06 0.17 0.16"));
    let (said, passed) = check_and_run(folder.path(), &urdf, "");
    assert!(
        said.contains("the fingers on the link `hand_link` have no `<collision>`"),
        "{said}"
    );
    assert!(passed >= 3, "{passed} of 4 picks passed");
}

/// The last joint of an arm can have the name of the gripper on it, and is not a finger.
#[test]
fn a_wrist_that_is_named_after_the_gripper_belongs_to_the_arm() {
    let folder = tempfile::tempdir().unwrap();
    let urdf = fixed_arm().replace("wrist_roll_joint", "gripper_turn_joint");
    let (said, passed) = check_and_run(folder.path(), &urdf, "");
    assert!(passed >= 3, "{passed} of 4 picks passed: {said}");
    let made = actcheck(
        folder.path(),
        &["new", "robot", "robot.urdf", "--out", "proposed.toml"],
    );
    assert!(made.status.success(), "{}", stderr(&made));
    let proposed = std::fs::read_to_string(folder.path().join("proposed.toml")).unwrap();
    let line = |key: &str| {
        proposed
            .lines()
            .find(|line| line.starts_with(key))
            .unwrap_or_default()
            .to_owned()
    };
    assert!(
        line("arm_joints").contains("gripper_turn_joint"),
        "{proposed}"
    );
    assert!(
        line("finger_links").contains("finger_left_link")
            && line("finger_links").contains("finger_right_link")
    );
}

/// Stretch 4's URDF has no efforts.
#[test]
fn joints_without_an_effort_get_one_and_check_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let mut urdf = fixed_arm();
    for effort in ["120", "80", "60", "40", "30"] {
        urdf = urdf.replace(&format!("effort=\"{effort}\""), "effort=\"0\"");
    }
    let (said, passed) = check_and_run(folder.path(), &urdf, "");
    assert!(
        said.contains("S075") && said.contains("`shoulder_pitch_joint`"),
        "{said}"
    );
    assert!(passed >= 3, "{passed} of 4 picks passed");
}

/// With the speeds of 0 that some files have, every action would run out of time.
#[test]
fn joints_without_a_speed_get_one_and_check_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let mut urdf = String::new();
    for part in fixed_arm().split_inclusive("velocity=\"") {
        let rest = if urdf.ends_with("velocity=\"") {
            part.split_once('"').map_or(part, |(_, rest)| rest)
        } else {
            part
        };
        urdf += if rest.len() < part.len() { "0\"" } else { "" };
        urdf += rest;
    }
    assert!(urdf.contains("velocity=\"0\""), "{urdf}");
    let (said, passed) = check_and_run(folder.path(), &urdf, "");
    assert!(
        said.contains("S075") && said.contains("the largest `velocity` of `"),
        "{said}"
    );
    assert!(said.contains("1 rad/s or 0.25 m/s is used"), "{said}");
    assert!(passed >= 3, "{passed} of 4 picks passed");
}

/// A joint that moves the whole robot over the floor or through the air; elsewhere it is a fault.
#[test]
fn a_floating_joint_at_the_root_is_fixed() {
    let folder = tempfile::tempdir().unwrap();
    let floating = "<link name=\"world\"/><joint name=\"free\" type=\"floating\"><parent link=\"world\"/>\
        <child link=\"pedestal_link\"/></joint></robot>";
    let urdf = fixed_arm().replace("</robot>", floating);
    let (said, passed) = check_and_run(folder.path(), &urdf, "");
    assert!(
        said.contains("W036")
            && said.contains("`free` is of the type floating, and is taken as fixed"),
        "{said}"
    );
    assert!(passed >= 3, "{passed} of 4 picks passed");
    let inside = urdf.replacen(
        "name=\"palm_joint\" type=\"fixed\"",
        "name=\"palm_joint\" type=\"floating\"",
        1,
    );
    std::fs::write(folder.path().join("robot.urdf"), inside).unwrap();
    let refused = actcheck(folder.path(), &["check", "c.toml"]);
    assert!(
        stderr(&refused).contains("W035") && stderr(&refused).contains("`palm_joint`"),
        "{}",
        stderr(&refused)
    );
}

/// PyBullet's models write `/meshes/FILE` for a file beside the model.
#[test]
fn meshes_with_an_absolute_path_are_found_beside_the_model() {
    let folder = tempfile::tempdir().unwrap();
    let meshes = folder.path().join("meshes");
    std::fs::create_dir(&meshes).unwrap();
    std::fs::copy(
        root().join("tests/models/gazebo/cafe_table/meshes/top.stl"),
        meshes.join("top.stl"),
    )
    .unwrap();
    let (solid, mesh) = (
        "<box size=\"0.12 0.48 0.02\"/>",
        "<mesh filename=\"/meshes/top.stl\" scale=\"1e-4 1e-4 1e-4\"/>",
    );
    std::fs::write(
        folder.path().join("robot.urdf"),
        fixed_arm().replace(solid, mesh),
    )
    .unwrap();
    std::fs::write(folder.path().join("robot.toml"), "urdf = \"robot.urdf\"\n").unwrap();
    std::fs::write(folder.path().join("c.toml"), format!("{PICKS}[\"can\"]\n")).unwrap();
    let checked = actcheck(folder.path(), &["check", "c.toml"]);
    assert!(checked.status.success(), "{}", stderr(&checked));
    std::fs::remove_file(meshes.join("top.stl")).unwrap();
    let refused = actcheck(folder.path(), &["check", "c.toml"]);
    assert!(
        stderr(&refused).contains("cannot read the mesh /meshes/top.stl"),
        "{}",
        stderr(&refused)
    );
}

/// A Gen3 in a public package was expanded by xacro on another machine.
#[test]
fn meshes_with_paths_of_another_machine_are_found_in_their_package() {
    let folder = tempfile::tempdir().unwrap();
    let meshes = folder.path().join("robots/table_top/meshes");
    std::fs::create_dir_all(&meshes).unwrap();
    std::fs::copy(
        root().join("tests/models/gazebo/cafe_table/meshes/top.stl"),
        meshes.join("top.stl"),
    )
    .unwrap();
    let solid = "<box size=\"0.12 0.48 0.02\"/>";
    for path in [
        "file:///else/where/share/table_top/meshes/top.stl",
        "/else/where/share/table_top/meshes/top.stl",
    ] {
        let mesh = format!("<mesh filename=\"{path}\" scale=\"1e-4 1e-4 1e-4\"/>");
        std::fs::write(
            folder.path().join("robot.urdf"),
            fixed_arm().replace(solid, &mesh),
        )
        .unwrap();
        std::fs::write(folder.path().join("c.toml"), format!("{PICKS}[\"can\"]\n")).unwrap();
        std::fs::write(
            folder.path().join("robot.toml"),
            "urdf = \"robot.urdf\"\npackage_dirs = [\"robots\"]\n",
        )
        .unwrap();
        let checked = actcheck(folder.path(), &["check", "c.toml"]);
        assert!(checked.status.success(), "{}", stderr(&checked));
        std::fs::write(folder.path().join("robot.toml"), "urdf = \"robot.urdf\"\n").unwrap();
        let refused = actcheck(folder.path(), &["check", "c.toml"]);
        assert!(
            stderr(&refused).contains("cannot read the mesh"),
            "{}",
            stderr(&refused)
        );
    }
}

/// The hand of Stretch RE1 points down by 30 degrees, and its arm only rises, extends and turns:
/// level hands and hands that point straight down are out of the question.
#[test]
fn a_hand_that_cannot_be_tilted_grasps_at_its_own_slant() {
    let inertial = |kg: f64| {
        let moment = kg * 0.01;
        format!(
            "<inertial><mass value=\"{kg}\"/><inertia ixx=\"{moment}\" ixy=\"0\" ixz=\"0\" iyy=\"{moment}\" iyz=\"0\" \
             izz=\"{moment}\"/></inertial>"
        )
    };
    let link = |name: &str, kg: f64, xyz: &str, size: &str| {
        format!(
            "<link name=\"{name}\">{}<collision><origin xyz=\"{xyz}\"/><geometry><box size=\"{size}\"/></geometry>\
             </collision></link>",
            inertial(kg)
        )
    };
    let joint = |name: &str, kind: &str, ends: [&str; 2], at: &str, rest: &str| {
        let [parent, child] = ends;
        format!(
            "<joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{child}\"/>\
             <origin {at}/>{rest}</joint>"
        )
    };
    let slide = |axis: &str, upper: &str| {
        format!(
            "<axis xyz=\"{axis}\"/><limit lower=\"0\" upper=\"{upper}\" effort=\"200\" velocity=\"0.2\"/>"
        )
    };
    let turn =
        "<axis xyz=\"0 0 1\"/><limit lower=\"-1.7\" upper=\"1.7\" effort=\"20\" velocity=\"1\"/>";
    let urdf = [
        "<robot name=\"lifter\">".to_owned(),
        link("wheeled_base", 30.0, "0 0 0.1", "0.3 0.3 0.16"),
        link("lift", 3.0, "0.1 0 0", "0.04 0.04 0.04"),
        link("boom", 2.0, "0.1 0 0", "0.2 0.04 0.04"),
        link("wrist", 0.5, "0 0 -0.05", "0.04 0.04 0.04"),
        link("hand", 0.3, "0.02 0 0", "0.04 0.16 0.04"),
        link("left_finger", 0.1, "0.05 0.006 0", "0.1 0.012 0.024"),
        link("right_finger", 0.1, "0.05 -0.006 0", "0.1 0.012 0.024"),
        joint(
            "rise",
            "prismatic",
            ["wheeled_base", "lift"],
            "xyz=\"0.1 0 0.2\"",
            &slide("0 0 1", "1.0"),
        ),
        joint(
            "extend",
            "prismatic",
            ["lift", "boom"],
            "xyz=\"0.03 0 0\"",
            &slide("1 0 0", "0.5"),
        ),
        joint(
            "yaw",
            "revolute",
            ["boom", "wrist"],
            "xyz=\"0.25 0 0\"",
            turn,
        ),
        joint(
            "mount",
            "fixed",
            ["wrist", "hand"],
            "xyz=\"0.04 0 -0.08\" rpy=\"0 0.5236 0\"",
            "",
        ),
        joint(
            "left",
            "prismatic",
            ["hand", "left_finger"],
            "xyz=\"0.04 0 0\"",
            &slide("0 1 0", "0.06"),
        ),
        joint(
            "right",
            "prismatic",
            ["hand", "right_finger"],
            "xyz=\"0.04 0 0\"",
            &slide("0 -1 0", "0.06"),
        ),
        "</robot>".to_owned(),
    ]
    .concat();
    let folder = tempfile::tempdir().unwrap();
    let (said, passed) = check_and_run(folder.path(), &urdf, "base = \"planar\"\n");
    assert!(!said.contains("S071"), "{said}");
    assert!(passed >= 3, "{passed} of 4 picks passed: {said}");
}

/// The PR2's torso takes 24 s from end to end, and most of its picks took longer than a minute.
#[test]
fn a_slow_lift_is_not_proposed_for_the_arm() {
    let folder = tempfile::tempdir().unwrap();
    let arm_joints = |velocity: &str| {
        let lift = format!(
            "<link name=\"floor_link\"/><joint name=\"lift_joint\" type=\"prismatic\"><parent link=\"floor_link\"/>\
             <child link=\"pedestal_link\"/><axis xyz=\"0 0 1\"/>\
             <limit lower=\"0\" upper=\"0.31\" effort=\"9000\" velocity=\"{velocity}\"/></joint></robot>"
        );
        let (urdf, out) = (
            fixed_arm().replace("</robot>", &lift),
            format!("{velocity}.toml"),
        );
        std::fs::write(folder.path().join("robot.urdf"), urdf).unwrap();
        let made = actcheck(
            folder.path(),
            &["new", "robot", "robot.urdf", "--out", &out],
        );
        assert!(made.status.success(), "{}", stderr(&made));
        let text = std::fs::read_to_string(folder.path().join(out)).unwrap();
        let line = text
            .lines()
            .find(|line| line.starts_with("arm_joints"))
            .unwrap_or_default()
            .to_owned();
        (line, text)
    };
    let (arm, text) = arm_joints("0.1");
    assert!(arm.contains("lift_joint"), "{text}");
    let (arm, text) = arm_joints("0.013");
    assert!(
        arm.contains("wrist_roll_joint") && !arm.contains("lift_joint"),
        "{text}"
    );
    assert!(
        text.contains("but not `lift_joint`, which takes 24 s from end to end and stays at 0"),
        "{text}"
    );
}

/// The gripper of an OMY-F3M has joints `rh_l1` and `rh_r1`; that of a Piper has `joint7` and
/// `joint8`.
#[test]
fn fingers_without_such_names_are_found_where_short_chains_branch_off() {
    let folder = tempfile::tempdir().unwrap();
    let mut urdf = fixed_arm();
    for (name, nameless) in [
        ("finger_left", "l7"),
        ("finger_right", "l8"),
        ("palm", "l6"),
    ] {
        urdf = urdf.replace(name, nameless);
    }
    assert!(
        !urdf.contains("\"finger") && !urdf.contains("\"hand"),
        "{urdf}"
    );
    std::fs::write(folder.path().join("arm.urdf"), urdf).unwrap();
    let written = actcheck(folder.path(), &["new", "robot", "arm.urdf"]);
    assert!(written.status.success(), "{}", stderr(&written));
    let profile = std::fs::read_to_string(folder.path().join("arm.toml")).unwrap();
    for link in ["l7_link", "l8_link"] {
        assert!(
            profile
                .lines()
                .any(|line| line.starts_with("finger_links") && line.contains(link)),
            "{profile}"
        );
    }
}

/// The Jaco's hand has two fingers against a third one: all three close on the object, and the two
/// share the force of their side. A finger that stays where it is would be in the way.
#[test]
fn further_fingers_open_and_close_with_the_two_that_face_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let urdf = fixed_arm();
    let mimic = "    <mimic joint=\"finger_left_joint\" multiplier=\"1\" offset=\"0\"/>\n";
    let (from, to) = (
        urdf.find("  <joint name=\"finger_right_joint\"").unwrap(),
        urdf.find("  <!-- x points along").unwrap(),
    );
    let right = urdf[from..to]
        .replace(mimic, "")
        .replace("xyz=\"0 0 0.06\"", "xyz=\"0.015 0 0.06\"");
    let third = right
        .replace("finger_right", "finger_third")
        .replace("xyz=\"0.015 0 0.06\"", "xyz=\"-0.015 0 0.06\"");
    assert!(!right.contains("mimic") && third.contains("xyz=\"-0.015 0 0.06\""));
    let urdf = urdf.replace(&urdf[from..to], &format!("{right}{third}"));
    std::fs::write(folder.path().join("robot.urdf"), &urdf).unwrap();
    let made = actcheck(
        folder.path(),
        &["new", "robot", "robot.urdf", "--out", "proposed.toml"],
    );
    assert!(made.status.success(), "{}", stderr(&made));
    let proposed = std::fs::read_to_string(folder.path().join("proposed.toml")).unwrap();
    let line = proposed
        .lines()
        .find(|line| line.starts_with("finger_joints"))
        .unwrap_or_default();
    assert!(
        ["left", "right", "third"]
            .iter()
            .all(|name| line.contains(&format!("finger_{name}_joint"))),
        "{proposed}"
    );
    let joints = |names: &str| {
        format!(
            "finger_joints = [{names}]\nfinger_links = [\"finger_left_link\", \"finger_right_link\"]\n"
        )
    };
    let two = "\"finger_left_joint\", \"finger_right_joint\"";
    let (said, passed) = check_and_run(
        folder.path(),
        &urdf,
        &joints(&format!("{two}, \"finger_third_joint\"")),
    );
    assert!(passed >= 3, "{passed} of 4 picks passed: {said}");
    std::fs::remove_dir_all(folder.path().join("h")).unwrap();
    let (_, passed) = check_and_run(folder.path(), &urdf, &joints(two));
    assert!(
        passed <= 1,
        "{passed} of 4 picks passed with a finger that does not move"
    );
}

/// The hand of a GR1 has four fingers in a row, and a thumb that closes along the row unless its
/// first joint turns it.
#[test]
fn a_thumb_is_parked_opposite_the_fingers() {
    let folder = tempfile::tempdir().unwrap();
    let urdf = fixed_arm();
    let (from, to) = (
        urdf.find("  <!-- Position: distance of the pad").unwrap(),
        urdf.find("  <!-- x points along").unwrap(),
    );
    let link = |name: &str, mass: f64| {
        format!(
            "<link name=\"{name}_link\"><inertial><origin xyz=\"0 0 0.05\"/><mass value=\"{mass}\"/><inertia ixx=\"7e-5\" ixy=\"0\" \
             ixz=\"0\" iyy=\"7e-5\" iyz=\"0\" izz=\"5e-6\"/></inertial>"
        )
    };
    let pad = "<collision><origin xyz=\"0 0 0.05\"/><geometry><box size=\"0.016 0.012 0.1\"/></geometry></collision></link>";
    let joint = |name: &str, parent: &str, at: &str, axis: &str, upper: f64| {
        format!(
            "<joint name=\"{name}_joint\" type=\"revolute\"><parent link=\"{parent}\"/><child link=\"{name}_link\"/>\
             <origin xyz=\"{at}\"/><axis xyz=\"{axis}\"/><limit lower=\"0\" upper=\"{upper}\" effort=\"10\" velocity=\"2\"/></joint>"
        )
    };
    let finger = |name: &str, x: f64| {
        let name = format!("finger_{name}");
        joint(&name, "palm_link", &format!("{x} 0.05 0.06"), "1 0 0", 1.4)
            + &link(&name, 0.08)
            + pad
    };
    let hand = [
        finger("index", -0.022),
        finger("middle", 0.0),
        finger("ring", 0.022),
        joint("thumb_turn", "palm_link", "0 -0.05 0.06", "0 0 1", 1.74),
        link("thumb_turn", 0.05) + "</link>",
        joint("thumb_bend", "thumb_turn_link", "0 0 0", "0 1 0", 1.2),
        link("thumb_bend", 0.08) + pad,
    ];
    let urdf = urdf.replace(&urdf[from..to], &hand.concat());
    std::fs::write(folder.path().join("robot.urdf"), &urdf).unwrap();
    let made = actcheck(
        folder.path(),
        &["new", "robot", "robot.urdf", "--out", "proposed.toml"],
    );
    assert!(made.status.success(), "{}", stderr(&made));
    let proposed = std::fs::read_to_string(folder.path().join("proposed.toml")).unwrap();
    assert!(
        proposed.contains("parked_joints = [\"thumb_turn_joint\"]\nparked = [1.566]"),
        "{proposed}"
    );
    assert!(
        proposed.contains("`thumb_turn_joint` turns the thumb opposite the fingers"),
        "{proposed}"
    );
    let line = |key: &str| {
        proposed
            .lines()
            .find(|line| line.starts_with(key))
            .unwrap_or_default()
            .to_owned()
    };
    let all = [
        "finger_index_joint",
        "finger_middle_joint",
        "finger_ring_joint",
        "thumb_bend_joint",
    ];
    assert!(
        all.iter().all(|name| line("finger_joints").contains(name)),
        "{proposed}"
    );
    let facing = ["finger_middle_link", "thumb_bend_link"];
    assert!(
        facing
            .iter()
            .all(|name| line("finger_links").contains(name)),
        "{proposed}"
    );
    let profile: Vec<&str> = proposed
        .lines()
        .filter(|line| !line.starts_with("urdf"))
        .collect();
    let (said, passed) = check_and_run(folder.path(), &urdf, &profile.join("\n"));
    assert!(passed >= 3, "{passed} of 4 picks passed: {said}");
    std::fs::remove_dir_all(folder.path().join("h")).unwrap();
    let unparked = profile
        .iter()
        .filter(|line| !line.starts_with("parked"))
        .copied()
        .collect::<Vec<_>>()
        .join("\n");
    let (_, passed) = check_and_run(folder.path(), &urdf, &unparked);
    assert!(
        passed <= 1,
        "{passed} of 4 picks passed with a thumb that closes along the row"
    );
}

/// The Stretch 4 marks the middle of its grasp with a box of 5 mm that collides.
#[test]
fn a_marker_between_the_fingers_is_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let marker = "<collision><origin xyz=\"0.022 0 0\"/><geometry><box size=\"0.005 0.005 0.005\"/></geometry></collision>";
    let urdf = fixed_arm().replace(
        "<link name=\"grasp_link\"/>",
        &format!("<link name=\"grasp_link\">{marker}</link>"),
    );
    assert!(urdf.contains(marker));
    std::fs::write(folder.path().join("robot.urdf"), &urdf).unwrap();
    let made = actcheck(
        folder.path(),
        &["new", "robot", "robot.urdf", "--out", "proposed.toml"],
    );
    assert!(made.status.success(), "{}", stderr(&made));
    let proposed = std::fs::read_to_string(folder.path().join("proposed.toml")).unwrap();
    assert!(
        proposed.contains("held.\nno_collision_links = [\"grasp_link\"]\n"),
        "{proposed}"
    );
    let profile: Vec<&str> = proposed
        .lines()
        .filter(|line| !line.starts_with("urdf"))
        .collect();
    let (said, passed) = check_and_run(folder.path(), &urdf, &profile.join("\n"));
    assert!(
        passed >= 3 && !said.contains("S076"),
        "{passed} of 4 picks passed: {said}"
    );
    std::fs::remove_dir_all(folder.path().join("h")).unwrap();
    let with_marker = profile
        .iter()
        .filter(|line| !line.starts_with("no_collision"))
        .copied()
        .collect::<Vec<_>>();
    let (said, passed) = check_and_run(folder.path(), &urdf, &with_marker.join("\n"));
    assert!(
        passed <= 1,
        "{passed} of 4 picks passed with a marker between the fingers"
    );
    assert!(
        said.contains("S076") && said.contains("no_collision_links = [\"grasp_link\"]"),
        "{said}"
    );
}

/// The forearm of an RB-Y1 has a capsule around its whole hand.
#[test]
fn a_shape_around_the_fingers_is_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let capsule = "<collision><origin xyz=\"0 0 0.2\"/><geometry><capsule radius=\"0.07\" length=\"0.2\"/>\
        </geometry></collision>";
    let link = "<link name=\"wrist_pitch_link\">";
    let urdf = fixed_arm().replace(link, &format!("{link}{capsule}"));
    assert!(urdf.contains(capsule));
    std::fs::write(folder.path().join("robot.urdf"), &urdf).unwrap();
    let made = actcheck(
        folder.path(),
        &["new", "robot", "robot.urdf", "--out", "proposed.toml"],
    );
    assert!(made.status.success(), "{}", stderr(&made));
    let proposed = std::fs::read_to_string(folder.path().join("proposed.toml")).unwrap();
    assert!(
        proposed.contains("held.\nno_collision_links = [\"wrist_pitch_link\"]\n"),
        "{proposed}"
    );
    let profile: Vec<&str> = proposed
        .lines()
        .filter(|line| !line.starts_with("urdf"))
        .collect();
    let (said, passed) = check_and_run(folder.path(), &urdf, &profile.join("\n"));
    assert!(
        passed >= 3 && !said.contains("S076"),
        "{passed} of 4 picks passed: {said}"
    );
    std::fs::remove_dir_all(folder.path().join("h")).unwrap();
    let (said, passed) = check_and_run(folder.path(), &urdf, "");
    assert!(
        passed <= 1,
        "{passed} of 4 picks passed with a capsule around the fingers"
    );
    assert!(
        said.contains("S076") && said.contains("no_collision_links = [\"wrist_pitch_link\"]"),
        "{said}"
    );
}

/// The jaw of a Z1 opens by a right angle from a fixed one: halfway between is far from both around
/// an object.
#[test]
fn a_hand_with_a_fixed_jaw_points_between_both_jaws() {
    let folder = tempfile::tempdir().unwrap();
    let jaw = |y: f64, z: f64, long: f64| {
        format!(
            "<collision><origin xyz=\"0 {y} {z}\"/><geometry><box size=\"0.03 0.03 {long}\"/></geometry></collision></link>"
        )
    };
    let urdf = fixed_arm();
    let (palm, fingers, rest) = (
        urdf.find("<link name=\"palm_link\">").unwrap(),
        urdf.find("  <!-- Position: distance of the pad").unwrap(),
        urdf.find("  <!-- x points along").unwrap(),
    );
    let with_fixed_jaw = urdf[palm..fingers].replacen("</link>", &jaw(-0.06, 0.11, 0.1), 1);
    let moving_jaw =
        "<link name=\"jaw_link\"><inertial><origin xyz=\"0 0.006 0.05\"/><mass value=\"0.08\"/><inertia ixx=\"7e-5\" \
        ixy=\"0\" ixz=\"0\" iyy=\"7e-5\" iyz=\"0\" izz=\"5e-6\"/></inertial>"
            .to_owned()
            + &jaw(0.015, 0.0475, 0.09)
            + "<joint name=\"jaw_joint\" type=\"revolute\"><parent link=\"palm_link\"/><child link=\"jaw_link\"/><origin xyz=\"0 -0.043 \
           0.065\"/><axis xyz=\"-1 0 0\"/><limit lower=\"0\" upper=\"1.2\" effort=\"10\" velocity=\"2\"/></joint>\n";
    let urdf = format!(
        "{}{with_fixed_jaw}{moving_jaw}{}",
        &urdf[..palm],
        &urdf[rest..]
    );
    std::fs::write(folder.path().join("robot.urdf"), &urdf).unwrap();
    let made = actcheck(
        folder.path(),
        &["new", "robot", "robot.urdf", "--out", "proposed.toml"],
    );
    assert!(made.status.success(), "{}", stderr(&made));
    let proposed = std::fs::read_to_string(folder.path().join("proposed.toml")).unwrap();
    let profile: Vec<&str> = proposed
        .lines()
        .filter(|line| !line.starts_with("urdf"))
        .collect();
    let profile = profile.join("\n");
    let (said, passed) = check_and_run_with("salt_shaker", folder.path(), &urdf, &profile);
    assert!(passed >= 3, "{passed} of 4 picks passed: {said}");
    std::fs::remove_dir_all(folder.path().join("h")).unwrap();
    let aside = "\ngrasp_link = \"wrist_roll_link\"\ngrasp_offset_m = [0, -0.0136, 0.1517]\n\
        grasp_turned_rad = [-1.5708, -1.1218, -1.5708]\n";
    let (_, passed) = check_and_run_with(
        "salt_shaker",
        folder.path(),
        &urdf,
        &format!("{profile}{aside}"),
    );
    assert!(
        passed <= 1,
        "{passed} of 4 picks passed with a hand that points aside"
    );
}

/// The file of a gripper alone is refused, not proposed as a robot.
#[test]
fn a_hand_without_an_arm_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let finger = |name: &str, y: f64| {
        format!(
            "<body name=\"{name}\" pos=\"0 {y} 0.05\"><joint name=\"{name}\" type=\"slide\" axis=\"0 {} 0\" range=\"0 0.04\"/>\
             <geom type=\"box\" size=\"0.01 0.005 0.04\" pos=\"0 0 0.04\"/></body>",
            1.0_f64.copysign(y)
        )
    };
    let text = format!(
        "<mujoco><worldbody><body name=\"palm\"><geom type=\"box\" size=\"0.03 0.05 0.02\"/>{}{}</body></worldbody></mujoco>",
        finger("left_finger", 0.006),
        finger("right_finger", -0.006),
    );
    std::fs::write(folder.path().join("hand.xml"), text).unwrap();
    let refused = actcheck(folder.path(), &["new", "robot", "hand.xml"]);
    assert_eq!(refused.status.code(), Some(2));
    let said = stderr(&refused);
    assert!(
        said.contains("W024") && said.contains("it is a hand"),
        "{said}"
    );
}
