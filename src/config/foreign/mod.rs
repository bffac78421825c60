//! Other people's models: folders in Gazebo's layout, SDF, URDF, and the mesh files that they name.
//!
//! What a file says and simulation has no counterpart for is an error where it changes what the thing is, and a warning
//! where the thing works without it. Never: leaves out anything in silence, takes a mesh apart, or guesses a category.

mod body;
mod collada;
mod folder;
mod geometry;
mod lookup;
mod mesh_file;
pub(crate) mod robot;
pub(crate) mod robot_tree;
mod sdf;
mod urdf;
pub(crate) mod world;
mod xml;

pub(crate) use folder::{find, read};
pub(crate) use lookup::Lookup;
