//! Reads a world in MJCF, one object for each body at its top.

use std::collections::BTreeMap;
use std::path::Path;
use std::rc::Rc;

use nalgebra::Isometry3;

use crate::foreign::lookup::Lookup;
use crate::foreign::mjcf::{File, Model, Purpose, unique, with_model};
use crate::foreign::mjcf_budget::Budget;
use crate::foreign::xml::{self, Node, Reader};
use actcheck_base::{Diagnostics, Source};
use actcheck_data::{ModelTree, TreeJoint, TreeLink, TreeMotion};

/// A body, or a solid without a body, at the top of a world.
pub(crate) struct Piece {
    pub(crate) name: String,
    pub(crate) tree: ModelTree,
    /// Whether it can move freely.
    pub(crate) moves: bool,
}

/// Reads the text of a world, one object for each body at its top. Also returns the text with all
/// included files, and warnings.
///
/// # Errors
/// Faults of the text: W031 to W037, W051, W055.
pub(crate) fn read(
    source: &Source,
    path: &Path,
    lookup: &Lookup,
) -> Result<(Vec<Piece>, Source, Diagnostics), Diagnostics> {
    let budget = Budget::default();
    let file = File::first(path, lookup, &budget);
    with_model(source, file, Purpose::World, |root, model, reader| {
        let mut names = BTreeMap::new();
        let worlds = xml::children(root, "worldbody");
        worlds
            .flat_map(|world| pieces(world, &model, &mut names, reader))
            .collect()
    })
}

fn pieces(
    worldbody: Node,
    model: &Model,
    names: &mut BTreeMap<String, u32>,
    reader: &mut Reader,
) -> Vec<Piece> {
    let mut named = |written: Option<String>, otherwise: &str| {
        let mut name = unique(names, written.as_deref().unwrap_or(otherwise));
        // Names are parts of names of models and locations.
        name.retain(|letter| !letter.is_control() && letter != '/');
        name
    };
    let mut found = Vec::new();
    let compiler = Rc::clone(&model.compiler);
    for item in compiler.content(
        worldbody,
        worldbody.attribute("childclass"),
        model.file.budget,
        reader,
    ) {
        let mut own = model.alone();
        let world = own.unique("world");
        own.link(TreeLink::frame(world.clone(), reader.place(item.node)));
        let name = if item.is("geom") {
            let at = Isometry3::identity();
            let [solids, _] = own.geoms(std::slice::from_ref(&item), &at, reader);
            if solids.is_empty() {
                continue;
            }
            own.tree.links[0].solids = solids;
            named(item.name(), "solid")
        } else {
            let at = Isometry3::identity();
            own.children(std::slice::from_ref(&item), &world, &at, reader);
            let name = if item.is("attach") {
                item.node.attribute("body").or(item.node.attribute("model"))
            } else {
                None
            };
            let prefix = item.node.attribute("prefix").unwrap_or_default();
            let attached = name.map(|name| format!("{prefix}{name}{}", item.suffix));
            match item.node.tag_name().name() {
                "body" => named(item.name(), "body"),
                "attach" => named(attached, "body"),
                // Sites, cameras and lights, and refused elements.
                _ => continue,
            }
        };
        let is_free = |joint: &TreeJoint| joint.motion == TreeMotion::Floating;
        let moves = own.tree.joints.iter().any(is_free);
        own.weigh(reader);
        own.tree.name.clone_from(&name);
        found.push(Piece {
            name,
            tree: own.tree,
            moves,
        });
    }
    found
}
