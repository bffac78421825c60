//! Converts a world in MJCF to URDF, one object for each body.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Isometry3;

use crate::foreign::mjcf::{Robot, unique, with_robot};
use crate::foreign::urdf::Materials;
use crate::foreign::xml::{self, Node};
use actcheck_base::{Diagnostics, Source};

/// A body, or a solid without a body, at the top of a world.
pub(crate) struct Piece {
    pub(crate) name: String,
    pub(crate) urdf: Source,
    pub(crate) materials: Materials,
    /// Whether it can move freely.
    pub(crate) moves: bool,
}

/// Converts the text of a world, one object for each body at its top.
///
/// # Errors
/// Faults of the text: W031 to W036, W055.
pub(crate) fn read(
    source: &Source,
    path: &Path,
    files: &actcheck_base::Files,
) -> Result<Vec<Piece>, Diagnostics> {
    with_robot(source, path, files, |root, robot, reader| {
        let mut pieces = Vec::new();
        let Some(worldbody) = xml::child(root, "worldbody") else {
            return pieces;
        };
        let mut names = BTreeMap::new();
        let mut named = |written: Option<&str>, otherwise: &str| {
            let mut name = unique(&mut names, written.unwrap_or(otherwise));
            // Names are parts of names of models and locations.
            name.retain(|letter| !letter.is_control() && letter != '/');
            name
        };
        for body in xml::children(worldbody, "body") {
            let free = |joint: &Node| {
                joint.has_tag_name("freejoint") || joint.attribute("type") == Some("free")
            };
            let moves = body.children().any(|child| free(&child));
            let mut own = robot.alone();
            let world = own.unique("world");
            own.out.link(&world, None, &[]);
            own.body(body, &world, &Isometry3::identity(), None, reader);
            pieces.push(own.piece(named(body.attribute("name"), "body"), reader.source, moves));
        }
        for geom in xml::children(worldbody, "geom") {
            let mut own = robot.alone();
            if let Some((pose, shape, _)) = own.solid(geom, &Isometry3::identity(), None, reader) {
                own.out.link("solid", None, &[(pose, shape)]);
                pieces.push(own.piece(
                    named(geom.attribute("name"), "solid"),
                    reader.source,
                    false,
                ));
            }
        }
        pieces
    })
}

impl Robot {
    fn piece(self, name: String, source: &Source, moves: bool) -> Piece {
        let urdf = Source::new(
            format!("{} (`{name}` as URDF)", source.name),
            self.out.finish(&name),
        );
        Piece {
            name,
            urdf,
            materials: self.materials.unwrap_or_default(),
            moves,
        }
    }
}
