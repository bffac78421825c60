//! The suction cup in a robot profile.

use crate::Table;
use actcheck_data::Suction;

/// Keys of a gripper with fingers, which exclude those of a suction cup.
pub(super) const OF_FINGERS: [&str; 5] = [
    "finger_joints",
    "finger_links",
    "max_opening_m",
    "finger_friction",
    "grip_force_n",
];

/// Friction of a suction cup's lip if the profile has none: that of rubber on dry metal, glass or
/// wood.
const LIP_FRICTION: f64 = 0.5;

/// Reports each key of fingers in the profile of a robot with a suction cup.
pub(super) fn exclude_fingers(table: &mut Table) {
    for key in OF_FINGERS {
        if let Some(span) = table.key_span(key) {
            let message = format!("`{key}` and the keys of a suction cup exclude each other");
            let help = "a gripper has either fingers or a cup: remove the keys of the other one";
            table.fault("W052", span, message, help);
        }
    }
}

/// Reads the suction cup. Returns `None` if the gripper has fingers.
pub(super) fn read_suction(table: &mut Table) -> Option<Suction> {
    let force_n = table.number("suction_force_n", 0.1..=1000.0);
    let radius_m = table.number("suction_radius_m", 0.002..=0.2);
    let friction = table
        .number("suction_friction", 0.0..=2.0)
        .unwrap_or(LIP_FRICTION);
    Some(Suction {
        force_n: force_n?,
        radius_m: radius_m?,
        friction,
    })
}
