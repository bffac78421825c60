//! Colours of bodies, the same as in the HTML replay (`web/solids.js`).

use actcheck_base::names;
use actcheck_data::{BodyState, Role};

/// How a body is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Look {
    /// Colour as 0xRRGGBBAA.
    pub rgba: u32,
    /// Whether its faces are filled. If `false`, only edges are drawn.
    pub filled: bool,
}

impl Look {
    /// A link of the robot.
    #[cfg(feature = "rerun")]
    pub const ROBOT: Self = Self::filled(0x86a5_c6ff);
    /// A perceived object.
    pub const PERCEIVED: Self = Self {
        rgba: 0xb43c_b0ff,
        filled: false,
    };

    const fn filled(rgba: u32) -> Self {
        Self { rgba, filled: true }
    }

    /// The look of an object by its role. Walls are not filled, because they would hide objects
    /// behind them.
    pub fn of(role: Option<Role>, body: Option<&BodyState>) -> Self {
        match role {
            _ if body.is_some_and(|body| names::local(&body.category) == "Wall") => Self {
                rgba: 0xb9c0_c9ff,
                filled: false,
            },
            Some(Role::Target) => Self::filled(0x2f7f_e0ff),
            Some(Role::Obstacle) => Self::filled(0xd08a_2eff),
            Some(Role::Platform | Role::Part) => Self::filled(0xd9c2_9aff),
            Some(Role::Other | Role::PlaceOther) => Self::filled(0xaab3_bdff),
            None if body.is_some_and(|body| body.fixed) => Self::filled(0xd9c2_9aff),
            None => Self::filled(0xaab3_bdff),
        }
    }
}
