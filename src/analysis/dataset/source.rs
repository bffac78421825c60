//! Converts stored runs to rows of the dataset's tables.

use crate::dataset::sheet::Sheet;
use crate::tables::Cell;
use actcheck_base::Outcome;
use actcheck_data::Trace;
use actcheck_history::{ActionDetail, RunDetail};

/// The tables with rows of runs.
pub(super) struct Sheets {
    pub actions: Sheet,
    pub joints: Sheet,
    pub robot: Sheet,
    pub objects: Sheet,
    pub percepts: Sheet,
}

impl Sheets {
    /// Adds a run. Returns `false` if its trace lacks the robot's motion, as in earlier versions; then only actions and
    /// percepts are added.
    pub(super) fn add(&mut self, run: &RunDetail, trace: &Trace) -> bool {
        for action in &run.actions {
            self.add_action(run, action);
        }
        let name = || Cell::text(&run.row.run);
        for (step, action) in (1usize..).zip(&trace.actions) {
            let seen = action.percepts.iter().map(|seen| ("detector", Some(&seen.id), None, &seen.pose, seen.size_m));
            let told = action.perceived.iter().flat_map(|perceived| &perceived.things);
            let told = told.map(|thing| ("reported", None, thing.category.as_ref(), &thing.pose, thing.size_m));
            for (number, (source, id, category, pose, size_m)) in (1usize..).zip(seen.chain(told)) {
                let row = [name(), Cell::count(step), Cell::count(number), Cell::text(source)];
                let named = [Cell::Text(id.cloned()), Cell::Text(category.cloned())];
                let numbers = pose.position.into_iter().chain(pose.rotation).chain(size_m).map(Cell::number);
                self.percepts.push(row.into_iter().chain(named).chain(numbers));
            }
        }
        self.add_courses(&run.row.run, trace)
    }

    fn add_action(&mut self, run: &RunDetail, action: &ActionDetail) {
        let parameters = serde_json::to_string(&action.parameters).unwrap_or_default();
        let passed = action.judgements.iter().filter(|judgement| judgement.outcome == Outcome::Passed).count();
        self.actions.push([
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
        ]);
    }

    fn add_courses(&mut self, run: &str, trace: &Trace) -> bool {
        // Poses are stored at the same times. The first pose of an action is the last of the previous one.
        let (mut frame, mut any) = (0usize, false);
        for (step, course) in (1usize..).zip(&trace.robot_courses) {
            let motion = &course.motion;
            for (number, moment) in motion.moments().enumerate() {
                any = true;
                frame += usize::from(number > 0);
                let place = || [Cell::text(run), Cell::count(step), Cell::number(f64::from(moment.time_secs))];
                for (joint, at) in motion.joints.iter().zip(moment.joints()) {
                    let values = [at.position, at.velocity, at.effort, at.target].map(single);
                    self.joints.push(place().into_iter().chain([Cell::text(joint)]).chain(values));
                }
                let [left, right] = moment.finger_efforts_n;
                let hand = [moment.opening_m, left, right, moment.commanded_opening_m, moment.commanded_force_n];
                let values = hand.into_iter().chain(moment.base_believed).chain(moment.base_true).map(single);
                self.robot.push(place().into_iter().chain(values));
                let poses = trace.frames.rows.get(frame).map(|row| row.as_slice()).unwrap_or_default();
                for (object, pose) in trace.frames.names.iter().zip(poses.chunks_exact(7)) {
                    if !object.starts_with("robot/") {
                        let values = pose.iter().copied().map(single);
                        self.objects.push(place().into_iter().chain([Cell::text(object)]).chain(values));
                    }
                }
            }
        }
        any
    }
}

/// Converts an f32 to a cell. A number that is not finite becomes missing.
fn single(value: f32) -> Cell {
    Cell::Number(value.is_finite().then_some(f64::from(value)))
}
