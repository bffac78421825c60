//! The named places of a scene, as on a robot's map of its world.

use serde::{Deserialize, Serialize};

use crate::{Location, Room};

/// Named places of a world; empty for a scene on an empty floor. Frame: world.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct SceneMap {
    /// Locations to which a robot can be sent.
    pub locations: Vec<Location>,
    /// Rooms.
    pub rooms: Vec<Room>,
    /// Surfaces of furniture.
    pub surfaces: Vec<NamedSurface>,
}

/// A horizontal rectangle centred on a piece of furniture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NamedSurface {
    /// Id of the furniture.
    pub id: String,
    /// Centre. Unit: metres. Shape: x, y, z.
    pub at: [f64; 3],
    /// Size along the furniture's axes. Unit: metres. Shape: x, y.
    pub size_m: [f64; 2],
}

impl SceneMap {
    /// Whether the map has no named places.
    pub fn is_empty(&self) -> bool {
        self.locations.is_empty() && self.rooms.is_empty() && self.surfaces.is_empty()
    }

    /// Returns the first room that contains a point of the floor, or `None`.
    pub fn room_of(&self, x: f64, y: f64) -> Option<&Room> {
        self.rooms.iter().find(|room| {
            (room.low_m[0]..=room.high_m[0]).contains(&x)
                && (room.low_m[1]..=room.high_m[1]).contains(&y)
        })
    }
}
