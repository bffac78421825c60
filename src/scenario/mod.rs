//! A recorded list of choices to one concrete `Scene`, and what "simpler" means.
//!
//! Simpler is closer to nominal: the first model of each list, in the middle, not turned, with the mass and friction of
//! its model; the fewest other objects, each at its own place around the middle; the robot straight in front of the
//! surface. A choice that a record lacks has its nominal value, so that a shorter record is a simpler scene. The
//! nominal values stand where the choices are made, in `draw.rs`.
//!
//! Never: simulates, knows a robot's reach or skill, or draws what a run's sensors get wrong.

mod draw;
mod floor;
mod floor_plan;
mod overlap;
mod parameters;
mod placement;
mod scene;
mod scene_map;
mod space;
mod surroundings;

pub use draw::{Discard, draw};
pub use floor_plan::{FloorPlan, Outline};
pub use overlap::{CLEARANCE_M, Solid};
pub use parameters::{Parameter, ParameterKind};
pub use scene::{KnownKind, RobotStart, Role, Scene, SceneObject};
pub use scene_map::{NamedSurface, SceneMap};
pub use space::Space;

// What a scene is made of: its readers meet it here.
pub use crate::config::{
    Budget, CONTROL_HZ, Camera, Inertia, Location, Mesh, ObjectModel, Odometry, Part, Physics, RobotProfile, Room,
    Sensing, Shape, Surface,
};

// Tests of the stages that follow begin with a robot as a configuration reads it.
#[cfg(test)]
pub(crate) use crate::config::robot::read as read_robot;
