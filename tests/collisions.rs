//! The robot against furniture and against itself, and the limits of its motors.

use actcheck::data::{Pose, Role};
use actcheck::world::{Contact, GRAVITY, Poison, Shortcuts, World, build};

use crate::physics::{block, object, scene};

/// A world with a robot at the origin and a block of furniture 1 m in front of it.
fn before_furniture(mass_kg: f64, friction: f64) -> World {
    let pose = Pose::upright([1.0, 0.0, 0.0], 0.0);
    let mut scene = scene(vec![object(
        "block_1",
        block([0.6, 0.6, 0.4]),
        Role::Platform,
        pose,
        mass_kg,
        friction,
    )]);
    scene.robot.base = [0.0, 0.0, 0.0];
    build(&scene).expect("the scene is valid")
}

/// Drives the base forwards by this distance at a constant speed. Returns the mean effort of its
/// motor over the last second. Unit: newtons.
fn drive(world: &mut World, by_m: f64, speed: f64) -> f64 {
    let [x, ..] = world.layout().base.expect("it has a base");
    let mut command = world.hold();
    let (start, tick) = (command.positions[x], world.tick_secs());
    let n_ticks = (by_m.abs() / speed / tick) as usize;
    let mut last = Vec::new();
    for idx in 1..=n_ticks {
        command.positions[x] = start + by_m * idx as f64 / n_ticks as f64;
        world.step(&command);
        last.push(world.observe().loads[x]);
    }
    let last = &last[last.len().saturating_sub(60)..];
    last.iter().sum::<f64>() / last.len() as f64
}

fn place_of(world: &World) -> [f64; 3] {
    let snapshot = world.snapshot();
    snapshot
        .bodies
        .iter()
        .find(|body| body.id == "block_1")
        .expect("it is in the scene")
        .pose
        .position
}

#[test]
fn pushed_furniture_slides_and_resists_with_its_friction() {
    let mut world = before_furniture(14.0, 0.5);
    world.begin_record();
    let push_n = drive(&mut world, 0.8, 0.15);
    let friction_n = 14.0 * 0.5 * GRAVITY;
    assert!(
        (push_n / friction_n - 1.0).abs() < 0.1,
        "{push_n} N instead of {friction_n} N"
    );
    let [x, y, z] = place_of(&world);
    // The base has a radius of 21.5 cm, the block a half length of 30 cm.
    assert!((x - (0.8 + 0.215 + 0.3)).abs() < 0.02, "it moved to {x}");
    assert!(
        y.abs() < 0.05 && z.abs() < 1e-3,
        "it slides on the floor: {y} {z}"
    );
    let tracks = world.recorder().tracks();
    assert!(
        tracks.names.contains(&"block_1".to_owned()),
        "furniture that moved has a track"
    );
    drive(&mut world, -0.4, 0.15);
    let left = place_of(&world);
    assert!((left[0] - x).abs() < 5e-3, "it stays where it was left");
    let samples = world.end_record().robot.samples;
    let series = samples
        .series
        .iter()
        .find(|series| (series.thing.as_str(), series.quantity.as_str()) == ("block_1", "x"));
    let course: Vec<f64> = series
        .expect("furniture that can slide has a course")
        .values()
        .collect();
    assert!(
        (course[0] - 1.0).abs() < 1e-3 && (course[course.len() - 1] - left[0]).abs() < 1e-3,
        "{course:?}"
    );
    assert_eq!(world.fault(), None);
}

#[test]
fn furniture_that_is_too_heavy_to_push_stays_in_place() {
    let mut world = before_furniture(400.0, 0.5);
    world.begin_record();
    let push_n = drive(&mut world, 0.8, 0.15);
    // The first hit is harder than friction, but short.
    assert!(
        place_of(&world)[0] < 1.01,
        "it moved to {:?}",
        place_of(&world)
    );
    let limit = world.kinematics().joints()[world.layout().base.expect("it has a base")[0]].effort;
    assert!(
        push_n > 0.9 * limit && push_n <= limit,
        "the motor pushes with its limit: {push_n} N of {limit} N"
    );
    let contacts = world.end_record().contacts;
    let hardest = contacts
        .iter()
        .max_by(|a, b| a.max_force_n.total_cmp(&b.max_force_n))
        .expect("it pushes");
    // The front of the block, in the middle.
    assert!(
        (hardest.point_m[0] - 0.7).abs() < 0.02 && hardest.point_m[1].abs() < 0.05,
        "{:?}",
        hardest.point_m
    );
}

/// A base that was blocked does not exceed its velocity limit when it is free again.
#[test]
fn a_joint_that_was_blocked_keeps_its_velocity_limit_when_it_is_free() {
    let mut world = before_furniture(400.0, 0.5);
    drive(&mut world, 0.9, 0.15);
    assert!(world.poison("block_1", Poison::Teleport([4.0, 0.0, 0.0])));
    let [x, ..] = world.layout().base.expect("it has a base");
    let limit = world.kinematics().joints()[x].velocity;
    let command = world.hold();
    let mut command = command.clone();
    command.positions[x] += 0.3;
    for _ in 0..120 {
        world.step(&command);
        let speed = world.observe().velocities[x].abs();
        assert!(speed < 1.15 * limit, "{speed} m/s, limit {limit} m/s");
    }
}

#[test]
fn fingers_keep_their_velocity_limit_when_the_object_slips_out() {
    let mut scene = scene(vec![object(
        "block_1",
        block([0.04, 0.06, 0.1]),
        Role::Other,
        Pose::IDENTITY,
        0.2,
        0.8,
    )]);
    scene.robot.base = [0.0, 0.0, 0.0];
    let mut world = build(&scene).expect("the scene is valid");
    let mut command = world.hold();
    command.gripper_opening_m = 0.13;
    (0..120).for_each(|_| world.step(&command));
    let grasp = world.snapshot().robot.gripper.position;
    assert!(world.poison(
        "block_1",
        Poison::Teleport([grasp[0], grasp[1], grasp[2] - 0.05])
    ));
    command.gripper_opening_m = 0.0;
    (0..30).for_each(|_| world.step(&command));
    world.begin_record();
    assert!(world.poison("block_1", Poison::Teleport([3.0, 0.0, 0.1])));
    (0..60).for_each(|_| world.step(&command));
    let course = world.end_record().robot;
    for idx in world.layout().gripper.joints().collect::<Vec<_>>() {
        let share = course.joints[idx].max_speed_share;
        assert!(
            share < 1.2,
            "{} moves with {share} of its limit",
            course.joints[idx].name
        );
    }
}

/// The lift can't pass the head above it; its motor presses them together without one entering the
/// other.
#[test]
fn the_arm_does_not_pass_through_the_head() {
    let mut world = before_furniture(400.0, 0.5);
    world.begin_record();
    let lift = world.layout().arm[0];
    let mut command = world.hold();
    command.positions[lift] = world.kinematics().joints()[lift].upper;
    (0..60 * 6).for_each(|_| world.step(&command));
    let reached = world.observe().positions[lift];
    assert!(
        reached < world.kinematics().joints()[lift].upper - 0.05,
        "the head stops it: {reached} m"
    );
    let record = world.end_record();
    let is_of_head = |contact: &Contact| {
        contact.pair.iter().all(|thing| thing.starts_with("robot/"))
            && contact.pair.contains(&"robot/head_tilt_link".to_owned())
    };
    assert!(
        record
            .contacts
            .iter()
            .any(|contact| is_of_head(contact) && contact.max_force_n > 50.0)
    );
    assert!(
        record
            .robot
            .self_contacts
            .iter()
            .all(|contact| contact.max_depth_m < 5e-3),
        "{:?}",
        record.robot
    );
    // Its depth says nothing, its force does.
    let of_head = |pair: &[String; 2]| pair.contains(&"robot/head_tilt_link".to_owned());
    let pressed = record
        .robot
        .self_contacts
        .iter()
        .find(|contact| of_head(&contact.pair));
    let press = pressed.expect("the links met").press;
    assert!(press.max_force_n > 50.0 && !press.of_hand, "{press:?}");
}

/// A hand that closes on nothing: fingers may meet, and are not inside each other.
#[test]
fn fingers_that_meet_do_not_collide() {
    let mut world = before_furniture(400.0, 0.5);
    world.begin_record();
    let mut command = world.hold();
    command.gripper_opening_m = 0.0;
    (0..180).for_each(|_| world.step(&command));
    assert!(
        world.observe().gripper_opening_m < 1e-3,
        "the hand is closed"
    );
    let met = world.end_record().robot.self_contacts;
    assert!(
        met.iter()
            .all(|pair| pair.press.of_hand && pair.max_depth_m < 1e-3),
        "{met:?}"
    );
}

/// A command that is not a number is ignored: no motor gets it as a limit.
#[test]
fn commands_that_are_not_numbers_are_ignored() {
    let mut world = before_furniture(400.0, 0.5);
    world.begin_record();
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut command = world.hold();
        command.positions.fill(value);
        command.gripper_opening_m = value;
        command.grip_force_n = value;
        command.efforts = vec![(world.layout().arm[0], value)];
        (0..20).for_each(|_| world.step(&command));
        assert_eq!(world.fault(), None, "{value}");
        assert!(
            world
                .observe()
                .positions
                .iter()
                .all(|position| position.is_finite()),
            "{value}"
        );
    }
}

/// Every recorded effort is within the limit of its joint, and the targets of the fingers are those
/// of the gap.
#[test]
fn recorded_efforts_and_targets_are_those_of_the_motors() {
    let mut world = before_furniture(400.0, 0.5);
    world.begin_record();
    drive(&mut world, 0.8, 0.15);
    let mut command = world.hold();
    command.gripper_opening_m = 0.02;
    (0..60).for_each(|_| world.step(&command));
    let fingers: Vec<usize> = world.layout().gripper.joints().collect();
    let limits: Vec<f64> = world
        .kinematics()
        .joints()
        .iter()
        .map(|joint| joint.effort)
        .collect();
    let motion = world.end_record().robot.motion;
    let mut most = 0.0f64;
    for moment in motion.moments() {
        for (joint, limit) in moment.joints().zip(&limits) {
            assert!(
                f64::from(joint.effort).abs() <= limit + 1e-2,
                "{} of {limit}",
                joint.effort
            );
            most = most.max(f64::from(joint.effort).abs() / limit);
        }
        for finger in &fingers {
            let target = moment
                .joints()
                .nth(*finger)
                .expect("it has as many joints as the robot")
                .target;
            assert!((target - moment.commanded_opening_m / 2.0).abs() < 1e-4);
        }
    }
    assert!(
        most > 0.99,
        "the blocked base pushes with all its force: {most}"
    );
}

/// Drives against furniture, and returns when it was first touched, with the largest force, and
/// where it stopped.
fn hit(mut world: World) -> (bool, Contact, [f64; 3]) {
    world.begin_record();
    let mut moved_freely = false;
    for _ in 0..4 {
        drive(&mut world, 0.15, 0.2);
        moved_freely |= world.proximity().moved_freely();
    }
    let place = place_of(&world);
    let contacts = world.end_record().contacts;
    let first = contacts
        .into_iter()
        .find(|contact| contact.pair[0] == "block_1" && contact.pair[1] != "floor");
    (moved_freely, first.expect("they touched"), place)
}

#[test]
fn motion_without_the_engine_ends_before_the_first_contact() {
    let fresh = || before_furniture(14.0, 0.5);
    let mut left = fresh();
    left.take_shortcuts(Shortcuts::NONE);
    let (freely, contact, place) = hit(fresh());
    let (never, expected, engine_place) = hit(left);
    assert!(freely && !never);
    assert_eq!(contact.pair, expected.pair);
    assert!(
        (contact.start_secs - expected.start_secs).abs() < 1.5 / 60.0,
        "{contact:?} instead of {expected:?}"
    );
    assert!(
        (contact.max_force_n / expected.max_force_n - 1.0).abs() < 0.1,
        "{contact:?} instead of {expected:?}"
    );
    assert!(
        (place[0] - engine_place[0]).abs() < 2e-3,
        "{place:?} instead of {engine_place:?}"
    );
}
