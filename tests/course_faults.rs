//! Faults of the course: in a run made by hand, every shipped property about time notices its
//! fault.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;

use actcheck::base::{Outcome, names};
use actcheck::campaign::Env;
use actcheck::campaign::oracles::{COURSE_FAULTS, CourseFault};
use actcheck::config::Overrides;
use actcheck::data::{
    ActionEnd, ActionTrace, BodyState, Pose, RobotCourse, RobotState, Samples, Series, Snapshot,
    Trace,
};
use actcheck::facts::extract;
use actcheck::rules::Budget;

use crate::support::root;

/// Samples of each action: six seconds.
const COUNT: usize = 361;
const TABLE_TOP_M: f64 = 0.75;
const REST_M: f64 = TABLE_TOP_M;
const LIFTED_M: f64 = 1.0;

/// From 0 to 1 between two times, smoothly.
fn between(secs: f64, from: f64, to: f64) -> f64 {
    (1.0 - (PI * ((secs - from) / (to - from)).clamp(0.0, 1.0)).cos()) / 2.0
}

/// One action: its motions, as functions of the seconds since it began.
struct Act {
    name: &'static str,
    base_x: fn(f64) -> f64,
    hand_z: fn(f64) -> f64,
    object_z: fn(f64) -> f64,
    held: fn(f64) -> bool,
}

const ACTS: [Act; 3] = [
    Act {
        name: "MoveTo",
        base_x: |secs| between(secs, 0.5, 5.0) - 1.0,
        hand_z: |_| 1.2,
        object_z: |_| REST_M,
        held: |_| false,
    },
    Act {
        name: "Pick",
        base_x: |_| 0.0,
        hand_z: |secs| {
            1.2 - 0.4 * between(secs, 0.0, 3.0) + (LIFTED_M - REST_M) * between(secs, 3.5, 5.0)
        },
        object_z: |secs| REST_M + (LIFTED_M - REST_M) * between(secs, 3.5, 5.0),
        held: |secs| secs > 3.2,
    },
    Act {
        name: "Place",
        base_x: |_| 0.0,
        hand_z: |secs| {
            LIFTED_M - (LIFTED_M - REST_M) * between(secs, 1.0, 2.5) + 0.3 * between(secs, 3.2, 4.5)
        },
        object_z: |secs| LIFTED_M - (LIFTED_M - REST_M) * between(secs, 1.0, 2.5),
        held: |secs| secs < 3.0,
    },
];

fn samples(act: &Act) -> Samples {
    let mut series = Vec::new();
    let period = 1.0 / 60.0;
    let mut put = |thing: &str, other: &str, quantity: &str, value: &dyn Fn(f64) -> f64| {
        let mut one = Series::new(thing, other, quantity, 10_000);
        one.steps = (0..COUNT)
            .map(|idx| Series::steps_of(value(idx as f64 * period), 10_000))
            .collect();
        series.push(one);
    };
    let rate =
        |of: fn(f64) -> f64| move |secs: f64| (of(secs) - of((secs - 1.0 / 60.0).max(0.0))) * 60.0;
    for (thing, z) in [("glass_1", act.object_z), ("gripper", act.hand_z)] {
        put(thing, "", "x", &|_| 0.6);
        put(thing, "", "z", &z);
        put(thing, "", "qw", &|_| 1.0);
        ["y", "qx", "qy", "qz"]
            .into_iter()
            .for_each(|quantity| put(thing, "", quantity, &|_| 0.0));
    }
    ["vx", "vy", "wx", "wy", "wz"]
        .into_iter()
        .for_each(|quantity| put("glass_1", "", quantity, &|_| 0.0));
    put("glass_1", "", "vz", &rate(act.object_z));
    put("glass_1", "", "held", &|secs| {
        f64::from(u8::from((act.held)(secs)))
    });
    ["baseX", "believedX"]
        .into_iter()
        .for_each(|quantity| put("robot", "", quantity, &act.base_x));
    let still = ["baseY", "baseYaw", "believedY", "believedYaw"];
    still
        .into_iter()
        .for_each(|quantity| put("robot", "", quantity, &|_| 0.0));
    for finger in ["robot/left_finger", "robot/right_finger"] {
        put("glass_1", finger, "contactForce", &|secs| {
            if (act.held)(secs) { 12.0 } else { 0.0 }
        });
    }
    Samples {
        period_secs: period,
        count: COUNT,
        series,
    }
}

/// A body without a shape: a box whose origin is at the centre of its base.
fn body(id: &str, category: &str, fixed: bool, foot_m: [f64; 3], size_m: [f64; 3]) -> BodyState {
    let middle_m = [foot_m[0], foot_m[1], foot_m[2] + size_m[2] / 2.0];
    let corner = |sign: f64| [0, 1, 2].map(|axis| middle_m[axis] + sign * size_m[axis] / 2.0);
    BodyState {
        id: id.to_owned(),
        model: id.to_owned(),
        category: names::act(category),
        fixed,
        pose: Pose {
            position: foot_m,
            rotation: [0.0, 0.0, 0.0, 1.0],
        },
        linear_velocity: [0.0; 3],
        angular_velocity: [0.0; 3],
        aabb_min: corner(-1.0),
        aabb_max: corner(1.0),
        mass_kg: 0.2,
        friction: 0.5,
        restitution: 0.0,
        touches: Vec::new(),
        rests_on: Vec::new(),
        asleep: false,
        size_m,
        grasp_distance_m: None,
        part: None,
        left_world: false,
    }
}

/// The state before an action, or after the last one.
fn snapshot(act: &Act, secs: f64) -> Snapshot {
    let base = [(act.base_x)(secs), 0.0, 0.0];
    let touches = if (act.held)(secs) {
        vec!["glass_1".to_owned()]
    } else {
        Vec::new()
    };
    Snapshot {
        time_secs: secs,
        bodies: vec![
            body(
                "table_1",
                "Table",
                true,
                [0.6, 0.0, 0.0],
                [0.8, 0.8, TABLE_TOP_M],
            ),
            body(
                "glass_1",
                "Glass",
                false,
                [0.6, 0.0, (act.object_z)(secs)],
                [0.07, 0.07, 0.1],
            ),
        ],
        robot: RobotState {
            base_true: base,
            base_believed: base,
            joints: Vec::new(),
            gripper: Pose {
                position: [0.6, 0.0, (act.hand_z)(secs)],
                rotation: [0.0, 0.0, 0.0, 1.0],
            },
            gripper_opening_m: 0.08,
            left_touches: touches.clone(),
            right_touches: touches,
            links: Vec::new(),
            cup: None,
        },
    }
}

/// A robot that drives a metre, lifts a glass, and puts it down again.
fn run() -> Trace {
    let parameters = BTreeMap::from(
        [("pickObject", "glass_1"), ("placeSurface", "table_1")]
            .map(|(name, id)| (name.to_owned(), vec![id.to_owned()])),
    );
    let action = |act: &Act| ActionTrace {
        end: ActionEnd::Completed,
        duration_secs: 6.0,
        ..ActionTrace::not_reached(act.name, &parameters)
    };
    let course = |act: &Act| RobotCourse {
        samples: samples(act),
        ..RobotCourse::default()
    };
    let [.., last] = &ACTS;
    Trace {
        snapshots: ACTS
            .iter()
            .map(|act| snapshot(act, 0.0))
            .chain([snapshot(last, 6.0)])
            .collect(),
        actions: ACTS.iter().map(action).collect(),
        robot_courses: ACTS.iter().map(course).collect(),
        ..Trace::default()
    }
}

fn env() -> Env {
    let text = std::fs::read_to_string(root().join("configs/pick_and_place.toml")).unwrap();
    let text = text.replace("../ontology/actions.ttl", "../ontology/time.ttl");
    let source = actcheck::base::Source::new("configs/time.toml", text.as_str());
    Env::prepare_text(source, &root().join("configs"), &Overrides::default()).unwrap()
}

/// The properties of time.ttl with their outcomes; the worst one if several actions have the
/// property.
fn judged(env: &Env, trace: &Trace) -> BTreeMap<String, Outcome> {
    let shipped = std::fs::read_to_string(root().join("ontology/time.ttl")).unwrap();
    let facts = extract(trace);
    let mut outcomes = BTreeMap::new();
    for (step, performed) in trace.actions.iter().enumerate() {
        let of_time =
            |iri: &&String| shipped.contains(&format!("act:{} a act:Property", names::local(iri)));
        let asked: Vec<String> = env.ontology.actions[&performed.action]
            .success_properties
            .iter()
            .filter(of_time)
            .cloned()
            .collect();
        for (iri, found) in
            env.rules
                .judge(&facts.action(step).unwrap(), &asked, &Budget::default())
        {
            let outcome = found
                .unwrap_or_else(|fault| panic!("{iri}: {fault:?}"))
                .outcome();
            let known = outcomes
                .entry(names::local(&iri).to_owned())
                .or_insert(outcome);
            if *known != Outcome::Failed && outcome != Outcome::Inapplicable {
                *known = outcome;
            }
        }
    }
    outcomes
}

/// The properties that pass without the fault and fail with it.
fn noticing(env: &Env, fault: &CourseFault) -> BTreeSet<String> {
    let (sound, mut faulty) = (run(), run());
    assert!(
        fault.put_into(&mut faulty),
        "{} needs a moment that the run does not have",
        fault.name
    );
    let without = judged(env, &sound);
    let with = judged(env, &faulty);
    let names = with
        .into_iter()
        .filter(|(name, outcome)| *outcome == Outcome::Failed && without[name] == Outcome::Passed);
    names.map(|(name, _)| name).collect()
}

/// The property that each fault is made for. Others may notice it, too.
const OWN: [(&str, &str); 21] = [
    ("fast-approach", "SlowApproach"),
    ("dragged", "LiftedBeforeCarried"),
    ("tipped", "UprightWhenLifted"),
    ("dropped", "HeldWhileLifted"),
    ("grasped-twice", "OneGrasp"),
    ("jerked", "SmoothCarrying"),
    ("swung", "NoSpilling"),
    ("squeezed", "NoLastingForce"),
    ("slipping", "SlipRecovers"),
    ("swings-at-the-end", "StillAtTheEnd"),
    ("hand-detour", "ShortPath"),
    ("shaking", "SmoothHand"),
    ("person-near", "ClearOfTallThings"),
    ("belief-jumps", "LocalisedThroughout"),
    ("base-jerked", "SmoothDrive"),
    ("base-detour", "ShortDrive"),
    ("nothing-moves", "HeldUntilAboveSurface"),
    ("dropped-from-high", "HeldUntilAboveSurface"),
    ("thrown", "StillWhenReleased"),
    ("rocking", "SettlesAfterRelease"),
    ("touched-again", "NoSecondTouch"),
];

#[test]
fn every_property_about_time_notices_its_fault() {
    let env = env();
    let sound = judged(&env, &run());
    assert_eq!(sound.len(), 20, "{sound:?}");
    assert!(
        sound.values().all(|outcome| *outcome == Outcome::Passed),
        "{sound:?}"
    );
    let noticed: Vec<(&str, BTreeSet<String>)> = COURSE_FAULTS
        .iter()
        .map(|fault| (fault.name, noticing(&env, fault)))
        .collect();
    let table: String = noticed
        .iter()
        .map(|(fault, by)| format!("{fault}: {by:?}\n"))
        .collect();
    println!("{table}");
    assert_eq!(
        noticed.iter().map(|(fault, _)| *fault).collect::<Vec<_>>(),
        OWN.map(|(fault, _)| fault)
    );
    for ((fault, by), (_, own)) in noticed.iter().zip(OWN) {
        assert!(by.contains(own), "{own} does not notice {fault}\n{table}");
    }
    let all: BTreeSet<&String> = noticed.iter().flat_map(|(_, by)| by).collect();
    assert_eq!(all.len(), 20, "{table}");
}

/// A robot that does nothing passes no property that requires something of the course.
#[test]
fn a_robot_that_does_nothing_passes_no_success_about_time() {
    let env = env();
    let mut idle = run();
    let still = COURSE_FAULTS
        .iter()
        .find(|fault| fault.name == "nothing-moves")
        .unwrap();
    assert!(still.put_into(&mut idle));
    let outcomes = judged(&env, &idle);
    let folder = root().join("rules/time");
    let rules = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| std::fs::read_to_string(entry.unwrap().path()).unwrap());
    let required = rules
        .filter(|text| text.lines().any(|line| line.starts_with("success(")))
        .count();
    assert_eq!(
        (required, outcomes["HeldUntilAboveSurface"]),
        (1, Outcome::Failed)
    );
}
