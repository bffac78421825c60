//! Shapes, hulls, distances and depths, in 64 bits where the library of shapes has 32.
//!
//! Never: knows the physics engine, a robot's joints, or a scene.

#![forbid(unsafe_code)]
#![warn(missing_docs, clippy::unwrap_used)]

mod ball;
mod convert;
mod convex;
mod decompose;
mod hull;
mod neighbours;
mod rays;
mod render;
mod separation;
mod silhouette;
mod solid_depth;
mod solids;
mod sphere_tree;
mod surface;

pub use ball::Ball;
pub use convert::{from_pose, from_vector, to_pose, to_real, to_vector};
pub use convex::{convex_shape, has_volume};
pub use decompose::{DecompositionFault, decompose, decomposition_key, sheet, simplified};
pub use hull::Hull;
pub use neighbours::{Corners, Neighbours, SURE_M};
pub use rays::{Hit, Lens, RayScene};
pub use render::{Drawn, Finish, Light, RgbImage, Skin, draw};
pub use separation::{Separation, SeparationOutcome, SolidPair};
pub use solid_depth::{Material, Piece, solid_depth_m};
pub use solids::{BodySolids, Directions, Turned, gap, is_closer};
pub use sphere_tree::{Cluster, Sphere, sphere_tree};
pub use surface::spread;
