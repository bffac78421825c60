//! Objects that leave the world: by the robot's doing, or by a fault of the simulation.

use actcheck::data::{BodyState, Pose, Role, Snapshot};
use actcheck::world::{Poison, World, build};

use crate::physics::{block, object, scene};

/// A light sledge that the hand touches, on a floor of ice, with a second one beside it and a third
/// one away from both.
fn sledges() -> World {
    let sledge = |id: &str, at: [f64; 2]| {
        object(
            id,
            block([0.1, 0.1, 0.1]),
            Role::Other,
            Pose::upright([at[0], at[1], 0.0], 0.0),
            0.2,
            1e-5,
        )
    };
    let mut scene = scene(vec![
        sledge("near_1", [0.28, 0.0]),
        sledge("next_1", [0.385, 0.0]),
        sledge("away_1", [0.3, 1.0]),
    ]);
    scene.robot.base = [0.0, 0.0, 0.0];
    let mut world = build(&scene).expect("the scene is valid");
    assert!(world.settle().settled);
    world.begin_record();
    world
}

/// Drives the base forwards against the sledges, then back.
fn push(world: &mut World) {
    let [x, ..] = world.layout().base.expect("it has a base");
    for by_m in [0.06, -0.06] {
        let mut command = world.hold();
        let start = command.positions[x];
        for idx in 1..=60 {
            command.positions[x] = start + by_m * f64::from(idx) / 60.0;
            world.step(&command);
        }
    }
}

fn wait(world: &mut World, secs: f64) {
    let (command, until) = (world.hold(), world.time_secs() + secs);
    while world.time_secs() < until && world.fault().is_none() {
        world.step(&command);
    }
}

fn state(snapshot: &Snapshot, id: &str) -> BodyState {
    snapshot
        .bodies
        .iter()
        .find(|body| body.id == id)
        .expect("it is in the scene")
        .clone()
}

/// The bottle that an arm swept off a table left the world, and its run was broken.
#[test]
fn an_object_that_the_robot_flings_away_stays_where_it_left_and_the_run_goes_on() {
    let mut world = sledges();
    push(&mut world);
    assert!(!state(&world.snapshot(), "near_1").left_world);
    assert!(world.poison("near_1", Poison::Velocity([0.0, 7.0, 0.0])));
    wait(&mut world, 3.0);
    assert_eq!(world.fault(), None);
    let left = state(&world.snapshot(), "near_1");
    assert!(left.left_world && left.asleep, "{left:?}");
    assert_eq!(
        (left.linear_velocity, left.touches, left.rests_on),
        ([0.0; 3], vec![], vec![])
    );
    let [x, y, _] = left.pose.position;
    assert!(
        (14.0..14.2).contains(&x.hypot(y)),
        "{:?}",
        left.pose.position
    );
    let record = world.end_record();
    let course = record
        .courses
        .iter()
        .find(|course| course.id == "near_1")
        .expect("it has a course");
    assert!(course.max_displacement_m > 13.5, "{course:?}");
    // It stays there, also in the next action.
    world.begin_record();
    push(&mut world);
    assert_eq!(world.fault(), None);
    assert_eq!(state(&world.snapshot(), "near_1").pose, left.pose);
}

/// Objects that a pushed object pushes are the robot's doing too.
#[test]
fn an_object_that_another_one_pushed_is_the_robots_doing() {
    let mut world = sledges();
    push(&mut world);
    let touched_it = world
        .end_record()
        .contacts
        .into_iter()
        .any(|contact| contact.pair == ["near_1", "next_1"]);
    assert!(touched_it, "the first sledge met the second one");
    world.begin_record();
    assert!(world.poison("next_1", Poison::Velocity([0.0, 7.0, 0.0])));
    wait(&mut world, 3.0);
    assert_eq!(world.fault(), None);
    assert!(state(&world.snapshot(), "next_1").left_world);
}

#[test]
fn everything_else_that_leaves_the_world_is_a_fault() {
    let leave: [(&str, &str, Poison); 6] = [
        (
            "nothing touched it",
            "away_1",
            Poison::Velocity([0.0, 7.0, 0.0]),
        ),
        (
            "too fast for a push",
            "near_1",
            Poison::Velocity([0.0, 30.0, 0.0]),
        ),
        ("a jump", "near_1", Poison::Teleport([0.0, 14.5, 0.05])),
        (
            "a jump within the world",
            "near_1",
            Poison::Teleport([0.0, 9.0, 0.05]),
        ),
        (
            "through the floor",
            "near_1",
            Poison::Teleport([0.3, 0.5, -0.5]),
        ),
        ("into the sky", "near_1", Poison::Velocity([0.0, 0.0, 25.0])),
    ];
    for (why, id, poison) in leave {
        let mut world = sledges();
        push(&mut world);
        assert!(world.poison(id, poison));
        world.step(&world.hold());
        if why == "a jump within the world" {
            assert!(world.poison(id, Poison::Velocity([0.0, 7.0, 0.0])));
        }
        wait(&mut world, 3.0);
        let fault = world.fault().map(ToString::to_string).unwrap_or_default();
        assert!(
            fault.starts_with(&format!("{id} left the world at")),
            "{why}: {fault}"
        );
        assert!(!state(&world.snapshot(), id).left_world, "{why}");
    }
}

/// Scenes settle before the robot acts: an object that leaves then was not pushed.
#[test]
fn an_object_that_leaves_before_the_first_action_is_a_fault() {
    let sledge = Pose::upright([0.28, 0.0, 0.0], 0.0);
    let mut scene = scene(vec![object(
        "near_1",
        block([0.1, 0.1, 0.1]),
        Role::Other,
        sledge,
        0.2,
        1e-5,
    )]);
    scene.robot.base = [0.0, 0.0, 0.0];
    let mut world = build(&scene).expect("the scene is valid");
    push(&mut world);
    assert!(world.poison("near_1", Poison::Velocity([0.0, 7.0, 0.0])));
    wait(&mut world, 3.0);
    assert!(
        world
            .fault()
            .is_some_and(|fault| fault.to_string().starts_with("near_1 left the world"))
    );
}
