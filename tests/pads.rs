//! The friction of areas in contact, against closed-form answers: pads that grip and resist
//! turning, and things that roll. Standard settings: 240 steps per second and 4 iterations.

use std::sync::Arc;

use actcheck::data::{Inertia, ObjectModel, Part, Pose, Role, Shape};
use actcheck::world::{Command, GRAVITY, Poison, World, build};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use crate::physics::{block, body, object, scene, shipped};

/// Friction of the pads of the shipped robot, and of the objects here.
const FRICTION: f64 = 0.8;
/// The arm stretched forwards, with a level hand: lift, flexion, roll, flexion and roll of the
/// wrist.
const LEVEL: [f64; 5] = [0.3, -1.25, 0.0, -0.32, 0.0];
/// Mean lever of the friction of a pad. Unit: metres.
const PAD_LEVER_M: f64 = 3e-3;
/// Lever of the force against which things roll. Unit: metres.
const ROLLING_LEVER_M: f64 = 5e-4;

/// A world in which the hand has just closed on an object of this size, with its middle between the
/// pads.
fn gripped(model: &Arc<ObjectModel>, mass_kg: f64, force_n: f64) -> (World, Command) {
    turned_by(model, mass_kg, force_n, 0.0)
}

/// The same with an object that is turned about its vertical axis.
fn turned_by(model: &Arc<ObjectModel>, mass_kg: f64, force_n: f64, yaw: f64) -> (World, Command) {
    let aside = Pose::upright([2.0, 0.0, 0.0], yaw);
    let mut scene = scene(vec![object(
        "a",
        Arc::clone(model),
        Role::Target,
        aside,
        mass_kg,
        FRICTION,
    )]);
    scene.robot.base = [0.0, 0.0, 0.0];
    scene.physics.iterations = 4;
    let mut world = build(&scene).expect("the scene is right");
    let mut command = world.hold();
    for (joint, position) in world.layout().arm.clone().into_iter().zip(LEVEL) {
        command.positions[joint] = position;
    }
    command.gripper_opening_m = model.size_m[1] + 0.004;
    (0..400).for_each(|_| world.step(&command));
    (command.gripper_opening_m, command.grip_force_n) = (0.0, force_n);
    let [x, y, z] = world.snapshot().robot.gripper.position;
    // Something holds it level until the fingers press with their whole force.
    for _ in 0..30 {
        assert!(world.poison("a", Poison::Teleport([x, y, z - model.size_m[2] / 2.0])));
        assert!(world.poison("a", Poison::Velocity([0.0; 3])));
        world.step(&command);
    }
    (world, command)
}

/// The pose of the object in the frame of the hand.
fn in_hand(world: &World) -> Isometry3<f64> {
    world.snapshot().robot.gripper.to_isometry().inverse() * body(world, "a").pose.to_isometry()
}

/// Two pads that press with N each hold up to 2·µ·N: below 85 % of it nothing slips, above 110 %
/// everything does. The arm gives way to objects of more than 1.2 kg, which are heavier than its
/// effective mass, so that these may slip by some millimetres.
#[test]
fn two_pads_hold_objects_that_weigh_less_than_twice_their_friction() {
    let model = block([0.06, 0.06, 0.15]);
    for force_n in [4.0, 7.0, 10.0] {
        let limit_kg = 2.0 * FRICTION * force_n / GRAVITY;
        for share in [0.2, 0.35, 0.5, 0.7, 0.85, 1.1] {
            if share < 1.0 && share * limit_kg > 1.2 {
                continue;
            }
            let (mut world, command) = gripped(&model, share * limit_kg, force_n);
            let before = in_hand(&world);
            (0..60).for_each(|_| world.step(&command));
            assert_eq!(world.fault(), None);
            let slipped = (in_hand(&world).translation.vector - before.translation.vector).norm();
            // The excess over the limit accelerates it.
            let expected = GRAVITY * (share - 1.0).max(0.0) / 2.0;
            let case = format!("{share} of {limit_kg:.3} kg at {force_n} N");
            if share < 1.0 {
                assert!(slipped < 2e-4, "{case}: slipped by {slipped} m");
            } else {
                assert!(
                    slipped > 0.5 * expected.min(0.1),
                    "{case}: slipped by {slipped} m of {expected} m"
                );
            }
        }
    }
}

/// A ball on a flat foot. The pads touch the ball at one point each, and its centre of mass is
/// beside the line between them.
fn unbalanced(lever_m: f64) -> Arc<ObjectModel> {
    let radius = 0.03;
    let about = 4e-4;
    let middle = Pose::upright([0.0, 0.0, radius], 0.0);
    Arc::new(ObjectModel {
        parts: vec![
            Part {
                pose: middle,
                shape: Shape::Sphere { radius },
            },
            Part {
                pose: Pose::upright([0.0, 0.0, 0.002], 0.0),
                shape: Shape::Box {
                    size: [0.08, 0.02, 0.004],
                },
            },
        ],
        inertia: Some(Inertia {
            com_m: [lever_m, 0.0, radius],
            about_com: [[about, 0.0, 0.0], [0.0, about, 0.0], [0.0, 0.0, about]],
        }),
        ..Arc::unwrap_or_clone(block([2.0 * radius; 3]))
    })
}

/// The largest torque of two pads on an object of this mass: the friction that its weight leaves,
/// times the lever of the friction about the middle of a pad.
fn largest_torque(mass_kg: f64, force_n: f64) -> f64 {
    let most = 2.0 * FRICTION * force_n;
    (most.powi(2) - (mass_kg * GRAVITY).powi(2)).sqrt() * PAD_LEVER_M
}

/// How far the object has turned in the hand since this moment. Unit: radians.
fn turned(world: &World, since: &Isometry3<f64>) -> f64 {
    in_hand(world).rotation.angle_to(&since.rotation)
}

/// How far the object has turned in the world since it was upright. Unit: radians.
fn angle(world: &World) -> f64 {
    body(world, "a")
        .pose
        .to_isometry()
        .rotation
        .angle_to(&UnitQuaternion::identity())
}

/// Below the largest torque of the pads it does not turn at all; above, it swings.
#[test]
fn pads_hold_an_unbalanced_object_up_to_the_torque_of_their_friction() {
    for (mass_kg, force_n) in [(0.2, 7.0), (0.3, 7.0), (0.2, 10.0)] {
        let onset_m = largest_torque(mass_kg, force_n) / (mass_kg * GRAVITY);
        for (share, holds) in [(0.5, true), (0.85, true), (1.2, false)] {
            let (mut world, command) = gripped(&unbalanced(share * onset_m), mass_kg, force_n);
            let start = angle(&world);
            (0..90).for_each(|_| world.step(&command));
            assert_eq!(world.fault(), None);
            let turned = angle(&world) - start;
            let case = format!(
                "{mass_kg} kg at {force_n} N, {share} of {onset_m:.4} m: turned by {turned}"
            );
            assert!(
                if holds {
                    turned.abs() < 1e-3
                } else {
                    turned > 0.04
                },
                "{case}"
            );
        }
    }
}

/// An object that the pads can't hold level swings down until its energy is spent, m·g·l·(sin(b) −
/// sin(a)) = T·(b − a), and then stays where it is, because friction also holds it there: it is
/// still within a second.
#[test]
fn a_swing_between_pads_ends_within_a_second() {
    for (mass_kg, force_n) in [(0.2, 7.0), (0.3, 7.0)] {
        let torque = largest_torque(mass_kg, force_n);
        for share in [1.2, 1.5, 2.0] {
            let weight = share * torque;
            let (mut world, command) =
                gripped(&unbalanced(weight / (mass_kg * GRAVITY)), mass_kg, force_n);
            let start = angle(&world);
            let spent = |end: &f64| weight * (end.sin() - start.sin()) < torque * (end - start);
            let expected = (1..3000).map(|k| start + 1e-3 * f64::from(k)).find(spent);
            let expected = expected.expect("friction stops it before it turns over");
            (0..60).for_each(|_| world.step(&command));
            let swung = angle(&world);
            let case = format!("{mass_kg} kg, {share}: from {start} to {swung}");
            assert!(
                (swung - expected).abs() < 0.03,
                "{case} instead of {expected}"
            );
            let still = in_hand(&world);
            (0..60).for_each(|_| world.step(&command));
            let moved = turned(&world, &still);
            assert!(moved < 1e-3, "{case}: moved by {moved} in the second after");
        }
    }
}

/// A glass whose wall meets the pads at an edge or at a facet, gripped 3 cm below its middle and
/// pushed.
#[test]
fn a_glass_in_a_still_hand_does_not_swing() {
    let model = shipped("glass");
    for yaw in [0.0, 0.13, 0.2, 0.26] {
        let (mut world, command) = turned_by(&model, model.mass_kg, 7.0, yaw);
        assert!(world.poison("a", Poison::Velocity([0.2, 0.0, 0.0])));
        (0..60).for_each(|_| world.step(&command));
        let (start, mut most) = (in_hand(&world), 0.0_f64);
        for _ in 0..120 {
            world.step(&command);
            most = most.max(turned(&world, &start));
        }
        assert!(most < 1e-3, "turned to and fro by {most} at a yaw of {yaw}");
    }
}

/// A cylinder on its side, which rolls along y, on a slab.
fn rolling(model: &Arc<ObjectModel>, mass_kg: f64, speed: f64) -> World {
    let on_side = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), std::f64::consts::FRAC_PI_2);
    let pose = Isometry3::from_parts(
        nalgebra::Translation3::new(-0.1, -0.8, 0.1 + model.size_m[0] / 2.0),
        on_side,
    );
    let slab = object(
        "slab",
        block([0.6, 2.0, 0.1]),
        Role::Platform,
        Pose::IDENTITY,
        1.0,
        0.5,
    );
    let mut scene = scene(vec![
        slab,
        object(
            "a",
            Arc::clone(model),
            Role::Target,
            Pose::from_isometry(&pose),
            mass_kg,
            0.5,
        ),
    ]);
    scene.physics.iterations = 4;
    let mut world = build(&scene).expect("the scene is right");
    let hold = world.hold();
    (0..30).for_each(|_| world.step(&hold));
    assert!(world.poison("a", Poison::Velocity([0.0, speed, 0.0])));
    world
}

fn cylinder(radius: f64, height: f64) -> Arc<ObjectModel> {
    let pose = Pose::upright([0.0, 0.0, height / 2.0], 0.0);
    Arc::new(ObjectModel {
        parts: vec![Part {
            pose,
            shape: Shape::Cylinder { radius, height },
        }],
        ..Arc::unwrap_or_clone(block([2.0 * radius, 2.0 * radius, height]))
    })
}

/// The deceleration of a rolling solid cylinder is c·g / 1.5 with c = lever / radius, its distance
/// 1.5·v² / (2·c·g).
#[test]
fn a_rolling_cylinder_stops_after_its_stopping_distance() {
    for (radius, mass_kg, speed) in [(0.035, 0.3, 0.25), (0.035, 1.0, 0.25), (0.05, 0.3, 0.3)] {
        let mut world = rolling(&cylinder(radius, 0.2), mass_kg, speed);
        let hold = world.hold();
        // It slides at first, until it rolls.
        (0..12).for_each(|_| world.step(&hold));
        let start = body(&world, "a");
        let rolls = start.linear_velocity[1];
        let turns = nalgebra::Vector3::from(start.angular_velocity).norm();
        assert!(
            (rolls / (turns * radius) - 1.0).abs() < 0.02,
            "{rolls} m/s and {turns} rad/s"
        );
        (0..60 * 6).for_each(|_| world.step(&hold));
        let end = body(&world, "a");
        let way = end.pose.position[1] - start.pose.position[1];
        let expected = 1.5 * rolls * rolls / (2.0 * ROLLING_LEVER_M / radius * GRAVITY);
        assert!(
            (way / expected - 1.0).abs() < 0.08,
            "{radius} m, {mass_kg} kg: rolled {way} m instead of {expected} m"
        );
        assert!(
            nalgebra::Vector3::from(end.linear_velocity).norm() < 1e-3,
            "{:?}",
            end.linear_velocity
        );
    }
}

/// Bottles and cans that lie on their sides come to rest, as things on a table do.
#[test]
fn cans_and_bottles_that_roll_come_to_rest() {
    for name in ["bottle", "can"] {
        let model = shipped(name);
        for speed in [0.05, 0.15] {
            let mut world = rolling(&model, model.mass_kg, speed);
            let hold = world.hold();
            (0..60 * 6).for_each(|_| world.step(&hold));
            let before = body(&world, "a").pose;
            (0..60).for_each(|_| world.step(&hold));
            let after = body(&world, "a").pose;
            let way = (Vector3::from(after.position) - Vector3::from(before.position)).norm();
            assert!(
                way < 1e-4,
                "{name} at {speed} m/s still moves {way} m in a second"
            );
        }
    }
}
