//! The furniture and walls of a world, for drawing scenes in it.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::draw::platform;
use actcheck_config::WorldMap;
use actcheck_data::{NamedSurface, ObjectModel, SceneMap, SceneObject};

/// Furniture within less than this leaves no floor to drive on. Unit: metres.
const NARROW_M: f64 = 2.0;
/// Length and width of the floor around such furniture. Unit: metres.
const FLOOR_M: f64 = 5.0;

/// A world with its furniture and walls as objects of a scene.
#[derive(Debug, Clone)]
pub(super) struct Surroundings {
    pub(super) map: Arc<WorldMap>,
    /// Furniture, then walls.
    standing: Vec<SceneObject>,
}

impl Surroundings {
    /// The names of its places.
    pub(super) fn scene_map(&self) -> SceneMap {
        let surfaces = self.surfaces().filter_map(|object| {
            let surface = object.model.surface?;
            let [x, y, z] = object.pose.position;
            Some(NamedSurface {
                id: object.id.clone(),
                at: [x, y, z + surface.height_m],
                size_m: surface.size_m,
            })
        });
        SceneMap {
            locations: self.map.locations.clone(),
            rooms: self.map.rooms.clone(),
            surfaces: surfaces.collect(),
        }
    }

    pub(super) fn new(map: &Arc<WorldMap>, models: &BTreeMap<String, Arc<ObjectModel>>) -> Self {
        let furniture = map.furniture.iter().filter_map(|piece| {
            let model = models.get(&piece.model)?;
            Some(platform(piece.name.clone(), Arc::clone(model), piece.pose))
        });
        let walls = map.walls.iter().enumerate().map(|(idx, wall)| {
            platform(
                format!("wall_{}", idx + 1),
                Arc::new(wall.model.clone()),
                wall.pose,
            )
        });
        Self {
            map: Arc::clone(map),
            standing: furniture.chain(walls).collect(),
        }
    }

    /// Furniture with a surface.
    pub(super) fn surfaces(&self) -> impl Iterator<Item = &SceneObject> {
        self.standing
            .iter()
            .filter(|object| object.model.surface.is_some())
    }

    /// The piece of furniture with this name. Returns `None` if it does not exist or has no
    /// surface.
    pub(super) fn surface(&self, name: &str) -> Option<&SceneObject> {
        self.surfaces().find(|object| object.id == name)
    }

    /// All furniture and walls except one.
    pub(super) fn others(&self, but: Option<&str>) -> impl Iterator<Item = &SceneObject> {
        self.standing
            .iter()
            .filter(move |object| Some(object.id.as_str()) != but)
    }

    /// The bounding rectangle of furniture and rooms: minimum and maximum x and y. Without rooms, a
    /// world whose furniture is all in one place also has the floor around it. Unit: metres.
    pub(super) fn extent(&self) -> ([f64; 2], [f64; 2]) {
        let middles = self
            .standing
            .iter()
            .map(|object| [object.pose.position[0], object.pose.position[1]]);
        let (mut low, mut high) = around(self.corners().chain(middles));
        if self.map.rooms.is_empty() {
            for axis in 0..2 {
                let side = high[axis] - low[axis];
                if side < NARROW_M {
                    // Also without any furniture.
                    let middle = if side.is_finite() {
                        f64::midpoint(low[axis], high[axis])
                    } else {
                        0.0
                    };
                    (low[axis], high[axis]) = (middle - FLOOR_M / 2.0, middle + FLOOR_M / 2.0);
                }
            }
        }
        (low, high)
    }

    /// The bounding rectangle of the rooms; `None` if the world has none. Unit: metres. Frame:
    /// world.
    pub(super) fn rooms(&self) -> Option<([f64; 2], [f64; 2])> {
        (!self.map.rooms.is_empty()).then(|| around(self.corners()))
    }

    fn corners(&self) -> impl Iterator<Item = [f64; 2]> {
        self.map
            .rooms
            .iter()
            .flat_map(|room| [room.low_m, room.high_m])
    }
}

/// Minimum and maximum coordinates of points.
fn around(points: impl Iterator<Item = [f64; 2]>) -> ([f64; 2], [f64; 2]) {
    points.fold(
        ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]),
        |(low, high), at| {
            (
                [low[0].min(at[0]), low[1].min(at[1])],
                [high[0].max(at[0]), high[1].max(at[1])],
            )
        },
    )
}
