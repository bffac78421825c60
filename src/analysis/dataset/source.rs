//! Converts stored runs to rows of the dataset's tables of actions, percepts and motion over time.

use crate::dataset::columns::{ACTIONS, JOINTS, OBJECTS, PERCEPTS, ROBOT};
use crate::dataset::sheets::Sheets;
use crate::tables::Cell;
use actcheck_base::Outcome;
use actcheck_data::{ActionTrace, Look, Trace};
use actcheck_history::{ActionDetail, RunDetail};

/// Adds the actions and percepts of a run.
pub(super) fn add(run: &RunDetail, trace: &Trace, sheets: &mut Sheets) {
    for action in &run.actions {
        let traced = (action.step as usize)
            .checked_sub(1)
            .and_then(|step| trace.actions.get(step));
        add_action(run, action, traced, sheets);
    }
    for (idx, action) in trace.actions.iter().enumerate() {
        let began_secs = trace
            .snapshots
            .get(idx)
            .map_or(0.0, |before| before.time_secs);
        add_percepts(&run.row.run, idx + 1, action, began_secs, sheets);
    }
}

/// Adds the percepts of an action that began at this time since the scene was built. Unit: seconds.
fn add_percepts(
    run: &str,
    step: usize,
    action: &ActionTrace,
    began_secs: f64,
    sheets: &mut Sheets,
) {
    let seen = action.percepts.iter().map(|seen| {
        (
            "detector",
            Some(&seen.id),
            None,
            &seen.pose,
            seen.size_m,
            seen.look.as_ref(),
        )
    });
    let reported = action.perceived.iter().flat_map(|perceived| {
        let look = perceived.look.as_ref();
        perceived.things.iter().map(move |thing| {
            (
                "reported",
                None,
                thing.category.as_ref(),
                &thing.pose,
                thing.size_m,
                look,
            )
        })
    });
    for (number, (source, id, category, pose, size_m, look)) in (1usize..).zip(seen.chain(reported))
    {
        let row = [
            Cell::text(run),
            Cell::count(step),
            Cell::count(number),
            Cell::text(source),
        ];
        let named = [Cell::Text(id.cloned()), Cell::Text(category.cloned())];
        let numbers = pose
            .position
            .into_iter()
            .chain(pose.rotation)
            .chain(size_m)
            .map(Cell::number);
        sheets.push(
            &PERCEPTS,
            row.into_iter()
                .chain(named)
                .chain(numbers)
                .chain(look_cells(look, began_secs)),
        );
    }
}

/// The moment of a picture: its time since the action began, true and believed base, and the
/// camera's pose.
pub(super) fn look_cells(look: Option<&Look>, began_secs: f64) -> [Cell; 14] {
    let Some(look) = look else {
        return std::array::from_fn(|_| Cell::Number(None));
    };
    let [x, y, heading] = look.base_true;
    let [believed_x, believed_y, believed_heading] = look.base_believed;
    let [camera_x, camera_y, camera_z] = look.camera.position;
    let [qx, qy, qz, qw] = look.camera.rotation;
    let base = [
        look.time_secs - began_secs,
        x,
        y,
        heading,
        believed_x,
        believed_y,
        believed_heading,
    ];
    let camera = [camera_x, camera_y, camera_z, qx, qy, qz, qw];
    std::array::from_fn(|idx| Cell::number(if idx < 7 { base[idx] } else { camera[idx - 7] }))
}

fn add_action(
    run: &RunDetail,
    action: &ActionDetail,
    trace: Option<&ActionTrace>,
    sheets: &mut Sheets,
) {
    let parameters = serde_json::to_string(&action.parameters).unwrap_or_default();
    let passed = action
        .judgements
        .iter()
        .filter(|judgement| judgement.outcome == Outcome::Passed)
        .count();
    let base = trace.and_then(|trace| trace.base);
    let base = [(0, 0), (0, 1), (1, 0), (1, 1)]
        .map(|(end, axis)| Cell::Number(base.map(|base| base[end][axis])));
    let row = [
        Cell::text(&run.row.run),
        Cell::text(&run.row.campaign),
        Cell::count(run.row.index),
        Cell::count(action.step),
        Cell::text(&action.action),
        Cell::text(parameters),
        Cell::text(&action.end),
        Cell::Bool(action.reported),
        Cell::Text(action.message.clone()),
        Cell::number(action.duration_secs),
        Cell::count(passed),
        Cell::count(action.judgements.len()),
        Cell::number(action.score),
    ];
    sheets.push(&ACTIONS, row.into_iter().chain(base));
}

/// Adds the robot's and the objects' motion.
pub(super) fn add_courses(run: &str, trace: &Trace, sheets: &mut Sheets) {
    // Poses are stored at the same times. The first pose of an action is the last of the previous
    // one.
    let mut frame = 0usize;
    for (step, course) in (1usize..).zip(&trace.robot_courses) {
        let motion = &course.motion;
        for (number, moment) in motion.moments().enumerate() {
            frame += usize::from(number > 0);
            let place = || {
                [
                    Cell::text(run),
                    Cell::count(step),
                    Cell::number(f64::from(moment.time_secs)),
                ]
            };
            for (joint, at) in motion.joints.iter().zip(moment.joints()) {
                let values = [at.position, at.velocity, at.effort, at.target].map(single);
                sheets.push(
                    &JOINTS,
                    place().into_iter().chain([Cell::text(joint)]).chain(values),
                );
            }
            let [left, right] = moment.finger_efforts_n;
            let hand = [
                moment.opening_m,
                left,
                right,
                moment.commanded_opening_m,
                moment.commanded_force_n,
            ];
            let values = hand
                .into_iter()
                .chain(moment.base_believed)
                .chain(moment.base_true)
                .map(single);
            sheets.push(&ROBOT, place().into_iter().chain(values));
            let poses = trace
                .frames
                .rows
                .get(frame)
                .map(|row| row.as_slice())
                .unwrap_or_default();
            for (object, pose) in trace.frames.names.iter().zip(poses.chunks_exact(7)) {
                if !object.starts_with("robot/") {
                    let values = pose.iter().copied().map(single);
                    sheets.push(
                        &OBJECTS,
                        place()
                            .into_iter()
                            .chain([Cell::text(object)])
                            .chain(values),
                    );
                }
            }
        }
    }
}

/// Converts an f32 to a cell. A number that is not finite becomes missing.
fn single(value: f32) -> Cell {
    Cell::Number(value.is_finite().then_some(f64::from(value)))
}
