//! Third-party models: folders in Gazebo's layout, SDF, URDF, and their mesh files.
//!
//! An element that the simulation does not support is an error if it changes the model, and a warning if the model
//! works without it. Never: ignores an element silently, decomposes a mesh, or guesses a category.

mod body;
mod collada;
mod folder;
mod geometry;
pub(crate) mod lenient;
mod lookup;
mod mesh_file;
mod nested;
pub(crate) mod robot;
pub(crate) mod robot_inertia;
pub(crate) mod robot_tree;
mod sdf;
mod urdf;
pub(crate) mod world;
mod xml;

pub(crate) use folder::{find, read};
pub(crate) use lookup::Lookup;
