//! Turns a list of choices into one concrete `Scene`, and defines which scenes are simpler.
//!
//! Simpler is closer to nominal: the first model of each list, in the centre, with yaw 0 and the
//! mass and friction of its model; the fewest other objects, each at its own place around the
//! centre; the robot straight in front of the surface. A choice missing from a record has its
//! nominal value, so that a shorter record is a simpler scene. The nominal values are set where the
//! choices are made, in `draw.rs`.
//!
//! Never: simulates, depends on a robot's reach or skill, or draws sensor noise.

mod draw;
mod floor;
mod floor_plan;
mod kept_free;
mod overlap;
mod parameters;
mod placement;
mod space;
mod step_values;
mod surroundings;

pub use draw::{Discard, draw};
pub use floor_plan::{FloorPlan, Outline};
pub use kept_free::is_blocked;
pub use overlap::{CLEARANCE_M, Solid, convex_shape};
pub use parameters::{Parameter, ParameterKind};
pub use space::Space;
