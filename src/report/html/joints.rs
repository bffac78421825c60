//! The motion of the robot's joints and of its base, for signals of the page.

use serde_json::{Value, json};

use crate::html::pack::Pack;
use actcheck_data::{JointMoment, Motion, MotionRow, Trace};

/// Steps of base poses and of positions of joints. Unit: metres or radians.
const POSITION_STEP: f32 = 5e-4;
/// Steps of velocities. Unit: metres or radians in a second.
const VELOCITY_STEP: f32 = 5e-3;
/// Steps of efforts. Unit: newtons or newton metres.
const EFFORT_STEP: f32 = 0.25;

/// The motion of each action: the names of the joints; the first moment and the interval, in
/// seconds since the action began; and the columns: base pose by the truth and by belief, then
/// position, velocity, effort and target of each joint.
pub(super) fn joints(pack: &mut Pack, trace: &Trace) -> Value {
    let courses = trace.robot_courses.iter();
    courses
        .map(|course| of_action(pack, &course.motion))
        .collect()
}

fn of_action(pack: &mut Pack, motion: &Motion) -> Value {
    let moments: Vec<MotionRow<'_>> = motion.moments().collect();
    let (Some(first), Some(last)) = (moments.first(), moments.last()) else {
        return Value::Null;
    };
    let intervals = moments.len().saturating_sub(1).max(1) as f64;
    let period = f64::from(last.time_secs - first.time_secs) / intervals;
    let of_base = |value: fn(&MotionRow<'_>) -> [f32; 3]| {
        (0..3).map(move |axis| (value, axis)).collect::<Vec<_>>()
    };
    let mut columns: Vec<Vec<i16>> = [
        of_base(|moment| moment.base_true),
        of_base(|moment| moment.base_believed),
    ]
    .concat()
    .into_iter()
    .map(|(value, axis)| {
        steps(
            moments.iter().map(|moment| value(moment)[axis]),
            POSITION_STEP,
        )
    })
    .collect();
    let by_joint: Vec<Vec<JointMoment>> = moments
        .iter()
        .map(|moment| moment.joints().collect())
        .collect();
    let parts: [(fn(&JointMoment) -> f32, f32); 4] = [
        (|joint| joint.position, POSITION_STEP),
        (|joint| joint.velocity, VELOCITY_STEP),
        (|joint| joint.effort, EFFORT_STEP),
        (|joint| joint.target, POSITION_STEP),
    ];
    for joint in 0..motion.joints.len() {
        for (value, step) in parts {
            columns.push(steps(by_joint.iter().map(|row| value(&row[joint])), step));
        }
    }
    json!({
        "names": motion.joints, "start": first.time_secs, "period": period, "columns": columns.len(),
        "steps": [POSITION_STEP, VELOCITY_STEP, EFFORT_STEP], "rows": pack.trajectories(&columns),
    })
}

/// Values as whole steps. Values that are not finite repeat the previous one.
fn steps(values: impl Iterator<Item = f32>, step: f32) -> Vec<i16> {
    let mut last = 0;
    values
        .map(|value| {
            if value.is_finite() {
                #[expect(
                    clippy::cast_possible_truncation,
                    reason = "the cast saturates: such values are beyond every plot"
                )]
                let now = (value / step).round() as i16;
                last = now;
            }
            last
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::RobotCourse;

    #[test]
    fn the_motion_of_joints_has_a_column_for_each_quantity() {
        let mut row = vec![0.0; 12];
        (row[0], row[6]) = (0.1, 1.0);
        row.extend([0.5, 0.1, f32::NAN, 0.55]);
        let motion = Motion {
            joints: vec!["lift".to_owned()],
            rows: vec![row],
        };
        let course = RobotCourse {
            motion,
            ..RobotCourse::default()
        };
        let trace = Trace {
            robot_courses: vec![course, RobotCourse::default()],
            ..Trace::default()
        };
        let packed = joints(&mut Pack::default(), &trace);
        assert_eq!(packed[0]["names"], json!(["lift"]));
        assert_eq!(packed[0]["columns"], json!(10));
        assert_eq!(packed[0]["rows"]["length"], json!(1));
        assert_eq!(packed[1], Value::Null);
        assert_eq!(
            steps([0.5, f32::NAN, 1e9].into_iter(), 0.25),
            [2, 2, i16::MAX]
        );
    }
}
