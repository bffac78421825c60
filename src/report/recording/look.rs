//! Colours of bodies, those of the replay in the page (`web/solids.js`).

use crate::base::names;
use crate::history::{BodyState, Role};

/// How a body is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Look {
    /// Red, green, blue, and what can't be seen through.
    pub rgba: u32,
    /// Whether its faces are filled; only its edges are drawn where not.
    pub filled: bool,
}

impl Look {
    /// A link of the robot.
    pub const ROBOT: Self = Self::filled(0x86a5_c6ff);
    /// What perception returned.
    pub const PERCEIVED: Self = Self { rgba: 0xb43c_b0ff, filled: false };

    const fn filled(rgba: u32) -> Self {
        Self { rgba, filled: true }
    }

    /// An object of a scene by what it is there for. Walls would hide what is behind them.
    pub fn of(role: Option<Role>, body: Option<&BodyState>) -> Self {
        match role {
            _ if body.is_some_and(|body| names::local(&body.category) == "Wall") => {
                Self { rgba: 0xb9c0_c9ff, filled: false }
            }
            Some(Role::Target) => Self::filled(0x2f7f_e0ff),
            Some(Role::Obstacle) => Self::filled(0xd08a_2eff),
            Some(Role::Platform) => Self::filled(0xd9c2_9aff),
            Some(Role::Other | Role::PlaceOther) => Self::filled(0xaab3_bdff),
            None if body.is_some_and(|body| body.fixed) => Self::filled(0xd9c2_9aff),
            None => Self::filled(0xaab3_bdff),
        }
    }
}
