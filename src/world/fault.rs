//! Faults of the simulation, and disturbances for tests.

use std::fmt;

use actcheck_data::Pose;

/// Radius of the world: a body farther from the origin, horizontally, has left it. Unit: metres.
/// The floor ends a metre farther out; scenes are a few metres wide.
pub const WORLD_RADIUS_M: f64 = 14.0;
/// Depth below the floor at which a body has left the world. Unit: metres. Contacts penetrate by a
/// few millimetres at most.
pub const WORLD_DEPTH_M: f64 = 0.3;

/// An invalid state of the simulation, never caused by the robot's behaviour.
#[derive(Debug, Clone, PartialEq)]
pub enum Fault {
    /// A pose or velocity of the body is NaN or infinite.
    NotFinite(String),
    /// The body has left the world.
    LeftWorld {
        /// The body.
        id: String,
        /// Its position. Unit: metres.
        position: [f64; 3],
    },
    /// The state, the target or a limit of this joint is not a number, or its limits contradict
    /// each other.
    Joint(String),
    /// The physics engine panicked, with these words.
    Engine(String),
    /// Another physics engine, which moved the bodies instead, can't go on.
    OtherEngine(String),
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinite(id) => write!(f, "the state of {id} is not a number"),
            Self::LeftWorld {
                id,
                position: [x, y, z],
            } => {
                write!(f, "{id} left the world at ({x:.2}, {y:.2}, {z:.2})")
            }
            Self::Joint(name) => write!(
                f,
                "the state or a limit of the joint {name} is not a valid number"
            ),
            Self::Engine(words) => write!(f, "a fault in the physics engine: {words}"),
            Self::OtherEngine(why) => write!(f, "the other physics engine can't go on: {why}"),
        }
    }
}

/// A realistic external perturbation of an object, for tests of its detection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Perturbation {
    /// The object jumps to this pose, at rest.
    Pose(Pose),
    /// Its friction coefficient changes.
    Friction(f64),
    /// It falls onto its side in place, at rest.
    Fall,
}

/// A perturbation that breaks the simulation, for tests of physics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Poison {
    /// The body's velocity becomes NaN.
    NotFinite,
    /// The body moves to this position. Unit: metres.
    Teleport([f64; 3]),
    /// The body gets this linear velocity. Unit: m/s.
    Velocity([f64; 3]),
    /// From now on, sensors see the body at this pose.
    Decoy(Pose),
}
