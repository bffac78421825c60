//! Hollow objects: closed while nothing is at their mouth, and open for things that fall in.

use std::sync::Arc;

use actcheck::actions::perform;
use actcheck::data::{Budget, Choices, Pose, Role};
use actcheck::world::{GRAVITY, Poison, Shortcuts, World, build};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::physics::{block, body, call, object, on_table, scene, shipped};

const BOTH: [Shortcuts; 2] = [Shortcuts::NONE, Shortcuts::ALL];
/// Friction of the floor.
const FLOOR_FRICTION: f64 = 0.5;

/// Returns the shipped model as `thing_1` at a pose, with other objects, and a robot that is far
/// away.
fn with_thing(
    name: &str,
    at: Pose,
    others: Vec<actcheck::data::SceneObject>,
    shortcuts: Shortcuts,
) -> World {
    let model = shipped(name);
    let (mass_kg, friction) = (model.mass_kg, model.friction);
    let mut objects = vec![object("thing_1", model, Role::Other, at, mass_kg, friction)];
    objects.extend(others);
    let mut world = build(&scene(objects)).expect("the scene is right");
    world.take_shortcuts(shortcuts);
    world
}

/// Keeps the robot still for some time.
fn wait(world: &mut World, secs: f64) {
    let command = world.hold();
    let start = world.time_secs();
    while world.time_secs() - start < secs {
        world.step(&command);
    }
}

#[test]
fn a_glass_at_rest_is_closed_and_in_the_pose_of_an_open_one() {
    for name in ["glass", "mug"] {
        let mut poses = Vec::new();
        for shortcuts in BOTH {
            let mut world = with_thing(
                name,
                Pose::upright([0.0, 0.0, 0.001], 0.3),
                Vec::new(),
                shortcuts,
            );
            assert!(world.settle().settled);
            assert_eq!(
                world.engine().is_closed("thing_1"),
                shortcuts == Shortcuts::ALL,
                "{name}"
            );
            poses.push(body(&world, "thing_1").pose.to_isometry());
        }
        let off = poses[0].inverse() * poses[1];
        assert!(
            off.translation.vector.norm() < 3e-4,
            "{name} is {} off",
            off.translation.vector
        );
        assert!(
            off.rotation.angle() < 5e-3,
            "{name} is tilted by {}",
            off.rotation.angle()
        );
    }
}

#[test]
fn bowls_and_plates_stay_open() {
    for name in ["bowl", "plate"] {
        let mut world = with_thing(
            name,
            Pose::upright([0.0, 0.0, 0.001], 0.0),
            Vec::new(),
            Shortcuts::ALL,
        );
        assert!(world.settle().settled);
        assert!(!world.engine().is_closed("thing_1"), "{name}");
    }
}

#[test]
fn a_glass_slides_as_far_as_friction_lets_it() {
    let glass = shipped("glass");
    let friction = (glass.friction * FLOOR_FRICTION).sqrt();
    let speed = 0.8;
    let expected = speed * speed / (2.0 * friction * GRAVITY);
    for shortcuts in BOTH {
        let mut world = with_thing(
            "glass",
            Pose::upright([0.0, 0.0, 0.0], 0.0),
            Vec::new(),
            shortcuts,
        );
        assert!(world.settle().settled);
        let before = body(&world, "thing_1").pose.position;
        world.poison("thing_1", Poison::Velocity([speed, 0.0, 0.0]));
        wait(&mut world, 1.0);
        let after = body(&world, "thing_1").pose.position;
        let way = after[0] - before[0];
        assert!(
            (way / expected - 1.0).abs() < 0.06,
            "{way} instead of {expected}"
        );
    }
}

/// The largest tilt about a direction from which a glass returns, in degrees.
fn largest_tilt(shortcuts: Shortcuts, towards: f64) -> u32 {
    let radius = 0.04;
    let returns = |degrees: &u32| {
        let tilt = f64::from(*degrees).to_radians();
        let axis = Vector3::new(-towards.sin(), towards.cos(), 0.0);
        let turn = UnitQuaternion::from_axis_angle(&nalgebra::Unit::new_normalize(axis), tilt);
        // The lowest point of its rim touches the floor.
        let at = Isometry3::from_parts(Translation3::new(0.0, 0.0, radius * tilt.sin()), turn);
        let mut world = with_thing("glass", Pose::from_isometry(&at), Vec::new(), shortcuts);
        wait(&mut world, 2.0);
        let up = body(&world, "thing_1").pose.to_isometry() * Vector3::z();
        up.z > 0.99
    };
    (10..50)
        .take_while(|degrees| returns(degrees))
        .last()
        .expect("it returns from 10 degrees")
}

#[test]
fn a_closed_glass_tips_over_at_the_tilt_of_an_open_one() {
    for towards in [0.0, 0.13, 0.26] {
        let [open, closed] = BOTH.map(|shortcuts| largest_tilt(shortcuts, towards));
        assert!(
            open.abs_diff(closed) <= 1,
            "{closed}° instead of {open}° towards {towards}"
        );
    }
}

#[test]
fn things_fall_into_a_closed_glass_and_it_opens_before() {
    // After a second, the glass is asleep.
    for (height, secs) in [(0.2, 0.2), (0.6, 0.2), (0.2, 1.0), (0.8, 1.0)] {
        let dropped = object(
            "cube_1",
            block([0.02; 3]),
            Role::Other,
            Pose::upright([0.5, 0.0, 0.0], 0.0),
            0.01,
            0.5,
        );
        let mut world = with_thing(
            "glass",
            Pose::upright([0.0, 0.0, 0.0], 0.0),
            vec![dropped],
            Shortcuts::ALL,
        );
        wait(&mut world, secs);
        assert!(world.engine().is_closed("thing_1"));
        world.poison("cube_1", Poison::Teleport([0.005, 0.0, 0.146 + height]));
        world.poison("cube_1", Poison::Velocity([0.0; 3]));
        let (command, start) = (world.hold(), world.time_secs());
        while world.time_secs() - start < 1.0 {
            world.step(&command);
            let is_near = body(&world, "cube_1").pose.position[2] < 0.155;
            assert!(
                !(is_near && world.engine().is_closed("thing_1")),
                "closed with the cube at its mouth"
            );
        }
        assert_eq!(world.fault(), None);
        let cube = body(&world, "cube_1").pose.position;
        assert!(
            cube[2] < 0.06 && cube[0].hypot(cube[1]) < 0.04,
            "the cube is at {cube:?}"
        );
        assert!(
            !world.engine().is_closed("thing_1"),
            "with something inside"
        );
    }
}

#[test]
fn a_lying_glass_rests_at_the_height_of_an_open_one() {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), std::f64::consts::FRAC_PI_2);
    let at = Isometry3::from_parts(Translation3::new(0.0, 0.0, 0.046), turn);
    let mut found = Vec::new();
    for shortcuts in BOTH {
        let mut world = with_thing("glass", Pose::from_isometry(&at), Vec::new(), shortcuts);
        wait(&mut world, 1.0);
        let up = body(&world, "thing_1").pose.to_isometry() * Vector3::z();
        assert!(up.z.abs() < 0.1, "it lies");
        found.push(body(&world, "thing_1").pose.position[2]);
    }
    assert!((found[0] - found[1]).abs() < 1e-3, "{found:?}");
}

/// The engine keeps the impulses of points that it no longer solves.
#[test]
fn fingers_press_a_thing_with_the_force_of_their_motors() {
    for name in ["can", "glass", "bottle"] {
        let model = shipped(name);
        let mut world =
            build(&on_table(Arc::clone(&model), model.mass_kg, 0.9)).expect("the scene is right");
        assert!(world.settle().settled);
        let trace = perform(
            &[call("Pick")],
            &mut world,
            &mut Choices::random(1, 0),
            &Budget { action_secs: 60.0 },
        );
        let report = trace.actions[0].report.as_ref().expect("the skill reports");
        assert!(report.succeeded, "{name}: {}", report.message);
        let mut hold = world.hold();
        hold.gripper_opening_m = 0.0;
        (0..120).for_each(|_| world.step(&hold));
        world.begin_record();
        (0..120).for_each(|_| world.step(&hold));
        let record = world.end_record();
        let grip = world
            .observe()
            .finger_efforts_n
            .iter()
            .fold(0.0_f64, |most, effort| most.max(effort.abs()));
        let of_fingers: Vec<f64> = record
            .contacts
            .iter()
            .filter(|contact| {
                contact
                    .pair
                    .iter()
                    .any(|name| name.starts_with("robot/finger"))
            })
            .map(|contact| contact.max_force_n)
            .collect();
        assert_eq!(of_fingers.len(), 2, "{name}");
        for force in of_fingers {
            assert!(
                (0.9..1.5).contains(&(force / grip)),
                "{name}: {force} N with {grip} N of the motor"
            );
        }
    }
}
