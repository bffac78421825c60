//! The part of an attached model in MJCF that another one takes, with new names.

use std::collections::BTreeSet;

use crate::foreign::mjcf_compiler::is_absolute;
use actcheck_data::{ModelTree, TreeGeometry};

/// The part of a tree that is attached to another, with new names.
pub(super) struct Graft<'a> {
    pub(super) prefix: &'a str,
    /// Folder of its file, relative to that of the other.
    pub(super) folder: &'a str,
    /// The body whose subtree is taken; `None` for all.
    pub(super) body: Option<&'a str>,
}

impl Graft<'_> {
    /// Returns the part below its root; `None` if the tree lacks the body.
    pub(super) fn of(&self, mut tree: ModelTree) -> Option<ModelTree> {
        let root = tree.links.first()?.name.clone();
        if let Some(body) = self.body {
            let mut kept = BTreeSet::from([body.to_owned()]);
            // The links between a body's joints are its own.
            let mut above = body.to_owned();
            while let Some(joint) = tree.joints.iter().find(|joint| joint.child == above)
                && joint.parent != root
                && joint.parent.starts_with(&format!("{body}_"))
            {
                above.clone_from(&joint.parent);
                kept.insert(above.clone());
            }
            for joint in &mut tree.joints {
                if joint.child == above {
                    joint.parent.clone_from(&root);
                }
            }
            loop {
                let n_known = kept.len();
                let below = tree
                    .joints
                    .iter()
                    .filter(|joint| kept.contains(&joint.parent));
                let below: Vec<String> = below.map(|joint| joint.child.clone()).collect();
                kept.extend(below);
                if kept.len() == n_known {
                    break;
                }
            }
            tree.link(body)?;
            tree.joints.retain(|joint| kept.contains(&joint.child));
            tree.links
                .retain(|link| link.name == root || kept.contains(&link.name));
            if let Some(world) = tree.links.first_mut() {
                (world.solids, world.visuals) = (Vec::new(), Vec::new());
            }
            tree.passing
                .retain(|pair| pair.iter().all(|name| kept.contains(name)));
        }
        self.rename(&mut tree, &root);
        Some(tree)
    }

    fn rename(&self, tree: &mut ModelTree, root: &str) {
        let named = |name: &mut String| {
            if name != root {
                name.insert_str(0, self.prefix);
            }
        };
        for link in &mut tree.links {
            named(&mut link.name);
            for solid in link.solids.iter_mut().chain(&mut link.visuals) {
                if let TreeGeometry::Mesh { file, .. } = &mut solid.geometry {
                    if tree.inline_meshes.contains_key(file) {
                        file.insert_str(0, self.prefix);
                    } else if !self.folder.is_empty() && !is_absolute(file) {
                        *file = format!("{}/{file}", self.folder);
                    }
                }
            }
        }
        for joint in &mut tree.joints {
            joint.name.insert_str(0, self.prefix);
            named(&mut joint.parent);
            named(&mut joint.child);
            if let Some(mimic) = &mut joint.mimic {
                mimic.leader.insert_str(0, self.prefix);
            }
        }
        tree.passing.iter_mut().flatten().for_each(named);
        let meshes = std::mem::take(&mut tree.inline_meshes);
        tree.inline_meshes = meshes
            .into_iter()
            .map(|(name, mesh)| (format!("{}{name}", self.prefix), mesh))
            .collect();
    }
}
