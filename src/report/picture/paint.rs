//! The colours of pictures, safe for red-green colour blindness.

use crate::picture::drawing::{Line, Paint, Style};
use crate::picture::paths::Mover;
use actcheck_data::Role;

/// Text and thin lines.
pub(super) const INK: u32 = 0x1c_2430;
/// Secondary text.
pub(super) const GREY: u32 = 0x5b_6472;
/// Failures.
pub(super) const FAILED: u32 = 0xc0_2b1d;
/// Perceived objects.
pub(super) const PERCEIVED: u32 = 0xa0_2c9a;
/// The target.
pub(super) const TARGET: u32 = 0x1f_5fc4;
/// Obstacles on the floor.
pub(super) const OBSTACLE: u32 = 0xb8_6b14;
/// All other movable objects.
pub(super) const OTHER: u32 = 0x6b_7582;

/// One colour for each action, repeated if there are more actions. (After the Okabe-Ito palette.)
const ACTIONS: [u32; 6] = [
    0xd5_5e00, 0x00_8a66, 0x7a_3fb0, 0xc4_8a00, 0x2a_8fc9, 0x84_3c39,
];

pub(super) const FURNITURE: Style = Style::both(
    Paint::new(0xe6_d5b5, 0.9),
    Line::new(Paint::new(0xb0_9564, 1.0), 0.8),
);
pub(super) const WALL: Style = Style::both(
    Paint::new(0x9a_a1ab, 0.9),
    Line::new(Paint::new(0x6f_7783, 1.0), 0.6),
);
pub(super) const ROBOT: Style = Style::both(
    Paint::new(0x5a_7a99, 0.22),
    Line::new(Paint::new(0x3f_5a75, 0.55), 0.6),
);
/// Links without a colour in their files.
pub(super) const PLAIN_ROBOT: u32 = 0x9d_b0c4;
/// Opacity of a robot that is drawn as it looks: the thing in its hand shines through.
pub(super) const ROBOT_OPACITY: f64 = 0.82;
pub(super) const PRESSED: Style = Style::both(
    Paint::solid(FAILED),
    Line::new(Paint::solid(0xff_ffff), 1.6),
);
pub(super) const GLIMPSE: Style =
    Style::line(Line::dashed(Paint::solid(PERCEIVED), 1.4, [4.0, 3.0]));
pub(super) const BACKGROUND: Style = Style::both(
    Paint::solid(0xf5_f6f8),
    Line::new(Paint::solid(0xd4_d8de), 1.0),
);
pub(super) const ROOM: Style = Style::both(
    Paint::solid(0xfb_fbf7),
    Line::new(Paint::solid(0xd9_dad2), 1.0),
);

pub(super) fn action(idx: usize) -> u32 {
    ACTIONS[idx % ACTIONS.len()]
}

pub(super) fn rgb_of(role: Role) -> u32 {
    match role {
        Role::Target => TARGET,
        Role::Obstacle => OBSTACLE,
        Role::Other | Role::PlaceOther | Role::Platform | Role::Part => OTHER,
    }
}

pub(super) fn movable(role: Role) -> Style {
    let rgb = rgb_of(role);
    Style::both(Paint::new(rgb, 0.5), Line::new(Paint::solid(rgb), 1.0))
}

/// The colour of a body of a style that looks like this, but for its own colours.
pub(super) fn plain(style: &Style) -> u32 {
    style.fill.map_or(OTHER, |fill| fill.rgb)
}

/// Line style of a path: base wide, hand thin, target dotted.
pub(super) fn path(mover: Mover, rgb: u32) -> Line {
    match mover {
        Mover::Base => Line::new(Paint::new(rgb, 0.45), 5.0),
        Mover::Hand => Line::new(Paint::new(rgb, 0.9), 1.6),
        Mover::Target => Line::dashed(Paint::new(rgb, 0.95), 2.4, [2.0, 3.0]),
    }
}
