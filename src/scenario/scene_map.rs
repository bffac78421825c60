//! The names of a scene's places: what a robot's map of its world would have.

use serde::{Deserialize, Serialize};

use crate::config::{Location, Room};
use crate::scenario::surroundings::Surroundings;

/// Named places of a world; empty where a scene lies on a floor with nothing else. Frame: world.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct SceneMap {
    /// Places where a robot can be sent.
    pub locations: Vec<Location>,
    /// Rooms.
    pub rooms: Vec<Room>,
    /// Tops of furniture.
    pub surfaces: Vec<NamedSurface>,
}

/// A level rectangle on furniture, about the middle of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NamedSurface {
    /// Id of the furniture.
    pub id: String,
    /// Middle. Unit: metres. Shape: x, y, z.
    pub at: [f64; 3],
    /// Unit: metres. Shape: along the furniture's x, along its y.
    pub size_m: [f64; 2],
}

impl SceneMap {
    /// The map of a world.
    pub(super) fn of(world: &Surroundings) -> Self {
        let surfaces = world.surfaces().filter_map(|object| {
            let surface = object.model.surface?;
            let [x, y, z] = object.pose.position;
            Some(NamedSurface { id: object.id.clone(), at: [x, y, z + surface.height_m], size_m: surface.size_m })
        });
        Self { locations: world.map.locations.clone(), rooms: world.map.rooms.clone(), surfaces: surfaces.collect() }
    }

    /// Whether there is nothing to tell.
    pub fn is_empty(&self) -> bool {
        self.locations.is_empty() && self.rooms.is_empty() && self.surfaces.is_empty()
    }

    /// The first room that holds a point of the floor.
    pub fn room_of(&self, x: f64, y: f64) -> Option<&Room> {
        self.rooms
            .iter()
            .find(|room| (room.low_m[0]..=room.high_m[0]).contains(&x) && (room.low_m[1]..=room.high_m[1]).contains(&y))
    }
}
