//! Reads the appearance of the links of a model, for pictures: their visual shapes, with colours.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::rc::Rc;

use crate::foreign::geometry::{check_reach, check_scale};
use crate::foreign::lookup::Lookup;
use crate::foreign::mesh_file;
use crate::foreign::xml;
use actcheck_base::{Diagnostic, Diagnostics, Severity};
use actcheck_data::{
    Colour, Mesh, ModelTree, Part, Pose, SeenLink, SeenPart, Shape, TreeColour, TreeGeometry,
    TreeLink, TreeSolid,
};

/// Reads visual shapes. Each mesh file is read once.
pub(crate) struct SeenShapes<'a> {
    lookup: &'a Lookup<'a>,
    /// The file that contains the shapes.
    path: &'a Path,
    /// Meshes by their names in the tree, with the colours of their triangles; `None` after a
    /// fault, which is reported once.
    known: BTreeMap<String, Option<Rc<SeenMesh>>>,
    /// Messages of warnings that were given.
    warned: BTreeSet<String>,
}

struct SeenMesh {
    mesh: Mesh,
    colours: Vec<Option<Colour>>,
}

impl<'a> SeenShapes<'a> {
    pub(crate) fn new(lookup: &'a Lookup<'a>, path: &'a Path) -> Self {
        Self {
            lookup,
            path,
            known: BTreeMap::new(),
            warned: BTreeSet::new(),
        }
    }

    /// Returns the visual shapes of a link. Without them, or if one has a fault, its collision
    /// shapes are returned instead if `collides`. Faults are reported as warnings.
    pub(crate) fn of_link(
        &mut self,
        link: &TreeLink,
        collides: bool,
        tree: &ModelTree,
        found: &mut Diagnostics,
    ) -> SeenLink {
        let visuals = self.all(&link.visuals, tree, found);
        if let Some(parts) = visuals.filter(|_| !link.visuals.is_empty()) {
            let has_look = parts.iter().any(SeenPart::has_look);
            return SeenLink { parts, has_look };
        }
        let solids = if collides { &link.solids[..] } else { &[] };
        // A fault of a collision shape was reported when the model was read.
        let parts = self.all(solids, tree, &mut Diagnostics::new());
        SeenLink {
            parts: parts.unwrap_or_default(),
            has_look: solids.iter().any(|solid| solid.colour.is_some()),
        }
    }

    /// As [`Self::of_link`], for a link of an object; its faults are those of the lookup.
    pub(crate) fn of_object(&mut self, link: &TreeLink, tree: &ModelTree) -> SeenLink {
        let mut found = Diagnostics::new();
        let seen = self.of_link(link, true, tree, &mut found);
        self.report(found);
        seen
    }

    /// Adds faults to those of the lookup.
    pub(crate) fn report(&self, found: Diagnostics) {
        if let Some(looks) = &self.lookup.looks {
            looks.borrow_mut().extend(found);
        }
    }

    /// Returns all shapes, or `None` if one has a fault.
    fn all(
        &mut self,
        solids: &[TreeSolid],
        tree: &ModelTree,
        found: &mut Diagnostics,
    ) -> Option<Vec<SeenPart>> {
        let mut parts = Vec::new();
        for solid in solids {
            if solid.colour != Some(TreeColour::Clear) {
                self.add(solid, tree, &mut parts, found)?;
            }
        }
        Some(parts)
    }

    fn add(
        &mut self,
        solid: &TreeSolid,
        tree: &ModelTree,
        parts: &mut Vec<SeenPart>,
        found: &mut Diagnostics,
    ) -> Option<()> {
        let pose = Pose::from_isometry(&solid.pose);
        let seen = |shape, colour| SeenPart {
            part: Part { pose, shape },
            colour,
        };
        let own = match solid.colour {
            Some(TreeColour::Whole(colour) | TreeColour::Rest(colour)) => Some(colour),
            Some(TreeColour::Clear) | None => None,
        };
        let TreeGeometry::Mesh { file, scale } = &solid.geometry else {
            parts.extend(solid.geometry.solid().map(|shape| seen(shape, own)));
            return Some(());
        };
        let mut faults = Diagnostics::new();
        let read = self.mesh(file, tree, solid, &mut faults);
        let usable = read.filter(|read| {
            check_scale(*scale, &solid.place, &mut faults).is_some()
                && check_reach(&read.mesh, *scale, &solid.place, &mut faults)
        });
        for fault in faults {
            if self.warned.insert(fault.message.clone()) {
                found.push(as_warning(fault));
            }
        }
        let usable = usable?;
        let is_whole = matches!(solid.colour, Some(TreeColour::Whole(_)));
        for (colour, mesh) in by_colour(&usable, is_whole) {
            let mesh = mesh.scaled(*scale);
            parts.push(seen(Shape::Mesh { mesh }, colour.or(own)));
        }
        Some(())
    }

    /// Returns a mesh at its own scale. `None` after a fault, which is reported the first time.
    fn mesh(
        &mut self,
        name: &str,
        tree: &ModelTree,
        solid: &TreeSolid,
        found: &mut Diagnostics,
    ) -> Option<Rc<SeenMesh>> {
        if let Some(known) = self.known.get(name) {
            return known.clone();
        }
        let read = match tree.inline_meshes.get(name) {
            Some(mesh) => Some(SeenMesh {
                mesh: mesh.clone(),
                colours: Vec::new(),
            }),
            None => self.read(name, solid, found),
        };
        let read = read.map(Rc::new);
        self.known.insert(name.to_owned(), read.clone());
        read
    }

    fn read(&self, name: &str, solid: &TreeSolid, found: &mut Diagnostics) -> Option<SeenMesh> {
        let files = self.lookup.files;
        let read = mesh_file::find(self.lookup, self.path, name);
        let placed = |fault: Diagnostic| match fault.source {
            None => fault.at(&solid.place.source, xml::tag(&solid.place)),
            Some(_) => fault,
        };
        match read.and_then(|path| mesh_file::read_seen(files, &path)) {
            Ok(read) => {
                found.extend(read.warnings.into_iter().map(placed).collect());
                Some(SeenMesh {
                    mesh: read.mesh,
                    colours: read.colours,
                })
            }
            Err(faults) => {
                found.extend(faults.into_iter().map(placed).collect());
                None
            }
        }
    }
}

/// A fault of a shape that is only seen: the simulation does not need it.
pub(crate) fn as_warning(fault: Diagnostic) -> Diagnostic {
    if fault.severity != Severity::Error {
        return fault;
    }
    let help = match &fault.help {
        Some(help) => format!("{help}; pictures show the collision shapes of its link instead"),
        None => "pictures show the collision shapes of its link instead".to_owned(),
    };
    Diagnostic {
        severity: Severity::Warning,
        ..fault
    }
    .help(help)
}

/// The parts of a mesh with the same colour; all of it, without colours, if it is to have one
/// colour.
fn by_colour(read: &SeenMesh, is_whole: bool) -> Vec<(Option<Colour>, Mesh)> {
    if is_whole || read.colours.is_empty() {
        return vec![(None, read.mesh.clone())];
    }
    let mut groups: BTreeMap<Option<Colour>, Vec<[u32; 3]>> = BTreeMap::new();
    for (corners, colour) in read.mesh.triangles.iter().zip(&read.colours) {
        groups.entry(*colour).or_default().push(*corners);
    }
    let part = |(colour, triangles)| {
        let all = Mesh {
            vertices: read.mesh.vertices.clone(),
            triangles,
        };
        (colour, all.with_used_vertices())
    };
    groups.into_iter().map(part).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mesh_is_divided_by_its_colours() {
        let red = Some(Colour([255, 0, 0]));
        let vertices = vec![
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
        ];
        let triangles = vec![[0, 1, 2], [0, 1, 3], [0, 2, 3]];
        let read = SeenMesh {
            mesh: Mesh::new(vertices, triangles).expect("it is a mesh"),
            colours: vec![red, None, red],
        };
        let parts = by_colour(&read, false);
        let counts: Vec<_> = parts
            .iter()
            .map(|(colour, mesh)| (*colour, mesh.vertices.len(), mesh.triangles.len()))
            .collect();
        assert_eq!(counts, [(None, 3, 1), (red, 4, 2)]);
        assert_eq!(by_colour(&read, true), [(None, read.mesh.clone())]);
    }
}
