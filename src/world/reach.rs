//! The things that the robot can touch in a tick, and the shortcuts that the simulation may take
//! where these are few.

use crate::ownership::Ownership;

/// The things that the robot can touch in a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub(super) enum Reach {
    /// Nothing, and everything else is at rest.
    Nothing,
    /// Nothing, but objects move.
    Apart,
    /// Its hand can touch movable objects.
    Hand,
    /// Everything.
    #[default]
    All,
}

impl Reach {
    /// Returns the part of the robot that the engine moves.
    pub(super) fn ownership(self) -> Ownership {
        match self {
            Self::Nothing | Self::Apart => Ownership::Nothing,
            Self::Hand => Ownership::Hand,
            Self::All => Ownership::Whole,
        }
    }
}

/// The ticks in which less is simulated than the whole robot in the engine, because the rest has no
/// effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shortcuts {
    /// No engine where the robot touches nothing and everything else is at rest.
    pub free_motion: bool,
    /// No robot in the engine where objects move out of its reach.
    pub robot_apart: bool,
    /// Only the hand in the engine where only the hand can touch something, and only movable
    /// objects.
    pub hand_alone: bool,
    /// A closed surface instead of the staves of a hollow object while nothing is at its mouth.
    pub shells: bool,
    /// Half of the substeps where the engine moves the hand alone, and where the robot touches
    /// nothing.
    pub few_substeps: bool,
    /// No sweeps of fast shapes where nothing fast can meet something fixed.
    pub few_sweeps: bool,
}

impl Shortcuts {
    /// All that keep the quality of a grasp.
    pub const ALL: Self = Self {
        free_motion: true,
        robot_apart: true,
        hand_alone: true,
        shells: true,
        few_substeps: true,
        few_sweeps: true,
    };
    /// None: the engine simulates everything in every tick.
    pub const NONE: Self = Self {
        free_motion: false,
        robot_apart: false,
        hand_alone: false,
        shells: false,
        few_substeps: false,
        few_sweeps: false,
    };

    /// Returns the reach for which the engine must prepare, given that of the robot.
    pub(super) fn limit(self, reach: Reach) -> Reach {
        match reach {
            Reach::Nothing if self.free_motion => Reach::Nothing,
            Reach::Nothing | Reach::Apart if self.robot_apart => Reach::Apart,
            Reach::Hand if self.hand_alone => Reach::Hand,
            _ => Reach::All,
        }
    }
}

impl Default for Shortcuts {
    fn default() -> Self {
        Self::ALL
    }
}
