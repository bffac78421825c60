//! The opening of grippers with known closed forms.

use std::path::Path;
use std::sync::Arc;

use crate::robot::tests::alone;
use crate::{Joint, SelfContact, World, ik};
use actcheck_base::{Files, Source};
use actcheck_data::RobotProfile;
use actcheck_robot::RobotModel;
use actcheck_robot::{Named, Robot, RobotError};

fn compiled(profile: &RobotProfile) -> Robot {
    Robot::compile(&Arc::new(profile.clone())).expect("the robot is valid")
}

/// Compiles and checks the robot of a profile.
pub(crate) fn checked(profile: &RobotProfile) -> Result<(), RobotError> {
    Robot::compile(&Arc::new(profile.clone()))?.check()
}

/// The profile with another URDF.
fn with_urdf(profile: RobotProfile, text: String) -> RobotProfile {
    let urdf = Source::new("hand.urdf", text);
    let core = actcheck_config::robot::with_urdf(profile.core, urdf).expect("it is a URDF");
    RobotProfile { core, ..profile }
}

/// A hand with fingers of 10 cm whose inner faces are 2 cm off its middle at position 0. The grasp
/// frame is 10 cm from the hinges. `left` and `right` are the types and limits of the finger
/// joints.
pub(crate) fn hand(left: &str, right: &str, finger_joints: &[&str]) -> RobotProfile {
    let path = Path::new("models/robots/mobile_manipulator.toml");
    let mut profile = actcheck_config::robot::read(&Files::Shipped, path)
        .expect("the shipped robot is valid")
        .complete()
        .expect("it states all roles");
    let inertial = "<inertial><mass value=\"0.1\"/>\
                    <inertia ixx=\"1e-4\" ixy=\"0\" ixz=\"0\" iyy=\"1e-4\" iyz=\"0\" izz=\"1e-4\"/></inertial>";
    let finger = |name: &str, y: f64, joint: &str| {
        format!(
            "<link name=\"{name}_finger\">{inertial}<collision><origin xyz=\"0.06 {} 0\"/><geometry>\
             <box size=\"0.1 0.01 0.03\"/></geometry></collision></link>\
             <joint name=\"{name}\" {joint}<parent link=\"palm\"/><child link=\"{name}_finger\"/>\
             <origin xyz=\"0 {y} 0\"/></joint>",
            0.005_f64.copysign(y)
        )
    };
    let text = format!(
        "<robot name=\"hand\"><link name=\"base\"/>\
         <joint name=\"lift\" type=\"prismatic\"><parent link=\"base\"/><child link=\"palm\"/><axis xyz=\"0 0 1\"/>\
         <limit lower=\"0.5\" upper=\"1\" effort=\"300\" velocity=\"0.2\"/></joint>\
         <link name=\"palm\">{inertial}</link>{}{}\
         <joint name=\"tip\" type=\"fixed\"><parent link=\"palm\"/><child link=\"grasp\"/>\
         <origin xyz=\"0.1 0 0\"/></joint><link name=\"grasp\"/></robot>",
        finger("left", 0.02, left),
        finger("right", -0.02, right),
    );
    profile = with_urdf(profile, text);
    profile.core.base_joints = None;
    profile.arm_joints = vec!["lift".to_owned()];
    profile.home = vec![0.6];
    profile.postures = Vec::new();
    profile.core.head_joints = Vec::new();
    profile.hand.finger_joints = finger_joints
        .iter()
        .map(|name| (*name).to_owned())
        .collect();
    profile.hand.finger_links = ["left_finger", "right_finger"].map(str::to_owned);
    profile.hand.grasp.link = "grasp".to_owned();
    profile.camera.link = "base".to_owned();
    profile.hand.max_opening_m = 0.1;
    profile
}

/// Returns the type, axis and limits of a joint that turns about z. Unit: radians.
pub(crate) fn turning(lower: f64, upper: f64) -> String {
    format!(
        "type=\"revolute\"><axis xyz=\"0 0 1\"/>\
         <limit lower=\"{lower}\" upper=\"{upper}\" effort=\"20\" velocity=\"2\"/>"
    )
}

fn sliding_from(lower: f64, upper: f64, y: f64) -> String {
    format!(
        "type=\"prismatic\"><axis xyz=\"0 {y} 0\"/>\
         <limit lower=\"{lower}\" upper=\"{upper}\" effort=\"20\" velocity=\"0.1\"/>"
    )
}

const FIXED: &str = "type=\"fixed\">";
const MIMIC: &str = "<mimic joint=\"left\" multiplier=\"-1\"/>";

/// Distance of the inner face from the middle: nearest 9 cm from the hinge, at the border of the
/// measured region.
fn turned(angle: f64) -> f64 {
    0.02 + 0.09 * libm::tan(angle)
}

/// Hands, each with its motors, the positions of left and right finger at share 0.5 of the way, and
/// the opening there in closed form.
fn hands() -> Vec<(RobotProfile, Vec<f64>, f64)> {
    let (left, right) = (turning(0.0, 0.6), turning(-0.6, 0.0));
    let coupled = format!("{right}{MIMIC}");
    let (down, up) = (
        sliding_from(-0.04, 0.0, -1.0),
        sliding_from(-0.04, 0.0, 1.0),
    );
    vec![
        (
            hand(&left, &right, &["left", "right"]),
            vec![0.3, -0.3],
            2.0 * turned(0.3),
        ),
        (
            hand(&left, &coupled, &["left"]),
            vec![0.3, -0.3],
            2.0 * turned(0.3),
        ),
        (
            hand(&left, &coupled, &["left", "right"]),
            vec![0.3, -0.3],
            2.0 * turned(0.3),
        ),
        (hand(&left, FIXED, &["left"]), vec![0.3], 0.02 + turned(0.3)),
        (
            hand(&down, &up, &["left", "right"]),
            vec![-0.02, -0.02],
            0.08,
        ),
    ]
}

#[test]
fn the_opening_is_that_of_the_closed_form() {
    for (idx, (profile, positions, opening_m)) in hands().into_iter().enumerate() {
        let world = alone(profile);
        let gripper = &world.layout().gripper;
        let place = |joint: &Joint| {
            ["left", "right"]
                .iter()
                .position(|name| *name == joint.name)
        };
        let joints = world.kinematics().joints().iter();
        let all: Vec<f64> = joints
            .map(|joint| place(joint).map_or(0.6, |idx| positions[idx]))
            .collect();
        let measured = gripper.opening_m(&all);
        assert!(
            (measured - opening_m).abs() < 2e-5,
            "hand {idx}: {measured} m instead of {opening_m} m"
        );
        let mut set = vec![0.6; all.len()];
        gripper.set(&mut set, opening_m);
        let far = set
            .iter()
            .zip(&all)
            .map(|(is, wanted)| (is - wanted).abs())
            .fold(0.0, f64::max);
        assert!(far < 2e-4, "hand {idx}: {set:?} instead of {all:?}");
    }
}

#[test]
fn one_moving_finger_has_its_middle_beside_the_grasp_frame() {
    let world = alone(hands().swap_remove(3).0);
    let middle_m = world.layout().gripper.middle_m(0.02 + turned(0.3));
    let expected = f64::midpoint(turned(0.3), -0.02);
    assert!(
        (middle_m - expected).abs() < 2e-5,
        "{middle_m} m instead of {expected} m"
    );
}

/// A cylinder between two faces that are inclined by an angle to each other is pushed out with the
/// tangent of half of it.
#[test]
fn fingers_that_turn_push_a_cylinder_out_as_calculated() {
    let angle = 0.3;
    let (sin, cos) = (libm::sin(angle), libm::cos(angle));
    let both = 2.0 * (0.1 * sin + 0.02 * cos);
    let one = 2.0 * (0.1 * sin + 0.04 * cos) / (1.0 + cos);
    let slides = 0.06;
    let cases = [
        (0, both, angle),
        (1, both, angle),
        (3, one, angle / 2.0),
        (4, slides, 0.0),
    ];
    for (idx, diameter_m, half_angle) in cases {
        let found = compiled(&hands().swap_remove(idx).0).outward_push(diameter_m);
        let expected = libm::tan(half_angle);
        assert!(
            found.is_some_and(|found| (found - expected).abs() < 1e-3),
            "hand {idx}: {found:?}, not {expected}"
        );
    }
    let too_wide = compiled(&hands().swap_remove(4).0).outward_push(0.2);
    assert_eq!(too_wide, None);
}

#[test]
fn one_of_the_hands_has_a_fixed_jaw() {
    let are_fixed: Vec<bool> = hands()
        .into_iter()
        .map(|(profile, ..)| alone(profile).layout().gripper.has_fixed_jaw())
        .collect();
    assert_eq!(are_fixed, [false, false, false, true, false]);
}

/// Motors and couplings bring the fingers to the commanded opening.
#[test]
fn all_hands_open_and_close() {
    for (idx, (profile, _, _)) in hands().into_iter().enumerate() {
        let mut world = alone(profile);
        let mut command = world.hold();
        for opening_m in [0.07, 0.06, 0.075] {
            command.gripper_opening_m = opening_m;
            (0..120).for_each(|_| world.step(&command));
            let reached = world.observe().gripper_opening_m;
            assert!(
                (reached - opening_m).abs() < 1e-3,
                "hand {idx}: {reached} m instead of {opening_m} m"
            );
        }
    }
}

#[test]
fn a_gripper_that_cannot_be_measured_is_refused() {
    let left = turning(0.0, 0.6);
    let of = |profile: &RobotProfile| {
        checked(profile)
            .expect_err("it can't be measured")
            .diagnostic()
    };
    let mut apart = hand(&left, FIXED, &["left"]);
    apart.hand.grasp.offset_m = [0.0, 0.0, 0.5];
    let mut inside = hand(&left, FIXED, &["left"]);
    inside.hand.grasp.link = "left_finger".to_owned();
    let mut wide = hand(&left, FIXED, &["left"]);
    wide.hand.max_opening_m = 0.12;
    for (profile, part) in [
        (apart, "no two surfaces"),
        (inside, "move the `grasp_link`"),
        (wide, "no wider than 0.1"),
        (hand(FIXED, FIXED, &["lift"]), "move the `grasp_link`"),
    ] {
        let found = of(&profile);
        assert_eq!(found.code, "W024");
        assert!(found.message.contains(part), "{}", found.message);
    }
}

/// A mast that mimics the lift has a motor of its own, which must not hold it back. (The torso of a
/// robot whose arm and head are on one lift stayed at 0, and stopped the arm.)
#[test]
fn a_mimic_joint_outside_the_gripper_follows_its_leader() {
    let (left, right) = (turning(0.0, 0.6), turning(-0.6, 0.0));
    let mut profile = hand(&left, &right, &["left", "right"]);
    let mast = "<joint name=\"mast\" type=\"prismatic\"><parent link=\"base\"/><child link=\"mast_link\"/>\
                <axis xyz=\"0 0 1\"/><limit lower=\"0\" upper=\"1\" effort=\"900\" velocity=\"0.2\"/>\
                <mimic joint=\"lift\" multiplier=\"0.5\"/></joint><link name=\"mast_link\"><inertial><mass value=\"5\"/>\
                <inertia ixx=\"0.01\" ixy=\"0\" ixz=\"0\" iyy=\"0.01\" iyz=\"0\" izz=\"0.01\"/></inertial></link></robot>";
    let text = profile.core.urdf.text.replace("</robot>", mast);
    profile = with_urdf(profile, text);
    let mut world = alone(profile);
    let at = |world: &World, name: &str| {
        let idx = world
            .kinematics()
            .joints()
            .iter()
            .position(|joint| joint.name == name)
            .expect("it has this joint");
        (idx, world.observe().positions[idx])
    };
    assert!(
        (at(&world, "mast").1 - 0.3).abs() < 1e-6,
        "at home: {:?}",
        at(&world, "mast")
    );
    let mut command = world.hold();
    command.positions[at(&world, "lift").0] = 0.9;
    (0..180).for_each(|_| world.step(&command));
    for (name, wanted) in [("lift", 0.9), ("mast", 0.45)] {
        let reached = at(&world, name).1;
        assert!(
            (reached - wanted).abs() < 2e-3,
            "{name}: {reached} m instead of {wanted} m"
        );
    }
}

/// A telescope has one motor: its further stages carry the hand as far again.
#[test]
fn inverse_kinematics_moves_the_joints_that_follow_others() {
    let (left, right) = (turning(0.0, 0.6), turning(-0.6, 0.0));
    let mut profile = hand(&left, &right, &["left", "right"]);
    let stage = "<link name=\"stage\"/><joint name=\"second\" type=\"prismatic\"><parent link=\"stage\"/>\
                 <child link=\"palm\"/><axis xyz=\"0 0 1\"/><limit lower=\"0\" upper=\"0.1\" effort=\"300\" velocity=\"0.2\"/>\
                 <mimic joint=\"lift\" multiplier=\"0.5\"/></joint></robot>";
    let text =
        profile
            .core
            .urdf
            .text
            .replacen("<child link=\"palm\"/>", "<child link=\"stage\"/>", 1);
    profile = with_urdf(profile, text.replace("</robot>", stage));
    let world = alone(profile);
    let kinematics = world.kinematics();
    let at = |name: &str| {
        kinematics
            .joints()
            .iter()
            .position(|joint| joint.name == name)
            .expect("it has this joint")
    };
    let start = world.observe().positions;
    let target = nalgebra::Translation3::new(0.0, 0.0, 0.15) * kinematics.grasp(&start);
    let mut mobility = vec![0.0; start.len()];
    mobility[at("lift")] = 1.0;
    let found = ik::solve(kinematics, &start, &ik::IkRequest { target, mobility })
        .expect("it is within reach");
    assert!((found[at("lift")] - 0.7).abs() < 2e-3, "{found:?}");
    // The limits of the second stage would stop it at 0.1 m.
    assert!((found[at("second")] - 0.35).abs() < 1e-3, "{found:?}");
    assert!(
        (kinematics.grasp(&found).translation.vector - target.translation.vector).norm() < 1e-3
    );
}

/// The convex shapes of neighbouring fingers overlap where the real ones do not; an arm brings none
/// of them together.
#[test]
fn fingers_that_overlap_do_not_forbid_postures_of_the_arm() {
    let (left, right) = (turning(0.0, 0.6), turning(-0.6, 0.0));
    let profile = hand(&left, &right, &["left", "right"]);
    let third = "<joint name=\"third\" type=\"fixed\"><parent link=\"left_finger\"/><child link=\"thumb\"/></joint>\
                 <link name=\"thumb\"><collision><origin xyz=\"0.06 -0.02 0\"/><geometry><box size=\"0.1 0.09 0.03\"/>\
                 </geometry></collision></link></robot>";
    let text = profile.core.urdf.text.replace("</robot>", third);
    let thick = with_urdf(profile.clone(), text);
    let world = alone(thick);
    let mut positions = world.observe().positions;
    let itself = SelfContact::new(world.kinematics(), &[]);
    for opening_m in [0.0, 0.02, 0.1] {
        world.layout().gripper.set(&mut positions, opening_m);
        assert_eq!(
            itself.touching(&world.kinematics().links(&positions)),
            None,
            "{opening_m} m"
        );
    }
}

/// Fingers cannot press harder than their motor: its effort by the way of the fingertips.
#[test]
fn the_grip_is_as_strong_as_its_motors() {
    let (left, right) = (turning(0.0, 0.6), turning(-0.6, 0.0));
    let of = |profile: &RobotProfile| compiled(profile).grip_limit_n();
    // 20 Nm at a mean lever of the way of a fingertip by the turn of its hinge.
    let lever_m = (turned(0.6) - turned(0.0)) / 0.6;
    let own_motors = of(&hand(&left, &right, &["left", "right"]));
    assert!((own_motors - 20.0 / lever_m).abs() < 0.5, "{own_motors} N");
    // One motor moves both fingers, twice as far.
    let coupled = of(&hand(&left, &format!("{right}{MIMIC}"), &["left"]));
    assert!((coupled - 10.0 / lever_m).abs() < 0.5, "{coupled} N");
    // An effort of 0 is unknown: it is as if it were 100 Nm.
    let efforts = ["0", "100"]
        .map(|effort| turning(0.0, 0.6).replace("effort=\"20\"", &format!("effort=\"{effort}\"")));
    let [unknown, strong] = efforts.map(|left| of(&hand(&left, FIXED, &["left"])));
    assert!(
        (unknown - strong).abs() < 1e-9 && strong > 100.0,
        "{unknown} N, {strong} N"
    );
}

/// A hand with a third finger beside the right one, whose joint turns in the other direction.
fn three_fingers(finger_joints: &[&str]) -> RobotProfile {
    let profile = hand(&turning(0.0, 0.6), &turning(-0.6, 0.0), finger_joints);
    let third = "<link name=\"third_finger\"><inertial><mass value=\"0.1\"/><inertia ixx=\"1e-4\" ixy=\"0\" ixz=\"0\" \
                 iyy=\"1e-4\" iyz=\"0\" izz=\"1e-4\"/></inertial><collision><origin xyz=\"0.06 -0.005 0\"/><geometry>\
                 <box size=\"0.1 0.01 0.03\"/></geometry></collision></link><joint name=\"third\" type=\"revolute\">\
                 <parent link=\"palm\"/><child link=\"third_finger\"/><origin xyz=\"0 -0.02 0.04\"/><axis xyz=\"0 0 -1\"/>\
                 <limit lower=\"0\" upper=\"0.6\" effort=\"20\" velocity=\"2\"/></joint></robot>";
    let text = profile.core.urdf.text.replace("</robot>", third);
    with_urdf(profile, text)
}

/// A third finger closes with the one beside it, and both share the force of their side, in
/// whatever order they are named.
#[test]
fn a_third_finger_moves_with_the_others() {
    for names in [["left", "right", "third"], ["third", "right", "left"]] {
        let mut world = alone(three_fingers(&names));
        let at = |world: &World, name: &str| {
            world
                .kinematics()
                .joints()
                .iter()
                .position(|joint| joint.name == name)
                .expect("it has this joint")
        };
        let joints = ["left", "right", "third"].map(|name| at(&world, name));
        let gripper = world.layout().gripper.clone();
        let mut set = vec![0.6; world.kinematics().joints().len()];
        gripper.set(&mut set, 2.0 * turned(0.3));
        let found = joints.map(|joint| set[joint]);
        for (found, wanted) in found.iter().zip([0.3, -0.3, 0.3]) {
            assert!(
                (found - wanted).abs() < 2e-4,
                "{names:?}: {found} instead of {wanted}"
            );
        }
        assert!(
            (gripper.opening_m(&set) - 2.0 * turned(0.3)).abs() < 2e-5,
            "{names:?}"
        );
        let [left, right, third] =
            joints.map(|joint| gripper.effort_per_n(joint).expect("it has a motor"));
        assert!(
            (right / left - 0.5).abs() < 1e-6 && (third / left - 0.5).abs() < 1e-6,
            "{left} {right} {third}"
        );
        let mut command = world.hold();
        for opening_m in [0.07, 0.06] {
            command.gripper_opening_m = opening_m;
            (0..120).for_each(|_| world.step(&command));
            let (is, wanted) = (
                world.observe().positions[joints[2]],
                gripper.target(joints[2], opening_m),
            );
            assert!(
                wanted.is_some_and(|wanted| (is - wanted).abs() < 5e-3),
                "{names:?}: {is} instead of {wanted:?}"
            );
        }
    }
}

/// The convex shapes of knuckles overlap where the real ones do not; those of fingertips meet.
#[test]
fn the_links_of_a_gripper_pass_through_each_other_but_its_fingertips_do_not() {
    let (left, right) = (turning(0.0, 0.6), turning(-0.6, 0.0));
    let profile = hand(&left, &right, &["left", "right"]);
    let model = RobotModel::read(profile.roles()).expect("it is valid");
    let passing = Named::find(profile.roles(), &model)
        .expect("it is valid")
        .passing(&model);
    let links = |pair: &(usize, usize)| [pair.0, pair.1].map(|link| model.links[link].name.clone());
    let mut found: Vec<[String; 2]> = passing.iter().map(links).collect();
    found.sort();
    assert_eq!(found, [["palm", "left_finger"], ["palm", "right_finger"]]);
}

/// A joint without a role is rigid at the position nearest to 0, also where it carries the hand; a
/// programmed one moves.
#[test]
fn joints_without_a_role_are_rigid() {
    let (left, right) = (turning(0.0, 0.6), turning(-0.6, 0.0));
    let mut profile = hand(&left, &right, &["left", "right"]);
    let mast = "<joint name=\"mast\" type=\"prismatic\"><parent link=\"foot\"/><child link=\"base\"/>\
                <axis xyz=\"0 0 1\"/><limit lower=\"0.25\" upper=\"1\" effort=\"900\" velocity=\"0.2\"/></joint>\
                <link name=\"foot\"/></robot>";
    let text = profile.core.urdf.text.replace("</robot>", mast);
    profile = with_urdf(profile, text);
    let names = |profile: &RobotProfile| -> Vec<String> {
        let model = RobotModel::read(profile.roles()).expect("it is valid");
        let mut names: Vec<String> = model
            .joints
            .iter()
            .map(|joint| joint.name.clone())
            .collect();
        names.sort();
        names
    };
    assert_eq!(names(&profile), ["left", "lift", "right"]);
    let world = alone(profile.clone());
    let height = world
        .kinematics()
        .grasp(&world.observe().positions)
        .translation
        .z;
    assert!(
        (height - 0.85).abs() < 1e-6,
        "the mast is at 0.25 m, the lift at 0.6 m: {height} m"
    );
    profile.core.other_joints = vec!["mast".to_owned()];
    assert_eq!(names(&profile), ["left", "lift", "mast", "right"]);
}

/// Coupled joints have the rotors' inertia together: as much as a single one would have for their
/// common motion.
#[test]
fn coupled_joints_share_the_inertia_of_the_rotors() {
    let (left, right) = (turning(0.0, 0.6), turning(-0.6, 0.0));
    let of = |profile: &RobotProfile| {
        let model = RobotModel::read(profile.roles()).expect("it is a URDF");
        Named::find(profile.roles(), &model)
            .expect("it has a gripper")
            .layout
            .gripper
    };
    let alone = of(&hand(&left, FIXED, &["left"]));
    let coupled = of(&hand(&left, &format!("{right}{MIMIC}"), &["left"]));
    let inertia = |gripper: &crate::Gripper, factors: &[f64]| -> f64 {
        gripper
            .joints()
            .zip(factors)
            .map(|(joint, factor)| gripper.armature(joint, 0.05) * factor * factor)
            .sum()
    };
    for (gripper, factors) in [(&alone, &[1.0][..]), (&coupled, &[1.0, -1.0])] {
        let (_, lever_m) = gripper.motors().next().expect("it has a motor");
        assert!((inertia(gripper, factors) - 0.05 * lever_m * lever_m).abs() < 1e-12);
    }
    let shares: Vec<f64> = coupled
        .joints()
        .map(|joint| coupled.armature(joint, 0.05))
        .collect();
    assert_eq!(shares.len(), 2);
    assert!((shares[0] - shares[1]).abs() < 1e-15, "{shares:?}");
}

/// The names of the links of both fingers, sorted.
fn links_of_fingers(profile: &RobotProfile) -> [Vec<String>; 2] {
    let model = RobotModel::read(profile.roles()).expect("it is valid");
    let fingers = Named::find(profile.roles(), &model)
        .expect("it has a gripper")
        .fingers;
    fingers.map(|finger| {
        let mut names: Vec<String> = finger
            .into_iter()
            .map(|link| model.links[link].name.clone())
            .collect();
        names.sort();
        names
    })
}

/// A link with a shape in front of its joint, as many as there are; `joint` is the rest of the
/// joint.
fn link(name: &str, shape: &str, joint: &str) -> String {
    format!(
        "<link name=\"{name}\"><inertial><mass value=\"0.1\"/><inertia ixx=\"1e-4\" ixy=\"0\" ixz=\"0\" iyy=\"1e-4\" iyz=\"0\" \
         izz=\"1e-4\"/></inertial><collision>{shape}</collision></link><joint name=\"{name}_joint\" {joint}\
         <child link=\"{name}\"/></joint>"
    )
}

/// The hand with these links in addition.
fn with_links(profile: &RobotProfile, links: &[String]) -> RobotProfile {
    let text = profile
        .core
        .urdf
        .text
        .replace("</robot>", &format!("{}</robot>", links.concat()));
    with_urdf(profile.clone(), text)
}

/// A can that was held between the lower links of both fingers was not held, because only the tips
/// counted.
#[test]
fn all_links_that_a_finger_joint_moves_belong_to_the_finger_on_their_side() {
    let (left, right) = (turning(0.0, 0.6), turning(-0.6, 0.0));
    let plain = hand(&left, &format!("{right}{MIMIC}"), &["left"]);
    let mimic = |parent: &str, y: f64, factor: f64| {
        format!(
            "type=\"revolute\"><parent link=\"{parent}\"/><origin xyz=\"0.1 {y} 0\"/><axis xyz=\"0 0 1\"/><limit lower=\"-0.6\" \
             upper=\"0.6\" effort=\"9\" velocity=\"2\"/><mimic joint=\"left\" multiplier=\"{factor}\"/>"
        )
    };
    let cube = "<geometry><box size=\"0.02 0.01 0.02\"/></geometry>";
    let owned = |names: [&[&str]; 2]| {
        names.map(|names| {
            names
                .iter()
                .map(|name| (*name).to_owned())
                .collect::<Vec<_>>()
        })
    };
    assert_eq!(
        links_of_fingers(&plain),
        owned([&["left_finger"], &["right_finger"]])
    );

    // Tips on joints that mimic, with a pad that is fixed to one of them and a claw that a program
    // moves.
    let mut phalanges = with_links(
        &plain,
        &[
            link("left_tip", cube, &mimic("left_finger", 0.005, -1.0)),
            link("right_tip", cube, &mimic("right_finger", -0.005, 1.0)),
            link("pad", cube, "type=\"fixed\"><parent link=\"left_tip\"/>"),
            link(
                "claw",
                cube,
                &mimic("right_tip", 0.0, 1.0)
                    .replace("<mimic joint=\"left\" multiplier=\"1\"/>", ""),
            ),
        ],
    );
    phalanges.core.other_joints = vec!["claw_joint".to_owned()];
    assert_eq!(
        links_of_fingers(&phalanges),
        owned([
            &["left_finger", "left_tip"],
            &["claw", "right_finger", "right_tip"]
        ])
    );

    // Knuckles beside the fingers, which carry nothing, and a plate between them; the fingers are
    // named in the other order.
    let mut linkage = with_links(
        &plain,
        &[
            link(
                "left_knuckle",
                cube,
                &mimic("palm", 0.05, 1.0).replace("0.1 ", "0.02 "),
            ),
            link(
                "right_knuckle",
                cube,
                &mimic("palm", -0.05, -1.0).replace("0.1 ", "0.02 "),
            ),
            link(
                "plate",
                cube,
                &mimic("palm", 0.0, 0.1).replace("0.1 ", "-0.05 "),
            ),
        ],
    );
    assert_eq!(
        links_of_fingers(&linkage),
        owned([
            &["left_finger", "left_knuckle"],
            &["right_finger", "right_knuckle"]
        ])
    );
    linkage.hand.finger_links.reverse();
    assert_eq!(
        links_of_fingers(&linkage),
        owned([
            &["right_finger", "right_knuckle"],
            &["left_finger", "left_knuckle"]
        ])
    );

    // A further finger is on the side from which it presses.
    let further = three_fingers(&["left", "right", "third"]);
    assert_eq!(
        links_of_fingers(&further),
        owned([&["left_finger"], &["right_finger", "third_finger"]])
    );

    // A fixed jaw is part of the palm.
    assert_eq!(
        links_of_fingers(&hand(&left, FIXED, &["left"])),
        owned([&["left_finger"], &["palm"]])
    );

    // A carriage that moves with both fingers.
    let slides = "type=\"prismatic\"><parent link=\"palm\"/><axis xyz=\"1 0 0\"/><limit lower=\"-0.1\" upper=\"0.1\" effort=\"9\" \
                  velocity=\"1\"/><mimic joint=\"left\" multiplier=\"0.001\"/>";
    let carriage = with_links(
        &plain,
        &[link(
            "carriage",
            "<origin xyz=\"-0.05 0.03 0\"/><geometry><box size=\"0.01 0.01 0.01\"/></geometry>",
            slides,
        )],
    );
    let carried =
        ["left", "right"]
            .iter()
            .fold(carriage.core.urdf.text.to_string(), |text, side| {
                let child = format!("<child link=\"{side}_finger\"/>");
                text.replace(
                    &format!("<parent link=\"palm\"/>{child}"),
                    &format!("<parent link=\"carriage\"/>{child}"),
                )
            });
    let carriage = with_urdf(carriage, carried);
    assert_eq!(
        links_of_fingers(&carriage),
        owned([&["left_finger"], &["right_finger"]])
    );
}

/// The same for a hand in MuJoCo's format, whose joints are coupled by equalities.
#[test]
fn coupled_links_of_a_mujoco_hand_belong_to_its_fingers() {
    let folder = actcheck_base::ScratchFolder::create().expect("it can be created");
    let finger = |side: &str, y: f64| {
        let sign = y.signum();
        format!(
            "<body name=\"{side}_lower\" pos=\"0 {y} 0\"><joint name=\"{side}\" type=\"hinge\" axis=\"0 0 {sign}\" range=\"0 0.6\"/>\
             <geom type=\"box\" pos=\"0.03 {} 0\" size=\"0.025 0.005 0.015\"/>\
             <body name=\"{side}_upper\" pos=\"0.06 0 0\"><joint name=\"{side}_upper\" type=\"hinge\" axis=\"0 0 {sign}\" range=\"-0.6 0.6\"/>\
             <geom type=\"box\" pos=\"0.03 {} 0\" size=\"0.03 0.005 0.015\"/></body></body>",
            0.005 * sign,
            0.005 * sign
        )
    };
    let couple = |joint: &str, factor: f64| {
        format!("<joint joint1=\"{joint}\" joint2=\"left\" polycoef=\"0 {factor} 0 0 0\"/>")
    };
    let text = format!(
        "<mujoco><compiler angle=\"radian\"/><worldbody><body name=\"base\"><geom type=\"box\" size=\"0.05 0.05 0.05\"/>\
         <body name=\"palm\" pos=\"0 0 0.2\"><joint name=\"lift\" type=\"slide\" axis=\"0 0 1\" range=\"0.3 1\"/>\
         <geom type=\"box\" pos=\"-0.03 0 0\" size=\"0.01 0.04 0.01\"/>{}{}\
         <site name=\"grasp\" pos=\"0.1 0 0\"/></body></body></worldbody>\
         <equality>{}{}{}</equality>\
         <actuator><position joint=\"lift\" kp=\"100\" forcerange=\"-300 300\"/><position joint=\"left\" kp=\"100\" forcerange=\"-20 20\"/></actuator>\
         </mujoco>",
        finger("left", 0.02),
        finger("right", -0.02),
        couple("right", 1.0),
        couple("left_upper", -1.0),
        couple("right_upper", -1.0),
    );
    let profile = "urdf = \"hand.xml\"\narm_joints = [\"lift\"]\nfinger_joints = [\"left\"]\nfinger_links = [\"left_upper\", \"right_upper\"]\n\
                   grasp_link = \"grasp\"\ncamera_link = \"base\"\nmax_opening_m = 0.05\nhome = [0.6]\n";
    std::fs::write(folder.path().join("hand.xml"), text).expect("it can be written");
    std::fs::write(folder.path().join("hand.toml"), profile).expect("it can be written");
    let read = actcheck_config::robot::read(&Files::Disk, &folder.path().join("hand.toml"))
        .expect("it is valid")
        .complete()
        .expect("it states all roles");
    assert_eq!(
        links_of_fingers(&read),
        [["left_lower", "left_upper"], ["right_lower", "right_upper"]]
            .map(|names| names.map(str::to_owned).to_vec())
    );
}
