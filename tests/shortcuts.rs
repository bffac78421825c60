//! Simulation with the robot's hand alone in the engine, against the whole robot in it.

use std::sync::Arc;

use actcheck::actions::perform;
use actcheck::data::{Budget, Choices, ObjectModel, Pose, Role, Scene, Trace};
use actcheck::world::{Command, Shortcuts, World, build};

use crate::physics::{block, body, call, object, on_table, scene};

/// Picks a thing from a table, and returns the trace and the world with the thing in the hand.
fn picked(model: &Arc<ObjectModel>, shortcuts: Shortcuts) -> (Trace, World) {
    let mut world = build(&on_table(Arc::clone(model), 0.3, 0.5)).expect("the scene is right");
    world.take_shortcuts(shortcuts);
    assert!(world.settle().settled);
    let trace = perform(
        &[call("Pick")],
        &mut world,
        &mut Choices::random(1, 0),
        &Budget { action_secs: 60.0 },
    );
    (trace, world)
}

/// Returns the pose of the thing in the frame of the hand.
fn in_hand(world: &World) -> nalgebra::Isometry3<f64> {
    let hand = world.snapshot().robot.gripper.to_isometry();
    hand.inverse() * body(world, "thing_1").pose.to_isometry()
}

#[test]
fn a_hand_alone_grasps_and_holds_like_the_whole_robot() {
    let model = block([0.06, 0.06, 0.15]);
    let mut found = Vec::new();
    for shortcuts in [Shortcuts::NONE, Shortcuts::ALL] {
        let (trace, mut world) = picked(&model, shortcuts);
        let report = trace.actions[0].report.as_ref().expect("the skill reports");
        assert!(report.succeeded, "{}", report.message);
        let [_, _, alone, whole] = world.proximity().ticks_by_reach();
        assert_eq!(
            (alone > 0, whole > 0),
            (shortcuts == Shortcuts::ALL, shortcuts == Shortcuts::NONE)
        );
        let heights = [
            world.snapshot().robot.gripper.position[2],
            body(&world, "thing_1").pose.position[2],
        ];
        let mut hold = world.hold();
        hold.gripper_opening_m = 0.0;
        (0..60).for_each(|_| world.step(&hold));
        let before = in_hand(&world);
        (0..600).for_each(|_| world.step(&hold));
        let after = in_hand(&world);
        let slip = (after.translation.vector - before.translation.vector).norm();
        found.push((
            heights,
            slip,
            after.rotation.angle_to(&before.rotation),
            world.recorder().quality().deepest_penetration_m,
        ));
    }
    let [
        ([hand, thing], slip, tilt, depth),
        ([hand_alone, thing_alone], slip_alone, tilt_alone, depth_alone),
    ] = found[..]
    else {
        panic!("two worlds")
    };
    assert!((hand - hand_alone).abs() < 1e-3, "{hand} and {hand_alone}");
    // With two substeps, things creep down while the whole robot lifts them.
    assert!(
        thing_alone > thing - 1e-3,
        "{thing_alone} instead of {thing}"
    );
    assert!(
        slip_alone < slip + 5e-5,
        "slipped by {slip_alone} m instead of {slip} m"
    );
    assert!(
        tilt_alone < tilt + 2e-3,
        "tilted by {tilt_alone} instead of {tilt}"
    );
    assert!(
        depth_alone < depth + 2e-4,
        "penetrates by {depth_alone} m instead of {depth} m"
    );
}

/// Shapes are swept only where something fast can meet something fixed: a pick without sweeps is
/// the same bit by bit.
#[test]
fn a_pick_is_the_same_without_needless_sweeps() {
    let model = block([0.06, 0.06, 0.15]);
    let of = |few_sweeps: bool| {
        let (trace, world) = picked(
            &model,
            Shortcuts {
                few_sweeps,
                ..Shortcuts::ALL
            },
        );
        (format!("{trace:?}"), world.engine().swept())
    };
    let [(always, swept), (seldom, swept_at_last)] = [of(false), of(true)];
    assert_eq!(always, seldom);
    assert_eq!(
        (swept, swept_at_last),
        (true, false),
        "the thing hangs in the hand"
    );
}

/// A plate of 2 mm that falls on the floor moves 4 cm in each step.
#[test]
fn a_fast_thing_does_not_pass_through_the_floor() {
    let mut found = Vec::new();
    for few_sweeps in [false, true] {
        let mut dropped = scene(vec![object(
            "plate_1",
            block([0.2, 0.2, 0.002]),
            Role::Other,
            Pose::upright([2.0, 0.0, 4.0], 0.0),
            0.2,
            0.5,
        )]);
        dropped.robot.base = [0.0, 0.0, 0.0];
        let mut world = build(&dropped).expect("the scene is right");
        world.take_shortcuts(Shortcuts {
            few_sweeps,
            ..Shortcuts::ALL
        });
        let hold = world.hold();
        let mut n_swept = 0;
        for _ in 0..120 {
            world.step(&hold);
            n_swept += usize::from(world.engine().swept());
        }
        assert_eq!(world.fault(), None);
        let height = body(&world, "plate_1").pose.position[2];
        assert!(height > -0.01, "it is at {height} m");
        found.push((body(&world, "plate_1").pose, n_swept));
    }
    assert_eq!(found[0].0, found[1].0);
    assert!(
        found[0].1 == 120 && (1..100).contains(&found[1].1),
        "swept in {} and {} ticks",
        found[0].1,
        found[1].1
    );
}

/// The arm stretched forwards, with a level hand: lift, flexion, roll, flexion and roll of the
/// wrist.
const LEVEL: [f64; 5] = [0.3, -1.25, 0.0, -0.32, 0.0];
/// Gap between this hand and a block under it. Unit: metres.
const GAP_M: f64 = 0.1;

/// A scene with a robot at the origin, and a block under the hand of its stretched arm.
fn block_below() -> Scene {
    let mut scene = scene(Vec::new());
    scene.robot.base = [0.0, 0.0, 0.0];
    let mut world = build(&scene).expect("the scene is right");
    let command = stretched(&world);
    (0..300).for_each(|_| world.step(&command));
    let [x, y, height] = world.snapshot().robot.gripper.position;
    let model = block([0.2, 0.2, height - GAP_M]);
    scene.objects = vec![object(
        "block_1",
        model,
        Role::Other,
        Pose::upright([x, y, 0.0], 0.0),
        5.0,
        0.5,
    )];
    scene
}

/// Stretches its arm.
pub fn stretched(world: &World) -> Command {
    let mut command = world.hold();
    for (joint, position) in world.layout().arm.iter().zip(LEVEL) {
        command.positions[*joint] = position;
    }
    command
}

/// A hand that presses an object onto the floor would move through it, if the arm did not give way.
#[test]
fn a_hand_that_is_pushed_hard_gets_its_arm_back() {
    let scene = block_below();
    let mut found = Vec::new();
    for shortcuts in [Shortcuts::NONE, Shortcuts::ALL] {
        let mut world = build(&scene).expect("the scene is right");
        world.take_shortcuts(shortcuts);
        assert!(world.settle().settled);
        let mut command = stretched(&world);
        let lift = world.layout().arm[0];
        // The hand comes from above.
        command.positions[lift] = 0.5;
        (0..300).for_each(|_| world.step(&command));
        world.begin_record();
        command.positions[lift] = 0.1;
        (0..240).for_each(|_| world.step(&command));
        assert_eq!(world.fault(), None);
        let record = world.end_record();
        let force = record
            .contacts
            .iter()
            .filter(|contact| contact.pair.contains(&"block_1".to_owned()));
        let pressed =
            force.filter(|contact| contact.pair.iter().any(|name| name.starts_with("robot/")));
        let most = pressed
            .map(|contact| contact.max_force_n)
            .fold(0.0, f64::max);
        let positions = world.observe().positions;
        found.push((
            most,
            positions[lift],
            world.recorder().quality().deepest_penetration_m,
            world.proximity().ticks_by_reach(),
        ));
    }
    let [
        (force, stopped, depth, _),
        (force_alone, stopped_alone, depth_alone, ticks),
    ] = found[..]
    else {
        panic!("two worlds")
    };
    assert!(ticks[3] > 60, "the whole robot presses: {ticks:?}");
    assert!(
        force > 50.0 && (force_alone / force - 1.0).abs() < 0.3,
        "{force_alone} N instead of {force} N"
    );
    assert!(
        (stopped - stopped_alone).abs() < 2e-3,
        "stopped at {stopped_alone} instead of {stopped}"
    );
    assert!(
        depth_alone < depth + 1e-3,
        "penetrates by {depth_alone} m instead of {depth} m"
    );
}
