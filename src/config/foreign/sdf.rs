//! Reads SDF models, Gazebo's format.

use std::collections::BTreeMap;
use std::path::Path;

use crate::foreign::body::{Role, SdfModel};
use crate::foreign::geometry::Shapes;
use crate::foreign::inclusions::Inclusions;
use crate::foreign::lenient::repaired;
use crate::foreign::lookup::Lookup;
use crate::foreign::nested::{SubModel, Tree};
use crate::foreign::sdf_pose::{self, pose};
use crate::foreign::xml::{self, Node, Reader};
use actcheck_base::{Diagnostics, Source};

/// Supported minor versions of SDF 1.
const VERSIONS: std::ops::RangeInclusive<u32> = 3..=12;

/// Reads the object of an SDF file and its faults. The model is `None` if there are errors.
pub(crate) fn read(
    source: &Source,
    path: &Path,
    lookup: &Lookup,
) -> (Option<SdfModel>, Diagnostics) {
    let shapes = Shapes::new(lookup, path);
    read_with(source, shapes, |model, shapes, reader| {
        let pose = pose(model, reader)?;
        let body =
            Tree::read(model, Role::Object, false, shapes, reader).into_body(Role::Object, reader);
        if body.parts.is_empty() && !reader.found.has_errors() {
            let message =
                "the model has no solid shape: none of its links has a `<collision>`".to_owned();
            let help = "give a link a `<collision>`; a `<visual>` does not collide";
            reader.error("W038", model, message, help);
        }
        Some(SdfModel {
            is_static: body.fixed,
            body,
            frames: BTreeMap::new(),
            pose,
            digest: shapes.digest.clone().finish(),
        })
    })
}

/// Reads the model of an SDF file that others include, as its links, and its faults. It is `None` if
/// there are errors.
pub(crate) fn read_included(
    source: &Source,
    path: &Path,
    lookup: &Lookup,
    (role, fixed): (Role, bool),
    inclusions: Inclusions,
) -> (Option<SubModel>, Diagnostics) {
    let shapes = Shapes {
        inclusions,
        ..Shapes::new(lookup, path)
    };
    read_with(source, shapes, |model, shapes, reader| {
        let is_static = is_static(model, reader);
        let tree = Tree::read(model, role, fixed || is_static, shapes, reader);
        Some(SubModel {
            tree,
            place: sdf_pose::place(model, reader)?,
            is_static,
            digest: shapes.digest.clone().finish(),
        })
    })
}

/// Reads the only model of a file. Returns `None` if there are errors.
fn read_with<T>(
    source: &Source,
    mut shapes: Shapes,
    read: impl FnOnce(Node, &mut Shapes, &mut Reader) -> Option<T>,
) -> (Option<T>, Diagnostics) {
    let text = repaired(&source.text);
    let document = match xml::parse_model(source, &text) {
        Ok(document) => document,
        Err(faults) => return (None, faults),
    };
    let mut reader = Reader::new(source);
    shapes.digest.update(source.text.as_bytes());
    let model = root_model(document.root_element(), &mut reader)
        .and_then(|model| read(model, &mut shapes, &mut reader));
    let found = reader.found;
    (model.filter(|_| !found.has_errors()), found)
}

/// Returns the only model of a document.
pub(super) fn root_model<'a>(root: Node<'a>, reader: &mut Reader) -> Option<Node<'a>> {
    check_version(root, reader)?;
    let models: Vec<Node> = xml::children(root, "model").collect();
    match models.as_slice() {
        [model] => Some(*model),
        [] => {
            let message = "the file contains no `<model>`".to_owned();
            reader.error(
                "W032",
                root,
                message,
                "a file with a `<world>` belongs in the folder `worlds`",
            );
            None
        }
        [_, second, ..] => {
            let message = format!("the file contains {} models", models.len());
            reader.error(
                "W032",
                *second,
                message,
                "give each model a folder of its own",
            );
            None
        }
    }
}

/// Returns `Some` if the root is SDF of a supported version; otherwise reports W032.
pub(crate) fn check_version(root: Node, reader: &mut Reader) -> Option<()> {
    reader.root(
        root,
        "sdf",
        "an SDF file begins with `<sdf version=\"1.6\">`",
    )?;
    let version = reader.attribute(root, "version")?;
    let minor = version
        .strip_prefix("1.")
        .and_then(|minor| minor.parse::<u32>().ok());
    if minor.is_some_and(|minor| VERSIONS.contains(&minor)) {
        return Some(());
    }
    let message = format!("SDF {version} is not supported");
    reader.error(
        "W032",
        root,
        message,
        format!(
            "use a version from 1.{} to 1.{}",
            VERSIONS.start(),
            VERSIONS.end()
        ),
    );
    None
}

/// Whether an element says that its model never moves.
pub(crate) fn is_static(model: Node, reader: &mut Reader) -> bool {
    xml::child(model, "static").is_some_and(|node| reader.boolean(node).unwrap_or(false))
}
