//! Measurements of the gripper over time. The page derives all other signals from the bodies'
//! trajectories.

use serde_json::{Value, json};

use actcheck_base::DecidingSignal;
use actcheck_data::{Motion, Trace};

/// Steps of the opening: the resolution of trajectories. Unit: metres.
const OPENING_STEP_M: f64 = 1e-4;
/// Steps of the force. Unit: newtons.
const FORCE_STEP_N: f64 = 0.5;

/// Positions of the grasp point before and after an action, from which the page finds the link that
/// carries it. Unit: metres. Frame: world.
pub(super) fn hand(trace: &Trace, action_idx: usize) -> Value {
    let around =
        [action_idx, action_idx + 1].map(|idx| trace.snapshots.get(idx).or(trace.snapshots.last()));
    json!(around.map(|state| state.map(|state| state.robot.gripper.position)))
}

/// Gap between the fingers and their mean force, at equal intervals: start and interval in seconds
/// since the action began, then whole steps as differences, which are mostly zero. `null` if the
/// trace has none.
pub(super) fn grip(motion: &Motion) -> Value {
    let moments: Vec<_> = motion.moments().collect();
    let (Some(first), Some(last)) = (moments.first(), moments.last()) else {
        return Value::Null;
    };
    let intervals = moments.len().saturating_sub(1).max(1) as f64;
    let opening = moments
        .iter()
        .map(|moment| f64::from(moment.opening_m) / OPENING_STEP_M);
    let force = moments
        .iter()
        .map(|moment| f64::from(moment.finger_efforts_n.iter().sum::<f32>()) / 2.0 / FORCE_STEP_N);
    json!({
        "start": first.time_secs, "period": f64::from(last.time_secs - first.time_secs) / intervals,
        "opening": differences(opening), "opening_step": OPENING_STEP_M,
        "force": differences(force), "force_step": FORCE_STEP_N,
    })
}

/// Number of steps between the smallest and the largest value of a deciding signal.
const DECIDING_STEPS: f64 = 2000.0;

/// A signal that decided a property: its name, the moment, and its values and limits, packed as
/// those of a grip.
pub(super) fn deciding(signal: &DecidingSignal) -> Value {
    let [low, high] = signal.range();
    let step = ((high - low) / DECIDING_STEPS).max(1e-9);
    let packed = |values: &[f64]| differences(values.iter().map(|value| value / step));
    let limit = signal
        .constant_limit()
        .map_or_else(|| json!(packed(&signal.limit)), |limit| json!(limit));
    json!({
        "name": signal.quantity, "unit": signal.unit, "symbol": signal.symbol, "period": signal.period_secs,
        "at": signal.at_secs(), "during": signal.interval_secs(), "step": step, "values": packed(&signal.values),
        "limit": if signal.limit.is_empty() { Value::Null } else { limit },
    })
}

/// Rounds values to integers and returns the first, then the differences. Values that are not
/// finite repeat the previous one.
fn differences(values: impl Iterator<Item = f64>) -> Vec<i64> {
    let mut last = 0i64;
    values
        .map(|value| {
            let now = if value.is_finite() {
                value.round() as i64
            } else {
                last
            };
            now - std::mem::replace(&mut last, now)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_add_up_to_the_rounded_values() {
        let steps = differences([3.4, 3.6, f64::NAN, -1.0].into_iter());
        assert_eq!(steps, [3, 1, 0, -5]);
    }

    #[test]
    fn a_deciding_signal_keeps_its_limit_moment_and_interval() {
        let signal = DecidingSignal {
            quantity: "tilt(cup)".to_owned(),
            unit: "rad",
            symbol: "<",
            period_secs: 0.5,
            values: vec![0.0, 1.0, 2.0],
            limit: vec![0.5; 3],
            interval: [1, 2],
            at: 2,
        };
        let packed = deciding(&signal);
        assert_eq!(
            (&packed["limit"], &packed["at"], &packed["during"]),
            (&json!(0.5), &json!(1.0), &json!([0.5, 1.0]))
        );
        assert_eq!(packed["values"], json!([0, 1000, 1000]));
        let growing = DecidingSignal {
            limit: vec![0.0, 0.5, 1.0],
            ..signal
        };
        assert_eq!(deciding(&growing)["limit"], json!([0, 500, 500]));
    }

    #[test]
    fn a_grip_has_a_value_for_each_moment_and_none_without_measurements() {
        let row = |secs: f32, opening: f32, force: f32| {
            let mut row = vec![0.0; 12];
            (row[0], row[1], row[2], row[3]) = (secs, opening, force, force);
            row
        };
        let motion = Motion {
            joints: Vec::new(),
            rows: vec![
                row(0.0, 0.08, 0.0),
                row(0.05, 0.08, 0.0),
                row(0.1, 0.06, 12.0),
            ],
        };
        let packed = grip(&motion);
        assert_eq!(packed["opening"], json!([800, 0, -200]));
        assert_eq!(packed["force"], json!([0, 0, 24]));
        assert!((packed["period"].as_f64().unwrap_or_default() - 0.05).abs() < 1e-6);
        assert_eq!(grip(&Motion::default()), Value::Null);
    }
}
