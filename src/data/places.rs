//! Named places of a world.

use serde::{Deserialize, Serialize};

/// Radius of the floor on which a base can be. Unit: metres. Frame: world. A body that is a metre
/// farther out has left the world.
pub const FLOOR_M: f64 = 13.0;

/// Robots drive below furniture that begins higher above the floor, such as lintels, lamps and
/// ceilings. Unit: metres. The height of a door, less rounding.
pub const OVERHEAD_M: f64 = 1.99;

/// A named pose on the floor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Location {
    /// Unique among the world's locations.
    pub name: String,
    /// Units: metres, metres, radians. Shape: x, y, heading.
    pub at: [f64; 3],
    /// Name of the surface that it is in front of, if any.
    pub surface: Option<String>,
}

/// A room.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Room {
    /// Unique among the world's rooms.
    pub name: String,
    /// Lowest x and y. Unit: metres.
    pub low_m: [f64; 2],
    /// Highest x and y. Unit: metres.
    pub high_m: [f64; 2],
}
