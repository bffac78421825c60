//! Reads Gazebo worlds: their included models as static furniture, with a location in front of each surface.

use nalgebra::{Isometry3, Point3, Vector3};

use crate::foreign::sdf::{check_version, pose};
use crate::foreign::xml::{self, Node, Reader};
use crate::{Furniture, WorldMap};
use actcheck_base::{Diagnostics, Source, did_you_mean, digest_of};
use actcheck_data::{Location, ObjectModel, Pose};

/// Elements of a world that are read, or that do not affect its geometry: light, Gazebo's display and time steps.
const KNOWN: [&str; 16] = [
    "include",
    "model",
    "light",
    "scene",
    "gui",
    "physics",
    "gravity",
    "magnetic_field",
    "atmosphere",
    "wind",
    "state",
    "spherical_coordinates",
    "audio",
    "plugin",
    "road",
    "name",
];
/// Included models to skip: every world already has a floor and light.
const ALWAYS_THERE: [&str; 2] = ["ground_plane", "sun"];
/// Distance between the edge of a surface and the middle of the base of a robot working at it. Unit: metres.
const FRONT_GAP_M: f64 = 0.69;
/// A model that is tilted by more than this is rejected. Unit: cosine.
const UPRIGHT_COSINE: f64 = 0.999;

/// Reads a Gazebo world. `model` looks up the models that configurations can also name. The world is `None` if there
/// are errors.
///
/// # Errors
/// All faults of the text: it is not XML (W031) or not SDF of a supported version (W032), lacks an element (W033), has
/// an invalid value (W034) or an unsupported element (W035), includes a missing model (W040), or has a duplicate name
/// (W041).
pub(crate) fn read<'a>(
    name: &str,
    source: &Source,
    model: impl Fn(&str) -> Option<&'a ObjectModel>,
    known: &[String],
) -> (Option<WorldMap>, Diagnostics) {
    let document = match xml::parse_model(source) {
        Ok(document) => document,
        Err(faults) => return (None, faults),
    };
    let mut reader = Reader::new(source);
    let mut map = WorldMap { digest: digest_of(&source.text), ..WorldMap::floor_only(name) };
    let root = document.root_element();
    if check_version(root, &mut reader).is_some()
        && let Some(world) = reader.required(root, "world")
    {
        reader.warn_about_unknown_children(world, &KNOWN);
        for inline in xml::children(world, "model").filter(|inline| !is_floor(*inline)) {
            let message = "a model defined inside a world is not supported".to_owned();
            reader.error(
                "W035",
                inline,
                message,
                "move it to its own folder and include it: `<include><uri>model://NAME</uri></include>`",
            );
        }
        for include in xml::children(world, "include") {
            if let Some(piece) = read_include(include, &model, known, &mut reader) {
                if map.furniture.iter().any(|other| other.name == piece.name) {
                    let message = format!("there are two `{}`", piece.name);
                    reader.error("W041", include, message, "give one of them another `<name>`");
                }
                map.locations.extend(front(&piece, model(&piece.model)));
                map.furniture.push(piece);
            }
        }
    }
    let found = reader.found;
    let complete = !found.has_errors();
    (complete.then_some(map), found)
}

/// Whether a model of a world is a floor, which contains a plane.
fn is_floor(model: Node) -> bool {
    model.descendants().any(|node| node.tag_name().name() == "plane")
}

fn read_include<'a>(
    include: Node,
    model: &impl Fn(&str) -> Option<&'a ObjectModel>,
    known: &[String],
    reader: &mut Reader,
) -> Option<Furniture> {
    reader.warn_about_unknown_children(include, &["uri", "name", "pose", "static"]);
    let uri = reader.required(include, "uri")?;
    let named = xml::text(uri).trim_start_matches("model://").trim_end_matches('/');
    if ALWAYS_THERE.contains(&named) {
        return None;
    }
    let Some(included) = model(named) else {
        let message = format!("there is no usable model `{named}`");
        reader.error("W040", uri, message, did_you_mean(named, known.iter().map(String::as_str)));
        return None;
    };
    if !included.fixed && xml::child(include, "static").is_none_or(|fixed| xml::text(fixed) != "true") {
        let message = format!("`{named}` can move in Gazebo, but is static in a world here");
        reader.warning("W036", include, message, "put movable objects into `[surfaceObjects]` or `nav_obstacle_list`");
    }
    let at = pose(include, reader)?;
    if (at.rotation * Vector3::z()).z < UPRIGHT_COSINE {
        reader.error(
            "W035",
            include,
            "a tilted model is not supported in a world".to_owned(),
            "rotate it about z only",
        );
        return None;
    }
    let name = xml::child(include, "name").map_or(named, xml::text);
    // A model's origin is below its middle; the file's origin may differ.
    let foot = at * Point3::from(included.origin_m.map(|x| -x));
    Some(Furniture { name: name.to_owned(), model: named.to_owned(), pose: upright(&at, foot) })
}

fn upright(at: &Isometry3<f64>, foot: Point3<f64>) -> Pose {
    Pose::upright([foot.x, foot.y, foot.z], Pose::from_isometry(at).yaw())
}

/// Returns the location in front of a surface, from which a robot can work on it.
fn front(piece: &Furniture, model: Option<&ObjectModel>) -> Option<Location> {
    let surface = model?.surface?;
    let at = piece.pose.to_isometry() * Point3::new(-surface.size_m[0] / 2.0 - FRONT_GAP_M, 0.0, 0.0);
    Some(Location {
        name: format!("{}_front", piece.name),
        at: [at.x, at.y, piece.pose.yaw()],
        surface: Some(piece.name.clone()),
    })
}
