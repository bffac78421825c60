//! The things that the robot can touch in a tick, and the shortcuts that the simulation may take
//! where these are few.
//!
//! # Why there are shortcuts
//!
//! In most ticks of a pick the arm moves through free space, and everything else is at rest. The
//! engine would solve the robot's joints and search for contacts all the same: the shipped pick takes
//! seven times the CPU without shortcuts, and grips less firmly, because the engine's iterations let
//! held objects creep (0.76 mm instead of 0.09 mm in ten seconds).
//!
//! A shortcut is taken only where the rest has no effect. [`Proximity`](crate::Proximity) measures
//! how far each link is from everything, and how far it can move in the tick: a shortcut is taken if
//! the way is shorter than the distance. So the decision depends on the state alone, and the same seed
//! gives the same bits.
//!
//! - `free_motion`: the robot's equations of motion are solved exactly (Featherstone's articulated
//!   bodies, with the motors as soft constraints) instead of by the engine.
//! - `robot_apart`: something rolls or falls, and the robot can't reach it. The engine moves the
//!   objects, and the equations the robot.
//! - `hand_alone`: the hand can touch movable objects, and the arm nothing. The engine gets the hand
//!   as a body that is led along the arm's motion, and the force of its contacts is returned to the
//!   equations of the arm. Light or loaded arms, which give way within a step, are left to the engine.
//! - `shells`: a glass is 24 boxes. While nothing is at its mouth, a closed surface around it has
//!   the same contacts.
//! - `few_substeps`: half of the solver's substeps in ticks of the two kinds above; grasps are
//!   as firm as with all of them.
//! - `few_sweeps`: the engine sweeps fast shapes, so that they pass through nothing thin. Where
//!   nothing fast can meet something fixed, sweeps find nothing.
//!
//! The share of a campaign's CPU that each saves beside all others, by `cargo bench --bench
//! shortcuts` on two cores, and the ratio of all shortcuts to none:
//!
//! | robot and task | free motion | robot apart | hand alone | shells | few substeps | few sweeps | ratio |
//! | --- | --- | --- | --- | --- | --- | --- | --- |
//! | mobile manipulator, pick | 24 % | 9 % | 61 % | 32 % | 21 % | 0 % | 0.14 |
//! | mobile manipulator, whole task | 13 % | 4 % | 51 % | 20 % | 13 % | 0 % | 0.28 |
//! | fixed arm, pick | 15 % | 5 % | 39 % | 10 % | 18 % | 0 % | 0.40 |
//! | Stretch 4, pick | 8 % | 0 % | 47 % | 0 % | 8 % | 1 % | 0.24 |
//! | PR2, pick | 8 % | 6 % | 37 % | 1 % | 8 % | 1 % | 0.30 |
//! | TIAGo dual, pick | 7 % | 3 % | 5 % | 2 % | 2 % | 0 % | 0.40 |
//!
//! `robot_apart` and `few_sweeps` save less than a tenth here. `few_sweeps` is for hands whose fingers
//! have dozens of thin pieces, which outrun their own thickness in nearly every step; `robot_apart`
//! carries the settling of each scene, and without it all states change.
//!
//! `[physics] shortcuts = false` in a configuration leaves everything to the engine, for comparisons.

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
