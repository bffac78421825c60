//! The robot's setpoints in a run as a table.

use std::fmt::Write as _;

use actcheck_world::{Playback, Robot, Setpoint};

/// Returns the setpoints as CSV: for each control tick its end since the start and, for each joint,
/// position, velocity, largest effort, and the commanded effort if there is one instead.
pub(super) fn write(robot: &Robot, playback: &Playback) -> String {
    let mut out = String::from("time_secs");
    for joint in &robot.model.joints {
        for column in ["position", "velocity", "limit", "effort"] {
            _ = write!(out, ",{}", csv_name(&format!("{}.{column}", joint.name)));
        }
    }
    out.push('\n');
    for (tick, setpoints) in playback.ticks.iter().enumerate() {
        _ = write!(out, "{}", (tick + 1) as f64 * playback.tick_secs);
        for Setpoint {
            position,
            velocity,
            limit,
            effort,
        } in setpoints
        {
            _ = write!(out, ",{position},{velocity},{limit},");
            if let Some(effort) = effort {
                _ = write!(out, "{effort}");
            }
        }
        out.push('\n');
    }
    out
}

fn csv_name(name: &str) -> String {
    if name.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", name.replace('"', "\"\""))
    } else {
        name.to_owned()
    }
}
