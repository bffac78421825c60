//! What can go wrong with simulation itself.

use std::fmt;

use crate::base::Pose;

/// Horizontal distance from the world's origin beyond which a body has left it. Unit: metres. The floor ends a metre
/// further out; scenes are a few metres wide.
pub const WORLD_RADIUS_M: f64 = 14.0;
/// Depth below the floor at which a body has left the world. Unit: metres. Contacts never sink more than millimetres.
pub const WORLD_DEPTH_M: f64 = 0.3;

/// A state that physics must never reach. Whatever the robot did, it is not to blame.
#[derive(Debug, Clone, PartialEq)]
pub enum Fault {
    /// A pose or a velocity of the body is not a number, or infinite.
    NotFinite(String),
    /// The body is outside of the world.
    LeftWorld {
        /// Which body.
        id: String,
        /// Where it is. Unit: metres.
        position: [f64; 3],
    },
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinite(id) => write!(f, "the state of {id} is not a number"),
            Self::LeftWorld { id, position: [x, y, z] } => {
                write!(f, "{id} left the world at ({x:.2}, {y:.2}, {z:.2})")
            }
        }
    }
}

/// Something that happens to an object by no doing of the robot's, for tests of what notices it. It can happen in reality.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mishap {
    /// The object is somewhere else from one moment to the next, at rest.
    Pose(Pose),
    /// Its friction coefficient is another one.
    Friction(f64),
    /// It lies on its side where it stood, at rest.
    Fall,
}

/// A disturbance that breaks simulation, for tests of physics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Poison {
    /// The body's velocity becomes NaN.
    NotFinite,
    /// The body is put somewhere. Unit: metres.
    Teleport([f64; 3]),
    /// The body gets a velocity, without turning. Unit: m/s.
    Velocity([f64; 3]),
    /// Sensors see the body here from now on, wherever it is.
    Decoy(Pose),
}
