//! Perception with the depth camera, from scenes to verdicts; the robot acts on its percepts alone.

use actcheck::base::Outcome;
use actcheck::campaign::Env;
use actcheck::data::{Choice, ChoiceName, Choices, PerceivedThing, Pose};
use actcheck::history::RunRecord;
use actcheck::world::{Poison, World};

use crate::support::line::{env_of, nominal, outcomes, report, run};

/// A table with a glass on it, and further configuration text from the test.
fn env(actions: &str, more: &str) -> Env {
    env_of(&format!(
        "tests = [{actions}]\ntest_count = 1\nseed = 5\n[objectSurface]\nobject_surfaces = [\"coffee_table\"]\n\
        [pickObject]\nmodel_list = [\"glass\"]\n{more}"
    ))
}

fn things(run: &RunRecord) -> &[PerceivedThing] {
    &run.trace.actions[0]
        .perceived
        .as_ref()
        .expect("it looked")
        .things
}

fn off(seen: &Pose, x: f64, y: f64) -> f64 {
    (seen.position[0] - x).hypot(seen.position[1] - y)
}

const OTHERS: &str = "[surfaceObjects]\nmodel_list = [\"mug\", \"can\", \"box\"]\ncount = 3\n";

#[test]
fn without_noise_a_table_and_its_objects_are_seen_exactly() {
    let env = env("[\"PerceivePlane\"]", OTHERS);
    let run = nominal(&env, None);
    let perceived = run.trace.actions[0].perceived.as_ref().unwrap();
    let plane = perceived.plane.unwrap();
    assert!(
        off(&plane.pose, 0.0, 0.0) < 0.01 && (plane.pose.position[2] - 0.705).abs() < 0.002,
        "{plane:?}"
    );
    // At the far edge, pixels are 1.5 cm apart.
    assert!(
        plane.pose.tilt() < 0.01 && plane.size_m.iter().all(|side| (side - 0.62).abs() < 0.015),
        "{plane:?}"
    );
    // Nominally all others are mugs, on a ring around the glass. The first is right behind it,
    // hidden from the camera.
    for object in run
        .scene
        .objects
        .iter()
        .skip(1)
        .filter(|object| object.id != "mug_1")
    {
        let [x, y, _] = object.pose.position;
        let seen = things(&run)
            .iter()
            .find(|thing| off(&thing.pose, x, y) < 0.02);
        let seen = seen.unwrap_or_else(|| panic!("{} was not seen: {:?}", object.id, things(&run)));
        assert_eq!(
            seen.category.as_ref(),
            Some(&object.category),
            "{} seen as {seen:?}",
            object.id
        );
        let bodies = &run.trace.snapshots[0].bodies;
        let body = bodies.iter().find(|body| body.id == object.id).unwrap();
        for (seen, known) in seen.size_m.iter().zip(body.size_m) {
            assert!(
                (seen - known).abs() < 0.01,
                "{}: {seen} for {known}",
                object.id
            );
        }
    }
    assert_eq!(things(&run).len(), 3);
    assert!(
        report(&run, 0)
            .message
            .ends_with("and on it 1 Glass, 2 Mug"),
        "{}",
        report(&run, 0).message
    );
    assert_eq!(
        (
            outcomes(&run, 0)["PlaneReported"],
            outcomes(&run, 0)["PlaneFound"]
        ),
        (Outcome::Passed, Outcome::Passed)
    );
    let missed = run.judgements[0]
        .iter()
        .find(|judgement| judgement.outcome == Outcome::Failed)
        .unwrap();
    assert!(
        missed.witness.contains("mug_1 was not perceived"),
        "{}",
        missed.witness
    );
}

#[test]
fn a_perceived_object_is_picked() {
    let env = env("[\"PerceivePlane\", \"Pick\"]", "");
    let run = nominal(&env, None);
    assert_eq!(outcomes(&run, 1).len(), 5);
    assert!(
        outcomes(&run, 1)
            .values()
            .all(|outcome| *outcome == Outcome::Passed),
        "{:?}",
        run.judgements
    );
    // Once as perceived, and once more with the hand before it.
    let [first, again] = run.trace.actions[1].percepts.as_slice() else {
        panic!("one thing was requested")
    };
    assert_eq!(
        (first.id.as_str(), first.pose),
        ("glass_1", things(&run)[0].pose)
    );
    assert_eq!(again.id, "glass_1");
    assert!(
        off(&again.pose, first.pose.position[0], first.pose.position[1]) < 0.015,
        "{again:?} after {first:?}"
    );
}

/// Sensors see the glass displaced.
fn deceive(_: u64, world: &mut World) {
    assert!(world.poison(
        "glass_1",
        Poison::Decoy(Pose::upright([-0.1, 0.15, 0.705], 0.0))
    ));
}

#[test]
fn skills_act_on_percepts_not_on_the_truth() {
    let env = env("[\"PerceivePlane\", \"Pick\"], [\"Pick\"]", "");
    let run = nominal(&env, Some(deceive));
    let [seen] = things(&run) else {
        panic!("one glass must be seen: {:?}", things(&run))
    };
    assert!(off(&seen.pose, -0.1, 0.15) < 0.01, "{seen:?}");
    assert_eq!(outcomes(&run, 0)["ObjectsDetected"], Outcome::Failed);
    assert_eq!(outcomes(&run, 0)["PlaneFound"], Outcome::Passed);
    // The hand closes at the perceived glass; the true glass does not move.
    assert!(!report(&run, 1).succeeded, "{}", report(&run, 1).message);
    assert!(
        report(&run, 1).message.contains("fingers"),
        "{}",
        report(&run, 1).message
    );
    let glass = run.trace.snapshots[2]
        .bodies
        .iter()
        .find(|body| body.id == "glass_1")
        .unwrap();
    assert!(off(&glass.pose, 0.0, 0.0) < 0.005, "{:?}", glass.pose);
    let reached = run
        .trace
        .frames
        .names
        .iter()
        .position(|name| name == "robot/wrist_roll_link")
        .unwrap();
    let nearest = run.trace.frames.rows.iter().map(|row| {
        let at = &row[7 * reached..];
        (f64::from(at[0]) + 0.1).hypot(f64::from(at[1]) - 0.15)
    });
    assert!(
        nearest.fold(f64::INFINITY, f64::min) < 0.25,
        "the hand never went to the perceived glass"
    );
}

#[test]
fn without_a_look_around_the_abstract_detector_is_deceived_too() {
    let env = env("[\"Pick\"]", "");
    let run = nominal(&env, Some(deceive));
    assert_eq!(off(&run.trace.actions[0].percepts[0].pose, -0.1, 0.15), 0.0);
    assert!(!report(&run, 0).succeeded);
}

#[test]
fn an_unperceived_object_is_not_picked() {
    // Every pixel is lost except in the nominal picture.
    let env = env("[\"PerceivePlane\", \"Pick\"]", "[camera]\ndropout = 1\n");
    let run = run(&env, Choices::random(1, 0), None);
    assert_eq!(report(&run, 0).message, "no level surface was found");
    assert_eq!(
        report(&run, 1).message,
        "no perceived object matches glass_1"
    );
    assert!(
        outcomes(&run, 0)
            .values()
            .all(|outcome| *outcome == Outcome::Failed),
        "{:?}",
        run.judgements
    );
    assert_eq!(outcomes(&run, 1)["MovedObject"], Outcome::Failed);
}

#[test]
fn the_same_choices_give_the_same_pictures_and_percepts() {
    let noise = "[camera]\nrange_noise_m = 0.003\ndropout = 0.05\ngrazing_rad = 0.15\n";
    let env = env("[\"PerceivePlane\"]", &format!("{OTHERS}{noise}"));
    let first = run(&env, Choices::random(3, 0), None);
    let again = run(&env, Choices::recorded(&first.choices), None);
    assert_eq!(first.trace, again.trace);
    // One choice for each picture; without it the picture has no noise.
    let frames: Vec<&Choice> = first
        .choices
        .iter()
        .filter(|choice| choice.name == ChoiceName::CameraFrame)
        .collect();
    let looks = first.trace.actions[0]
        .phases
        .iter()
        .filter(|phase| phase.name.starts_with("look"))
        .count();
    assert_eq!(frames.len(), looks);
    let rest: Vec<Choice> = first
        .choices
        .iter()
        .filter(|choice| choice.name != ChoiceName::CameraFrame)
        .cloned()
        .collect();
    let clean = run(&env, Choices::recorded(&rest), None);
    assert_ne!(
        first.trace.actions[0].perceived,
        clean.trace.actions[0].perceived
    );
}
