//! The robot's map of the floor.
//!
//! Never: contains objects that a scene adds to its world. The robot perceives obstacles and
//! objects with its sensors.

use nalgebra::Point3;

use actcheck_data::{Location, OVERHEAD_M, ObjectModel, Pose, Role, Room, Scene, SceneObject};

/// Gap between a surface's edge and the centre of a base in front of it. Unit: metres.
pub(super) const FRONT_GAP_M: f64 = 0.69;

/// Walls, furniture and named locations. Frame: world.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FloorPlan {
    /// Areas that no robot can enter.
    pub outlines: Vec<Outline>,
    /// Named locations.
    pub locations: Vec<Location>,
    /// Rooms; empty if the floor is unbounded.
    pub rooms: Vec<Room>,
    /// Poses of the base for working at a surface. Units: metres, metres, radians. Shape: id and x,
    /// y, heading.
    pub fronts: Vec<(String, [f64; 3])>,
}

/// The bounding rectangle of a wall or a piece of furniture on the floor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outline {
    /// Centre of the rectangle, upright.
    pub pose: Pose,
    /// Lengths of the sides along the pose's axes. Unit: metres.
    pub size_m: [f64; 2],
}

impl FloorPlan {
    /// The map of a scene's world.
    pub fn of(scene: &Scene) -> Self {
        let surfaces = furniture(&scene.objects).filter(|object| object.model.surface.is_some());
        Self {
            outlines: outlines(&scene.objects).collect(),
            locations: scene.map.locations.clone(),
            rooms: scene.map.rooms.clone(),
            fronts: surfaces
                .map(|object| (object.id.clone(), front_of(object)))
                .collect(),
        }
    }

    /// Returns the pose of the base at a location, or in front of a surface, by name. Returns
    /// `None` if the map has no such place.
    pub fn place(&self, name: &str) -> Option<[f64; 3]> {
        let location = self
            .locations
            .iter()
            .find(|location| location.name == name)
            .map(|location| location.at);
        location.or_else(|| {
            self.fronts
                .iter()
                .find(|(id, _)| id == name)
                .map(|(_, at)| *at)
        })
    }
}

fn furniture(objects: &[SceneObject]) -> impl Iterator<Item = &SceneObject> {
    objects
        .iter()
        .filter(|object| object.role == Role::Platform)
}

/// The outlines of walls and furniture that a robot can't drive below.
pub(super) fn outlines(objects: &[SceneObject]) -> impl Iterator<Item = Outline> {
    let in_the_way = furniture(objects).filter(|object| object.pose.position[2] < OVERHEAD_M);
    in_the_way.map(|object| Outline::below(&object.model, &object.pose))
}

impl Outline {
    /// The outline of a model at a pose.
    pub(super) fn below(model: &ObjectModel, pose: &Pose) -> Self {
        let mut around = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for part in &model.parts {
            let (low, high) = part.bounds();
            for axis in 0..2 {
                around.0[axis] = around.0[axis].min(low[axis]);
                around.1[axis] = around.1[axis].max(high[axis]);
            }
        }
        let (low, high) = if model.parts.is_empty() {
            ([0.0; 2], [0.0; 2])
        } else {
            around
        };
        let middle = pose.to_isometry()
            * Point3::new((low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0, 0.0);
        let upright = Pose::upright([middle.x, middle.y, 0.0], pose.yaw());
        Self {
            pose: upright,
            size_m: [high[0] - low[0], high[1] - low[1]],
        }
    }
}

/// The pose of the base in front of a platform, on its negative x side and facing it.
pub(super) fn front_of(platform: &SceneObject) -> [f64; 3] {
    let edge = platform
        .model
        .surface
        .map_or(0.0, |surface| surface.size_m[0] / 2.0);
    let at = platform.pose.to_isometry() * Point3::new(-edge - FRONT_GAP_M, 0.0, 0.0);
    [at.x, at.y, platform.pose.yaw()]
}
