//! Third-party models: folders in Gazebo's layout, SDF, URDF, and their mesh files.
//!
//! An element that the simulation does not support is an error if it changes the model, and a
//! warning if the model works without it. The faces of a building become plates. Never: ignores an
//! element silently, decomposes a mesh by its volume, or guesses a category.

mod assembly;
mod body;
mod building;
mod collada;
mod colours;
mod elements;
#[cfg(test)]
mod files_for_tests;
mod folder;
mod footprint;
mod frames;
mod fronts;
mod geometry;
mod gltf;
mod gltf_document;
mod hull;
#[cfg(test)]
mod included_tests;
mod inclusions;
pub(crate) mod lenient;
mod lookup;
mod mesh_file;
pub(crate) mod mjcf;
mod mjcf_budget;
mod mjcf_compiler;
mod mjcf_couplings;
mod mjcf_elements;
mod mjcf_geoms;
mod mjcf_graft;
mod mjcf_loops;
mod mjcf_masks;
#[cfg(test)]
mod mjcf_tests;
mod mjcf_world;
mod nested;
pub(crate) mod robot;
pub(crate) mod robot_inertia;
pub(crate) mod robot_shapes;
mod sdf;
mod sdf_ends;
mod sdf_inertial;
mod sdf_joint;
mod sdf_link;
mod sdf_pose;
mod sdf_robot;
mod sdf_robot_include;
mod sdf_robot_joint;
mod sdf_robot_link;
mod sdf_robot_model;
#[cfg(test)]
mod sdf_robot_tests;
mod sdf_robot_tree;
mod sdf_surface;
mod seen;
#[cfg(test)]
mod seen_tests;
mod solid_mass;
#[cfg(test)]
mod stated_tests;
mod tree_checks;
mod tree_object;
mod urdf;
mod urdf_extra;
mod urdf_tree;
mod urdf_writer;
mod words;
pub(crate) mod world;
mod world_state;
mod xml;

pub(crate) use folder::{Found, find, read, seen as seen_object};
pub(crate) use lookup::Lookup;

/// Returns the name of the first element of an XML text.
pub(crate) fn root_name(text: &str) -> Option<&str> {
    let mut rest = text.trim_start_matches('\u{feff}').trim_start();
    loop {
        let end = if rest.starts_with("<!--") {
            "-->"
        } else if rest.starts_with("<?") || rest.starts_with("<!") {
            ">"
        } else {
            break;
        };
        rest = rest[rest.find(end)? + end.len()..].trim_start();
    }
    let name = rest.strip_prefix('<')?;
    name.split(|c: char| c.is_whitespace() || c == '>' || c == '/')
        .next()
}
