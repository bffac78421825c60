//! Worlds in Gazebo's format: the models that they include, standing still, with a location in front of each surface.

use nalgebra::{Isometry3, Point3, Vector3};

use crate::base::{Diagnostics, Pose, Source, did_you_mean, digest_of};
use crate::config::foreign::sdf::{check_version, pose};
use crate::config::foreign::xml::{self, Node, Reader};
use crate::config::{Furniture, Location, ObjectModel, WorldMap};

/// Elements of a world that have no bearing on what stands where, or are there anyway: light, how Gazebo looks and steps.
const WITHOUT_BEARING: [&str; 16] = [
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
/// Included models that every world of ours has: a floor and light.
const ALWAYS_THERE: [&str; 2] = ["ground_plane", "sun"];
/// Gap between the edge of a surface and the middle of a robot's base that works at it. Unit: metres.
const FRONT_GAP_M: f64 = 0.69;
/// A model that leans by more than this can't stand in a world. Unit: cosine.
const UPRIGHT_COSINE: f64 = 0.999;

/// Reads a Gazebo world. Models are looked up by `model`, and are the same as those that configurations name.
///
/// # Errors
/// Every fault of the text: it is not XML (W031) or no world (W032), includes models that are not there (W040), has two
/// things of one name (W041), or says what has no counterpart (W035).
pub(crate) fn read<'a>(
    name: &str,
    source: &Source,
    model: impl Fn(&str) -> Option<&'a ObjectModel>,
    known: &[String],
) -> (Option<WorldMap>, Diagnostics) {
    let document = match xml::parse(source) {
        Ok(document) => document,
        Err(faults) => return (None, faults),
    };
    let mut reader = Reader::new(source);
    let mut map = WorldMap { digest: digest_of(&source.text), ..WorldMap::nothing(name) };
    let root = document.root_element();
    if check_version(root, &mut reader).is_some()
        && let Some(world) = reader.required(root, "world")
    {
        reader.leaves_out(world, &WITHOUT_BEARING);
        for inline in xml::children(world, "model").filter(|inline| !is_floor(*inline)) {
            let message = "a model that is written into a world is not read".to_owned();
            reader.error(
                "W035",
                inline,
                message,
                "give it a folder of its own and include it: `<include><uri>model://NAME</uri></include>`",
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

/// Whether a model of a world is a floor: a level plane.
fn is_floor(model: Node) -> bool {
    model.descendants().any(|node| node.tag_name().name() == "plane")
}

fn read_include<'a>(
    include: Node,
    model: &impl Fn(&str) -> Option<&'a ObjectModel>,
    known: &[String],
    reader: &mut Reader,
) -> Option<Furniture> {
    reader.leaves_out(include, &["uri", "name", "pose", "static"]);
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
        let message = format!("`{named}` may move in Gazebo, and stands still in a world here");
        reader.warning(
            "W036",
            include,
            message,
            "what shall move belongs into `[surfaceObjects]` or `nav_obstacle_list`",
        );
    }
    let at = pose(include, reader)?;
    if (at.rotation * Vector3::z()).z < UPRIGHT_COSINE {
        reader.error("W035", include, "a model that leans can't stand in a world".to_owned(), "turn it about z alone");
        return None;
    }
    let name = xml::child(include, "name").map_or(named, xml::text);
    // Our models have their origin below their middle, and the file's may be elsewhere.
    let foot = at * Point3::from(included.origin_m.map(|x| -x));
    Some(Furniture { name: name.to_owned(), model: named.to_owned(), pose: upright(&at, foot) })
}

fn upright(at: &Isometry3<f64>, foot: Point3<f64>) -> Pose {
    Pose::upright([foot.x, foot.y, foot.z], Pose::from_isometry(at).yaw())
}

/// The place in front of a surface, where a robot stands to work on it.
fn front(piece: &Furniture, model: Option<&ObjectModel>) -> Option<Location> {
    let surface = model?.surface?;
    let at = piece.pose.to_isometry() * Point3::new(-surface.size_m[0] / 2.0 - FRONT_GAP_M, 0.0, 0.0);
    Some(Location {
        name: format!("{}_front", piece.name),
        at: [at.x, at.y, piece.pose.yaw()],
        surface: Some(piece.name.clone()),
    })
}
