//! The tables of a dataset with the course of each action at the control rate, from which
//! properties about time can be judged.

use std::collections::BTreeMap;

use crate::dataset::columns::{ColumnSpec, RUN, STEP, TableSpec, bool, number, text};
use crate::dataset::sheets::Sheets;
use crate::tables::Cell;
use actcheck_data::{ActionTrace, Samples, Series, Trace};

const TIME: ColumnSpec = number(
    "time_s",
    "s",
    "time since the action began; one sample in each control tick, the first at its start",
);

/// Poses, velocities and holds of the bodies that can move.
pub(super) const COURSE_BODIES: TableSpec = TableSpec {
    file: "course_bodies.parquet",
    rows: "one for each action, control tick and body that can move; other furniture is at rest where bodies.parquet has it",
    columns: &[
        RUN,
        STEP,
        TIME,
        text("body", "id of the object"),
        number(
            "x_m",
            "m",
            "true position in the world, of the centre of the object's base, to 0.02 mm",
        ),
        number("y_m", "m", "true position in the world"),
        number("z_m", "m", "true position in the world"),
        number("qx", "1", "true rotation, as a unit quaternion"),
        number("qy", "1", "true rotation"),
        number("qz", "1", "true rotation"),
        number("qw", "1", "true rotation"),
        number("vx_m_s", "m/s", "velocity of its origin, to 0.5 mm/s"),
        number("vy_m_s", "m/s", "velocity of its origin"),
        number("vz_m_s", "m/s", "velocity of its origin"),
        number("wx_rad_s", "rad/s", "angular velocity"),
        number("wy_rad_s", "rad/s", "angular velocity"),
        number("wz_rad_s", "rad/s", "angular velocity"),
        bool("held", "whether both fingers touch it"),
    ],
};

/// The gripper and the base.
pub(super) const COURSE_ROBOT: TableSpec = TableSpec {
    file: "course_robot.parquet",
    rows: "one for each action and control tick",
    columns: &[
        RUN,
        STEP,
        TIME,
        number(
            "gripper_x_m",
            "m",
            "true position in the world of the point between the fingertips",
        ),
        number("gripper_y_m", "m", "position of that point"),
        number("gripper_z_m", "m", "position of that point"),
        number(
            "gripper_qx",
            "1",
            "rotation of the gripper, as a unit quaternion; x is along the fingers, y across them",
        ),
        number("gripper_qy", "1", "rotation of the gripper"),
        number("gripper_qz", "1", "rotation of the gripper"),
        number("gripper_qw", "1", "rotation of the gripper"),
        number("opening_m", "m", "gap between the fingers"),
        number("base_x_m", "m", "true x of the base"),
        number("base_y_m", "m", "true y of the base"),
        number("base_heading_rad", "rad", "true heading of the base"),
        number("believed_x_m", "m", "localised x of the base"),
        number("believed_y_m", "m", "localised y of the base"),
        number(
            "believed_heading_rad",
            "rad",
            "localised heading of the base",
        ),
    ],
};

/// The joints.
pub(super) const COURSE_JOINTS: TableSpec = TableSpec {
    file: "course_joints.parquet",
    rows: "one for each action, control tick and joint",
    columns: &[
        RUN,
        STEP,
        TIME,
        text("joint", "name of the joint in the URDF"),
        number("position", "m or rad", "true position"),
        number("velocity", "m/s or rad/s", "true velocity"),
        number("effort", "N or N m", "effort of the motor"),
    ],
};

/// The forces of contacts.
pub(super) const COURSE_FORCES: TableSpec = TableSpec {
    file: "course_forces.parquet",
    rows: "one for each action, control tick and pair of bodies that press on each other; pairs without a row do not",
    columns: &[
        RUN,
        STEP,
        TIME,
        text(
            "first",
            "one of the two: id of an object, robot/LINK or floor",
        ),
        text("second", "the other one"),
        number("force_n", "N", "normal force, to 0.02 N"),
    ],
};

/// The phases of actions.
pub(super) const PHASES: TableSpec = TableSpec {
    file: "phases.parquet",
    rows: "one for each phase of each action, in order",
    columns: &[
        RUN,
        STEP,
        text("phase", "name of the phase, such as lift"),
        number(
            "start_s",
            "s",
            "start since the action began; it lasts until the next one",
        ),
    ],
};

/// All of these tables.
pub(super) const COURSE: [&TableSpec; 5] = [
    &COURSE_BODIES,
    &COURSE_ROBOT,
    &COURSE_JOINTS,
    &COURSE_FORCES,
    &PHASES,
];

const POSE: [&str; 7] = ["x", "y", "z", "qx", "qy", "qz", "qw"];
const VELOCITY: [&str; 6] = ["vx", "vy", "vz", "wx", "wy", "wz"];
const BASE: [&str; 6] = [
    "baseX",
    "baseY",
    "baseYaw",
    "believedX",
    "believedY",
    "believedYaw",
];
const JOINT: [&str; 3] = ["position", "velocity", "effort"];

/// Adds the course of each action of a run.
pub(super) fn add(run: &str, trace: &Trace, sheets: &mut Sheets) {
    for (step, course) in (1usize..).zip(&trace.robot_courses) {
        add_samples(run, step, &course.samples, sheets);
    }
    for (step, action) in (1usize..).zip(&trace.actions) {
        add_phases(run, step, action, sheets);
    }
}

fn add_phases(run: &str, step: usize, action: &ActionTrace, sheets: &mut Sheets) {
    for phase in &action.phases {
        let place = [Cell::text(run), Cell::count(step)];
        sheets.push(
            &PHASES,
            place
                .into_iter()
                .chain([Cell::text(&phase.name), Cell::number(phase.start_secs)]),
        );
    }
}

fn add_samples(run: &str, step: usize, samples: &Samples, sheets: &mut Sheets) {
    let by_name: BTreeMap<[&str; 2], Vec<f64>> = samples
        .series
        .iter()
        .filter(|series| series.other.is_empty())
        .map(|series| {
            (
                [series.thing.as_str(), series.quantity.as_str()],
                series.values().collect(),
            )
        })
        .collect();
    let cell = |thing: &str, quantity: &str, at: usize| {
        Cell::Number(
            by_name
                .get(&[thing, quantity])
                .and_then(|values| values.get(at))
                .copied(),
        )
    };
    let with = |quantity: &'static str| {
        samples
            .series
            .iter()
            .filter(move |series| series.quantity == quantity)
    };
    let forces: Vec<(&Series, Vec<f64>)> = with("contactForce")
        .map(|series| (series, series.values().collect()))
        .collect();
    for at in 0..samples.count {
        let place = || {
            [
                Cell::text(run),
                Cell::count(step),
                Cell::number(at as f64 * samples.period_secs),
            ]
        };
        for Series { thing, .. } in with("held") {
            let motion = POSE
                .into_iter()
                .chain(VELOCITY)
                .map(|quantity| cell(thing, quantity, at));
            let held = by_name
                .get(&[thing.as_str(), "held"])
                .and_then(|values| values.get(at))
                .map(|held| *held > 0.5);
            let row = place()
                .into_iter()
                .chain([Cell::text(thing)])
                .chain(motion)
                .chain([Cell::Bool(held)]);
            sheets.push(&COURSE_BODIES, row);
        }
        let hand = POSE
            .into_iter()
            .chain(["opening"])
            .map(|quantity| cell("gripper", quantity, at));
        let base = BASE.into_iter().map(|quantity| cell("robot", quantity, at));
        sheets.push(&COURSE_ROBOT, place().into_iter().chain(hand).chain(base));
        for Series { thing, .. } in with("effort") {
            let name = thing.strip_prefix("joint/").unwrap_or(thing);
            let numbers = JOINT.map(|quantity| cell(thing, quantity, at));
            sheets.push(
                &COURSE_JOINTS,
                place().into_iter().chain([Cell::text(name)]).chain(numbers),
            );
        }
        for (series, values) in &forces {
            let Some(force) = values.get(at).filter(|force| **force > 0.0) else {
                continue;
            };
            let pair = [
                Cell::text(&series.thing),
                Cell::text(&series.other),
                Cell::number(*force),
            ];
            sheets.push(&COURSE_FORCES, place().into_iter().chain(pair));
        }
    }
}
