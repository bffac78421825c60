//! Robots whose links have many convex pieces, as split meshes have: fewer contacts are prepared
//! and solved for them.

use std::path::Path;
use std::sync::Arc;

use actcheck::actions::perform;
use actcheck::base::{Files, Outcome, Source};
use actcheck::data::{Budget, Choices, Pose, RobotProfile, Role, Scene};
use actcheck::world::{Poison, Shortcuts, World, build};

use crate::physics::{block, body, call, object, on_table, scene};
use crate::shortcuts::stretched;
use crate::support::line::{env_of, nominal, outcomes, report};

/// A shipped robot's URDF with each finger cut into five boxes, which have the same surface
/// together.
fn cut(urdf: &str) -> String {
    let finger = regex::Regex::new(
        "<collision><origin xyz=\"0 (-?0.006) [0-9.]+\" rpy=\"0 0 0\"/><geometry><box size=\"0.024 0.012 ([0-9.]+)\"/></geometry></collision>",
    );
    let finger = finger.expect("a sound pattern");
    assert_eq!(finger.find_iter(urdf).count(), 2);
    let text = finger.replace_all(urdf, |found: &regex::Captures| {
        let length = found[2].parse::<f64>().expect("a number") / 5.0;
        let piece = |idx: u32| {
            let z = (0.5 + f64::from(idx)) * length;
            let y = &found[1];
            format!(
                "<collision><origin xyz=\"0 {y} {z}\"/><geometry><box size=\"0.024 0.012 {length}\"/></geometry></collision>"
            )
        };
        (0..5).map(piece).collect::<String>()
    });
    text.into_owned()
}

/// The robot with another URDF.
fn changed(profile: &RobotProfile, change: impl Fn(&str) -> String) -> Arc<RobotProfile> {
    let urdf = Source::new("changed.urdf", change(&profile.core.urdf.text));
    let core = actcheck::config::robot::with_urdf(profile.core.clone(), urdf);
    Arc::new(RobotProfile {
        core: core.expect("it is a URDF"),
        ..profile.clone()
    })
}

/// The scene with the robot's fingers cut.
fn with_pieces(mut scene: Scene) -> Scene {
    scene.robot.profile = changed(&scene.robot.profile, cut);
    scene
}

/// Contacts that can't close in a step are dropped, and others are prepared later: a grasp holds as
/// without that.
#[test]
fn fingers_of_many_pieces_hold_like_those_of_one() {
    let table = || on_table(block([0.06, 0.06, 0.15]), 0.3, 0.5);
    let [whole, pieces] = [table(), with_pieces(table())].map(|scene| {
        let mut world = build(&scene).expect("the scene is right");
        assert!(world.settle().settled);
        let budget = Budget { action_secs: 60.0 };
        let trace = perform(
            &[call("Pick")],
            &mut world,
            &mut Choices::random(1, 0),
            &budget,
        );
        let report = trace.actions[0].report.as_ref().expect("the skill reports");
        assert!(report.succeeded, "{}", report.message);
        let mut hold = world.hold();
        hold.gripper_opening_m = 0.0;
        (0..60).for_each(|_| world.step(&hold));
        let before = in_hand(&world);
        (0..600).for_each(|_| world.step(&hold));
        let slip = (in_hand(&world).translation.vector - before.translation.vector).norm();
        (
            body(&world, "thing_1").pose.position[2],
            slip,
            world.recorder().quality().deepest_penetration_m,
        )
    });
    assert!((whole.0 - pieces.0).abs() < 2e-3, "{whole:?} {pieces:?}");
    assert!(
        pieces.1 < whole.1 + 1e-4,
        "slipped by {} m instead of {} m",
        pieces.1,
        whole.1
    );
    assert!(
        pieces.2 < whole.2 + 3e-4,
        "penetrates by {} m instead of {} m",
        pieces.2,
        whole.2
    );
}

/// Returns the pose of the thing in the frame of the hand.
fn in_hand(world: &World) -> nalgebra::Isometry3<f64> {
    let hand = world.snapshot().robot.gripper.to_isometry();
    hand.inverse() * body(world, "thing_1").pose.to_isometry()
}

/// A bar from 2 m moves farther in a step than the distance within which contacts with slow objects
/// are prepared: it enters the robot no deeper all the same.
#[test]
fn a_fast_object_does_not_enter_fingers_of_many_pieces_deeper() {
    let falling = |pieces: bool, height: f64| {
        let mut scene = scene(Vec::new());
        scene.robot.base = [0.0, 0.0, 0.0];
        let world = build(&scene).expect("the scene is right");
        let [x, y, z] = world.snapshot().robot.gripper.position;
        let pose = Pose::upright([x + 0.02, y, z + height], 0.0);
        scene.objects = vec![object(
            "thing_1",
            block([0.04, 0.4, 0.04]),
            Role::Target,
            pose,
            0.5,
            0.5,
        )];
        let mut world =
            build(&if pieces { with_pieces(scene) } else { scene }).expect("the scene is right");
        let hold = world.hold();
        world.begin_record();
        (0..90).for_each(|_| world.step(&hold));
        let depth_m = world.recorder().quality().deepest_penetration_m;
        let contacts = world.end_record().contacts;
        let is_of_robot =
            |pair: &[String; 2]| pair[0].starts_with("robot/") && pair[1] == "thing_1";
        assert!(
            contacts.iter().any(|contact| is_of_robot(&contact.pair)),
            "{contacts:?}"
        );
        depth_m
    };
    // How deep a single fall ends depends on the last bit, because the bar tumbles: the median of
    // several counts.
    for heights in
        [0.3, 0.8, 1.3, 1.8].map(|lowest| [0.0, 0.1, 0.2, 0.3, 0.4].map(|more| lowest + more))
    {
        let [whole, pieces] = [false, true].map(|pieces| {
            let mut depths = heights.map(|height| falling(pieces, height));
            depths.sort_by(f64::total_cmp);
            depths[2]
        });
        assert!(
            pieces < whole + 5e-4,
            "from {heights:?} m, it enters by {pieces} m instead of {whole} m"
        );
    }
}

/// The engine does not look for contacts of links that can touch nothing. A bar that falls onto a
/// stretched arm enters it no deeper all the same.
#[test]
fn a_falling_object_does_not_enter_an_arm_of_many_pieces_deeper() {
    let falling = |pieces: bool, height: f64| {
        let bar = Pose::upright([2.0, 2.0, 0.021], 0.0);
        let mut scene = scene(vec![object(
            "thing_1",
            block([0.04, 0.4, 0.04]),
            Role::Target,
            bar,
            0.5,
            0.5,
        )]);
        scene.robot.base = [0.0, 0.0, 0.0];
        let mut world =
            build(&if pieces { with_pieces(scene) } else { scene }).expect("the scene is right");
        let command = stretched(&world);
        (0..300).for_each(|_| world.step(&command));
        assert!(world.proximity().moved_freely());
        let joints = world.kinematics().joints();
        let wrist = joints
            .iter()
            .position(|joint| joint.name == "wrist_flex_joint")
            .expect("it has a wrist");
        let links = world.kinematics().links(&world.observe().positions);
        let [elbow, wrist] =
            [joints[wrist].parent, wrist + 1].map(|link| links[link].translation.vector);
        let above = (elbow + wrist) / 2.0 + nalgebra::Vector3::z() * height;
        assert!(world.poison("thing_1", Poison::Teleport(above.into())));
        world.begin_record();
        (0..90).for_each(|_| world.step(&command));
        let depth_m = world.recorder().quality().deepest_penetration_m;
        let contacts = world.end_record().contacts;
        let is_of_arm =
            |pair: &[String; 2]| pair[0].starts_with("robot/arm_") && pair[1] == "thing_1";
        assert!(
            contacts.iter().any(|contact| is_of_arm(&contact.pair)),
            "{contacts:?}"
        );
        depth_m
    };
    for height in [0.2, 1.0, 2.0] {
        let [whole, pieces] = [false, true].map(|pieces| falling(pieces, height));
        assert!(
            pieces < whole + 5e-4,
            "from {height} m, it enters by {pieces} m instead of {whole} m"
        );
    }
}

/// Shapes are swept beside such fingers only where something outruns the contacts that are
/// prepared.
#[test]
fn only_fast_things_are_swept_beside_fingers_of_many_pieces() {
    let swept = |height: f64, ticks: u32| {
        let pose = Pose::upright([2.0, 0.0, height], 0.0);
        let mut scene = scene(vec![object(
            "plate_1",
            block([0.2, 0.2, 0.002]),
            Role::Other,
            pose,
            0.2,
            0.5,
        )]);
        scene.robot.base = [0.0, 0.0, 0.0];
        let mut world = build(&with_pieces(scene)).expect("the scene is right");
        let hold = world.hold();
        let mut n_swept = 0;
        for _ in 0..ticks {
            world.step(&hold);
            n_swept += u32::from(world.engine().swept());
        }
        assert_eq!(world.fault(), None);
        let height = body(&world, "plate_1").pose.position[2];
        assert!(height > -1e-3, "it is at {height} m");
        n_swept
    };
    // It arrives at 0.3 m/s.
    assert_eq!(swept(0.006, 30), 0);
    // It moves 4 cm in each step at last.
    let n_swept = swept(4.0, 120);
    assert!((1..60).contains(&n_swept), "swept in {n_swept} ticks");
}

/// The shipped arm with its root on the table.
fn arm_on_a_table() -> Scene {
    let path = Path::new("models/robots/fixed_arm.toml");
    let stated =
        actcheck::config::robot::read(&Files::Shipped, path).expect("the shipped robot is right");
    let profile = stated.complete().expect("it states all roles");
    let mut scene = on_table(block([0.06, 0.06, 0.15]), 0.3, 0.5);
    scene.robot.profile = Arc::new(profile);
    (scene.robot.base, scene.robot.root_height_m) = ([0.3, 0.0, 0.0], 0.69);
    scene
}

/// A bar on the wrist is 0.9 mm beside the fingers: at rest, they are as good as apart, but the bar
/// stops them when they turn.
#[test]
fn links_that_are_hardly_apart_leave_only_their_motion_to_the_engine() {
    let mut scene = arm_on_a_table();
    let mut profile = (*scene.robot.profile).clone();
    let bar = "<collision><origin xyz=\"0.0179 0 0.2\"/><geometry><box size=\"0.01 0.3 0.01\"/></geometry></collision>";
    let text = profile.core.urdf.text.replace(
        "<link name=\"wrist_pitch_link\">",
        &format!("<link name=\"wrist_pitch_link\">{bar}"),
    );
    assert!(text.contains(bar));
    let urdf = Source::new("bar.urdf", text);
    profile.core = actcheck::config::robot::with_urdf(profile.core, urdf).expect("it is a URDF");
    scene.robot.profile = Arc::new(profile);
    let mut world = build(&scene).expect("the scene is right");
    assert!(world.settle().settled);
    let mut command = world.hold();
    (0..30).for_each(|_| world.step(&command));
    let [free, .., whole] = world.proximity().ticks_by_reach();
    assert!(
        free > 0 && whole == 0,
        "{:?}",
        world.proximity().ticks_by_reach()
    );
    let roll = world
        .layout()
        .arm
        .last()
        .copied()
        .expect("the arm has joints");
    let before = world.observe().positions[roll];
    command.positions[roll] += 0.5;
    (0..60).for_each(|_| world.step(&command));
    let turned = world.observe().positions[roll] - before;
    assert!(
        turned < 0.1 && world.proximity().ticks_by_reach()[3] > 0,
        "turned by {turned} rad: {:?}",
        world.proximity().ticks_by_reach()
    );
}

/// A fixed robot on a table touches it with its root all the time, and an object beside the root is
/// as near. Its arm moves without the engine all the same.
#[test]
fn the_root_of_a_fixed_robot_may_touch_things() {
    for beside_m in [0.2, 0.001] {
        let mut scene = arm_on_a_table();
        // The root is 24 cm wide, and the object 6 cm.
        scene.objects[1].pose.position = [0.3 - 0.12 - 0.03 - beside_m, 0.0, 0.706];
        let mut world = build(&scene).expect("the scene is right");
        assert!(world.settle().settled);
        let mut command = world.hold();
        let pan = world.layout().arm[0];
        command.positions[pan] += 0.2;
        (0..60).for_each(|_| world.step(&command));
        let [free, .., whole] = world.proximity().ticks_by_reach();
        assert!(
            free > 0 && whole == 0,
            "{beside_m} m: {:?}",
            world.proximity().ticks_by_reach()
        );
        assert!((world.observe().positions[pan] - command.positions[pan]).abs() < 0.01);
    }
}

/// A shipped robot's URDF with a twentieth of the masses of its arm, and a tenth of the efforts of
/// the motors there. The arm goes from this place in the file to the fingers.
fn light(urdf: &str, first: &str) -> String {
    let (arm, end) = (
        urdf.find(first),
        urdf.find("<joint name=\"finger_left_joint\""),
    );
    let (arm, end) = (
        arm.expect("the arm begins there"),
        end.expect("the arm ends there"),
    );
    let attributes =
        regex::Regex::new("(mass value|ixx|iyy|izz|effort)=\"([^\"]+)\"").expect("a sound pattern");
    let scaled = attributes.replace_all(&urdf[arm..end], |found: &regex::Captures| {
        let factor = if &found[1] == "effort" { 0.1 } else { 0.05 };
        format!(
            "{}=\"{}\"",
            &found[1],
            factor * found[2].parse::<f64>().expect("a number")
        )
    });
    format!("{}{scaled}{}", &urdf[..arm], &urdf[end..])
}

/// The fixed arm beside a table with a thing of 0.8 kg. The arm is so light that it sinks under the
/// thing.
fn light_arm() -> Scene {
    let mut scene = arm_on_a_table();
    let thing = &mut scene.objects[1];
    thing.mass_kg = 0.8;
    let [x, y, _] = thing.pose.position;
    (scene.robot.base, scene.robot.root_height_m) = ([x - 0.55, y, 0.0], 0.0);
    scene.robot.profile = changed(&scene.robot.profile, |urdf| light(urdf, "<robot"));
    scene
}

/// The engine never moves the hand of a light arm alone. The arm gives way as it does with four
/// times as many steps, with fingers of one piece and of five.
#[test]
fn a_light_arm_sinks_under_the_object_in_its_hand() {
    for fingers in [|scene| scene, with_pieces] {
        let [exact, usual] =
            [(Shortcuts::NONE, 960), (Shortcuts::ALL, 240)].map(|(shortcuts, steps_per_second)| {
                let mut scene = fingers(light_arm());
                scene.physics.steps_per_second = steps_per_second;
                let mut world = build(&scene).expect("the scene is right");
                world.take_shortcuts(shortcuts);
                assert!(world.settle().settled);
                let budget = Budget { action_secs: 60.0 };
                let trace = perform(
                    &[call("Pick")],
                    &mut world,
                    &mut Choices::random(1, 0),
                    &budget,
                );
                let report = trace.actions[0].report.as_ref().expect("the skill reports");
                assert!(report.succeeded, "{}", report.message);
                let mut hold = world.hold();
                hold.gripper_opening_m = 0.0;
                (0..120).for_each(|_| world.step(&hold));
                assert!(!world.proximity().moved_hand_alone());
                let hand = world.snapshot().robot.gripper.position[2];
                (
                    hand,
                    in_hand(&world).translation.z,
                    world.recorder().quality().deepest_penetration_m,
                )
            });
        assert!(
            (exact.0 - usual.0).abs() < 1e-3,
            "the hands are at {} m and {} m",
            exact.0,
            usual.0
        );
        assert!(
            (exact.1 - usual.1).abs() < 5e-3,
            "the things are at {} m and {} m in the hand",
            exact.1,
            usual.1
        );
        assert!(
            usual.2 < exact.2 + 3e-4,
            "penetrates by {} m instead of {} m",
            usual.2,
            exact.2
        );
    }
}

/// A mobile robot carries a heavy can through the room and sets it down: with fingers of many
/// pieces, with a light arm, and with both.
#[test]
fn mobile_robots_place_a_heavy_can() {
    let profile = include_str!("../models/robots/mobile_manipulator.toml");
    let urdf = include_str!("../models/robots/mobile_manipulator.urdf");
    let light = |urdf: &str| light(urdf, "<joint name=\"arm_lift_joint\"");
    let kinds = [
        ("many pieces", cut(urdf)),
        ("a light arm", light(urdf)),
        ("many pieces on a light arm", light(&cut(urdf))),
    ];
    for (kind, urdf) in kinds {
        let folder = tempfile::tempdir().expect("there is room");
        let at = folder.path().join("robot.toml");
        std::fs::write(&at, profile).expect("there is room");
        std::fs::write(folder.path().join("mobile_manipulator.urdf"), urdf).expect("there is room");
        let env = env_of(&format!(
            "tests = [[\"Pick\", \"Place\"]]\ntest_count = 1\nseed = 5\n[objectSurface]\nobject_surfaces = [\"coffee_table\"]\n\
            [placeSurface]\nplace_object_surfaces = [\"table\"]\n[pickObject]\nmodel_list = [\"can\"]\n\
            [physics]\nmass_scale = [1.5, 1.5]\n[robot]\nprofile = {at:?}\n"
        ));
        let run = nominal(&env, None);
        for step in [0, 1] {
            let mut failed = outcomes(&run, step);
            failed.retain(|_, outcome| *outcome != Outcome::Passed);
            assert!(
                failed.is_empty(),
                "{kind}: {}: {failed:?}",
                report(&run, step).message
            );
        }
    }
}
