//! The first moment at which two traces differ, and the quantity that differs.

use std::collections::BTreeMap;

use actcheck_data::{BodyState, Frames, Pose, RobotState, Snapshot, Trace};

/// Tolerance for rounding errors in times, as a share of the frame period.
const SLACK: f64 = 1e-6;
const AXES: [&str; 3] = ["x", "y", "z"];
const PARTS: [&str; 4] = ["qx", "qy", "qz", "qw"];

/// The first quantity in which two traces differ.
#[derive(Debug, Clone, PartialEq)]
pub struct TraceDifference {
    /// Simulated time since the scene was built. Unit: seconds.
    ///
    /// A trace keeps exact states at the start and end of every action, and frames in between,
    /// every tenth of a second and to a tenth of a millimetre. These limit how precisely the moment
    /// is known.
    pub time_secs: f64,
    /// Position of the action in the test, from 1; 0 before the first.
    pub step: usize,
    /// The object, `robot`, or `robot/LINK`.
    pub body: String,
    /// For example `position x`.
    pub quantity: String,
    /// Unit of the quantity; empty if it has none.
    pub unit: &'static str,
    /// Value in the first trace.
    pub was: String,
    /// Value in the second trace.
    pub is: String,
    /// Absolute difference, if both values are numbers.
    pub by: Option<f64>,
    /// Number of other quantities that differ at the same moment.
    pub others: usize,
}

/// Returns the first difference of two traces, or `None` if all stored states are bitwise
/// identical.
///
/// Of several differences at the same moment, body parameters come before poses, and poses before
/// velocities, because the earlier ones are likelier causes.
pub(super) fn first_difference(was: &Trace, is: &Trace) -> Option<TraceDifference> {
    let (was, is) = (moments(was), moments(is));
    for (one, other) in was.iter().zip(&is) {
        if one.time_secs.to_bits() != other.time_secs.to_bits() {
            return Some(end_difference(Some(one), Some(other)));
        }
        if let Some(found) = compare(one, other) {
            return Some(found);
        }
    }
    let shorter = was.len().min(is.len());
    (was.len() != is.len()).then(|| end_difference(was.get(shorter), is.get(shorter)))
}

/// The stored data of one moment.
struct Moment<'a> {
    time_secs: f64,
    step: usize,
    known: Known<'a>,
}

enum Known<'a> {
    State(&'a Snapshot),
    Frame(&'a Frames, &'a [f32]),
}

/// All moments of a trace in order: a state, the frames of the action that follows, the next state.
fn moments(trace: &Trace) -> Vec<Moment<'_>> {
    let Some(first) = trace.snapshots.first() else {
        return Vec::new();
    };
    let mut all = vec![Moment {
        time_secs: first.time_secs,
        step: 0,
        known: Known::State(first),
    }];
    // The first frame is the same moment as the first state, at lower precision.
    let mut rows = trace.frames.rows.iter().skip(1);
    let period = trace.frames.period_secs.max(f64::MIN_POSITIVE);
    for (idx, pair) in trace.snapshots.windows(2).enumerate() {
        let ([before, after], step) = ([&pair[0], &pair[1]], idx + 1);
        let mut count = 1.0;
        while count <= (after.time_secs - before.time_secs) / period + SLACK {
            let Some(row) = rows.next() else { break };
            let time_secs = before.time_secs + count * period;
            all.push(Moment {
                time_secs,
                step,
                known: Known::Frame(&trace.frames, row),
            });
            count += 1.0;
        }
        all.push(Moment {
            time_secs: after.time_secs,
            step,
            known: Known::State(after),
        });
    }
    all
}

/// The difference if an action, or the whole trace, is longer than its counterpart.
fn end_difference(was: Option<&Moment<'_>>, is: Option<&Moment<'_>>) -> TraceDifference {
    let words = |moment: Option<&Moment<'_>>| match moment {
        Some(Moment {
            time_secs,
            known: Known::State(_),
            ..
        }) => format!("ended at {time_secs:.3} s"),
        Some(Moment { time_secs, .. }) => format!("still running at {time_secs:.3} s"),
        None => "not reached".to_owned(),
    };
    let first = [was, is]
        .into_iter()
        .flatten()
        .min_by(|a, b| a.time_secs.total_cmp(&b.time_secs));
    TraceDifference {
        time_secs: first.map_or(0.0, |moment| moment.time_secs),
        step: first.map_or(0, |moment| moment.step),
        body: "robot".to_owned(),
        quantity: "end of the action".to_owned(),
        unit: "",
        was: words(was),
        is: words(is),
        by: None,
        others: 0,
    }
}

/// Compares the readings of two moments in the order of the first one. Readings of the second one
/// alone come last.
fn compare(was: &Moment<'_>, is: &Moment<'_>) -> Option<TraceDifference> {
    let was_readings = readings(was);
    let mut rest: BTreeMap<(String, String), Reading> = readings(is)
        .into_iter()
        .map(|reading| ((reading.body.clone(), reading.quantity.clone()), reading))
        .collect();
    let mut found: Option<TraceDifference> = None;
    let mut note = |one: Option<&Reading>, other: Option<&Reading>| {
        if let Some(found) = &mut found {
            found.others += 1;
        } else if let Some(known) = one.or(other) {
            found = Some(TraceDifference {
                time_secs: was.time_secs,
                step: was.step,
                body: known.body.clone(),
                quantity: known.quantity.clone(),
                unit: known.unit,
                was: value_text(one),
                is: value_text(other),
                by: one
                    .zip(other)
                    .and_then(|(one, other)| one.value.distance(&other.value)),
                others: 0,
            });
        }
    };
    for one in &was_readings {
        let other = rest.remove(&(one.body.clone(), one.quantity.clone()));
        if !other
            .as_ref()
            .is_some_and(|other| one.value.is_same(&other.value))
        {
            note(Some(one), other.as_ref());
        }
    }
    rest.values().for_each(|other| note(None, Some(other)));
    found
}

/// One quantity of one body.
struct Reading {
    body: String,
    quantity: String,
    unit: &'static str,
    value: Value,
}

enum Value {
    /// A number at full precision, compared bit by bit.
    Exact(f64),
    /// A rounded number of a frame, compared by value.
    Rounded(f64),
    Words(String),
}

impl Value {
    fn is_same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Exact(one), Self::Exact(other)) => one.to_bits() == other.to_bits(),
            (Self::Rounded(one), Self::Rounded(other)) => {
                one == other || (one.is_nan() && other.is_nan())
            }
            (Self::Words(one), Self::Words(other)) => one == other,
            _ => false,
        }
    }

    fn distance(&self, other: &Self) -> Option<f64> {
        match (self, other) {
            (Self::Exact(one) | Self::Rounded(one), Self::Exact(other) | Self::Rounded(other)) => {
                Some((other - one).abs())
            }
            _ => None,
        }
    }
}

fn value_text(reading: Option<&Reading>) -> String {
    match reading.map(|reading| &reading.value) {
        Some(Value::Exact(number) | Value::Rounded(number)) => number.to_string(),
        Some(Value::Words(text)) => text.clone(),
        None => "not there".to_owned(),
    }
}

fn readings(moment: &Moment<'_>) -> Vec<Reading> {
    let mut all = Vec::new();
    match &moment.known {
        Known::State(state) => {
            state
                .bodies
                .iter()
                .for_each(|body| read_parameters(body, &mut all));
            state
                .bodies
                .iter()
                .for_each(|body| read_pose(&body.id, &body.pose, &mut all));
            read_robot(&state.robot, &mut all);
            state
                .bodies
                .iter()
                .for_each(|body| read_motion(body, &mut all));
        }
        Known::Frame(frames, row) => {
            for (name, values) in frames
                .names
                .iter()
                .zip(row.chunks(AXES.len() + PARTS.len()))
            {
                for (idx, value) in values.iter().enumerate() {
                    let (quantity, unit) = match AXES.get(idx) {
                        Some(axis) => (format!("position {axis}"), "m"),
                        None => (format!("orientation {}", PARTS[idx - AXES.len()]), ""),
                    };
                    let value = Value::Rounded(f64::from(*value));
                    all.push(Reading {
                        body: name.clone(),
                        quantity,
                        unit,
                        value,
                    });
                }
            }
        }
    }
    all
}

fn exact(body: &str, quantity: impl Into<String>, unit: &'static str, value: f64) -> Reading {
    Reading {
        body: body.to_owned(),
        quantity: quantity.into(),
        unit,
        value: Value::Exact(value),
    }
}

fn list(body: &str, quantity: &str, names: &[String]) -> Reading {
    let text = if names.is_empty() {
        "nothing".to_owned()
    } else {
        names.join(", ")
    };
    Reading {
        body: body.to_owned(),
        quantity: quantity.to_owned(),
        unit: "",
        value: Value::Words(text),
    }
}

fn vector(
    body: &str,
    quantity: &str,
    unit: &'static str,
    values: [f64; 3],
) -> impl Iterator<Item = Reading> {
    AXES.iter()
        .zip(values)
        .map(move |(axis, value)| exact(body, format!("{quantity} {axis}"), unit, value))
}

fn read_parameters(body: &BodyState, all: &mut Vec<Reading>) {
    let model = Value::Words(body.model.clone());
    all.push(Reading {
        body: body.id.clone(),
        quantity: "model".to_owned(),
        unit: "",
        value: model,
    });
    all.push(exact(&body.id, "mass", "kg", body.mass_kg));
    all.push(exact(&body.id, "friction", "", body.friction));
    all.push(exact(&body.id, "restitution", "", body.restitution));
}

fn read_pose(body: &str, pose: &Pose, all: &mut Vec<Reading>) {
    all.extend(vector(body, "position", "m", pose.position));
    all.extend(
        PARTS
            .iter()
            .zip(pose.rotation)
            .map(|(part, value)| exact(body, format!("orientation {part}"), "", value)),
    );
}

fn read_robot(robot: &RobotState, all: &mut Vec<Reading>) {
    for (quantity, pose) in [
        ("base", robot.base_true),
        ("believed base", robot.base_believed),
    ] {
        for (part, unit, value) in [
            ("x", "m", pose[0]),
            ("y", "m", pose[1]),
            ("heading", "rad", pose[2]),
        ] {
            all.push(exact("robot", format!("{quantity} {part}"), unit, value));
        }
    }
    for joint in &robot.joints {
        all.push(exact(
            "robot",
            format!("position of joint {}", joint.name),
            "",
            joint.position,
        ));
        all.push(exact(
            "robot",
            format!("velocity of joint {}", joint.name),
            "",
            joint.velocity,
        ));
    }
    read_pose("robot/gripper", &robot.gripper, all);
    all.push(exact(
        "robot/gripper",
        "opening",
        "m",
        robot.gripper_opening_m,
    ));
    all.push(list(
        "robot/gripper",
        "touch of the left finger",
        &robot.left_touches,
    ));
    all.push(list(
        "robot/gripper",
        "touch of the right finger",
        &robot.right_touches,
    ));
}

fn read_motion(body: &BodyState, all: &mut Vec<Reading>) {
    let extent = [0, 1, 2].map(|axis| body.aabb_max[axis] - body.aabb_min[axis]);
    all.extend(vector(&body.id, "extent", "m", extent));
    all.extend(vector(&body.id, "velocity", "m/s", body.linear_velocity));
    all.extend(vector(
        &body.id,
        "angular velocity",
        "rad/s",
        body.angular_velocity,
    ));
    all.push(list(&body.id, "touch", &body.touches));
    all.push(list(&body.id, "support", &body.rests_on));
    let asleep = if body.asleep { "asleep" } else { "awake" };
    all.push(Reading {
        body: body.id.clone(),
        quantity: "sleep".to_owned(),
        unit: "",
        value: Value::Words(asleep.to_owned()),
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    fn body(id: &str, x: f64) -> BodyState {
        BodyState {
            id: id.into(),
            model: "mug".into(),
            category: "http://actions#Mug".into(),
            fixed: false,
            pose: Pose::upright([x, 0.0, 0.4], 0.0),
            linear_velocity: [0.0; 3],
            angular_velocity: [0.0; 3],
            aabb_min: [0.0; 3],
            aabb_max: [0.1; 3],
            mass_kg: 0.3,
            friction: 0.5,
            restitution: 0.0,
            touches: vec![],
            rests_on: vec!["table_1".into()],
            asleep: true,
            size_m: [0.1; 3],
            grasp_distance_m: None,
            part: None,
            left_world: false,
        }
    }

    fn state(time_secs: f64, x: f64) -> Snapshot {
        let robot = RobotState {
            base_true: [0.0; 3],
            base_believed: [0.0; 3],
            joints: vec![],
            gripper: Pose::IDENTITY,
            gripper_opening_m: 0.05,
            left_touches: vec![],
            right_touches: vec![],
            links: vec![],
            cup: None,
        };
        Snapshot {
            time_secs,
            bodies: vec![body("mug_1", x), body("mug_2", 0.3)],
            robot,
        }
    }

    fn trace() -> Trace {
        let row = |x: f32| vec![x, 0.0, 0.4, 0.0, 0.0, 0.0, 1.0];
        let frames = Frames {
            period_secs: 0.1,
            names: vec!["mug_1".into()],
            rows: vec![row(0.0), row(0.1), row(0.2)],
        };
        Trace {
            snapshots: vec![state(1.0, 0.0), state(1.25, 0.2)],
            actions: vec![],
            frames,
            hash: "a".into(),
            ..Trace::default()
        }
    }

    #[test]
    fn equal_traces_have_no_difference() {
        assert_eq!(first_difference(&trace(), &trace()), None);
    }

    #[test]
    fn the_earliest_difference_is_found_with_body_parameters_first() {
        let mut other = trace();
        other.snapshots[1].bodies[0].pose.position[0] = 0.7;
        other.frames.rows[2][0] = 0.25;
        let found = first_difference(&trace(), &other).expect("a frame differs");
        assert_eq!(
            (found.body.as_str(), found.quantity.as_str(), found.step),
            ("mug_1", "position x", 1)
        );
        assert!(
            (found.time_secs - 1.2).abs() < 1e-12
                && found.by.is_some_and(|by| (by - 0.05).abs() < 1e-6)
        );
        other.snapshots[0].bodies[1].mass_kg = 0.31;
        other.snapshots[0].bodies[0].pose.position[0] = 0.01;
        let found = first_difference(&trace(), &other).expect("the first state differs");
        assert_eq!(
            (found.body.as_str(), found.quantity.as_str(), found.others),
            ("mug_2", "mass", 1)
        );
        assert_eq!(
            (found.was.as_str(), found.is.as_str(), found.step),
            ("0.3", "0.31", 0)
        );
    }

    #[test]
    fn missing_bodies_and_frames_are_differences() {
        let mut other = trace();
        other.snapshots[0].bodies.truncate(1);
        let found = first_difference(&trace(), &other).expect("a body is missing");
        assert_eq!(
            (found.body.as_str(), found.is.as_str()),
            ("mug_2", "not there")
        );
        let mut longer = trace();
        longer.snapshots[1].time_secs = 1.5;
        let found = first_difference(&trace(), &longer).expect("it takes longer");
        assert_eq!(found.quantity, "end of the action");
        let mut never = trace();
        never.snapshots.clear();
        let found = first_difference(&trace(), &never).expect("it was never performed");
        assert_eq!(found.is, "not reached");
    }
}
