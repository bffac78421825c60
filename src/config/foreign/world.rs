//! Reads worlds of Gazebo and MuJoCo: their models as static furniture, with a location in front of each surface.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::foreign::body::Body;
use crate::foreign::geometry::Shapes;
use crate::foreign::lenient::repaired;
use crate::foreign::lookup::Lookup;
use crate::foreign::nested::Role;
use crate::foreign::sdf::check_version;
use crate::foreign::sdf_pose::pose;
use crate::foreign::xml::{self, Node, Reader};
use crate::foreign::{folder, mjcf_world, sdf, urdf};
use crate::{Furniture, WorldMap};
use actcheck_base::{Diagnostics, Severity, Source, digest_of};
use actcheck_data::{Location, ObjectModel, Part, Pose};

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
/// A model that is tilted by more than this gets a model of its own. Unit: cosine.
const UPRIGHT_COSINE: f64 = 0.999;

/// A world, and its models that only it has.
pub(crate) struct World {
    pub(crate) map: WorldMap,
    /// Models that are defined inside the world, and included ones with another pose than the model itself. Their names
    /// begin with that of the world.
    pub(crate) models: Vec<ObjectModel>,
}

/// The models that worlds can include.
pub(crate) struct Included<'a> {
    /// Usable models by name.
    pub(crate) models: &'a BTreeMap<String, Arc<ObjectModel>>,
    /// Names of models whose files give them a pose, which that of an `<include>` replaces.
    pub(crate) posed: &'a BTreeSet<String>,
    pub(crate) lookup: &'a Lookup<'a>,
}

/// Shortest length and width of a model that may be around the robot. Unit: metres.
const ROOM_M: f64 = 2.5;
/// Lower things are part of the floor: a robot drives over them. Unit: metres.
const LOW_M: f64 = 5e-3;
/// Largest number of solids of a building that become pieces of their own: each is perceived on its own.
const MOST_PIECES: usize = 200;

/// Reads a world in SDF or MJCF. It is `None` if there are errors.
///
/// # Errors
/// All faults of the text: it is not XML (W031) or not SDF of a supported version (W032), lacks an element (W033), has
/// an invalid value (W034) or an unsupported element (W035), has an unusable mesh (W037), includes a missing or faulty
/// model (W040), or has a duplicate name (W041).
pub(crate) fn read(name: &str, source: &Source, path: &Path, included: &Included<'_>) -> (Option<World>, Diagnostics) {
    let text = repaired(&source.text);
    let document = match xml::parse_model(source, &text) {
        Ok(document) => document,
        Err(faults) => return (None, faults),
    };
    let map = WorldMap { digest: digest_of(&source.text), ..WorldMap::floor_only(name) };
    let mut gathering =
        Gathering { path, included, world: World { map, models: Vec::new() }, reader: Reader::new(source) };
    let root = document.root_element();
    if root.has_tag_name("mujoco") {
        gathering.bodies(root, source);
    } else if check_version(root, &mut gathering.reader).is_some()
        && let Some(world) = gathering.reader.required(root, "world")
    {
        gathering.reader.warn_about_unknown_children(world, &KNOWN);
        for child in world.children().filter(Node::is_element) {
            let piece = match child.tag_name().name() {
                "model" => gathering.inline(child),
                "include" => gathering.include(child),
                _ => None,
            };
            if let Some(piece) = piece {
                gathering.add(piece, child);
            }
        }
    }
    let found = gathering.reader.found;
    let complete = !found.has_errors();
    (complete.then_some(gathering.world), found)
}

/// A world while it is read.
struct Gathering<'a> {
    path: &'a Path,
    included: &'a Included<'a>,
    world: World,
    reader: Reader<'a>,
}

impl Gathering<'_> {
    fn add(&mut self, piece: Furniture, node: Node) {
        let own = self.world.models.iter().position(|model| model.name == piece.model);
        let model = match own {
            Some(idx) => Some(&self.world.models[idx]),
            None => self.included.models.get(&piece.model).map(|model| &**model),
        };
        if model.is_some_and(|model| piece.pose.position[2] + model.size_m[2] < LOW_M) {
            let message = format!("`{}` rises less than 5 mm above the floor, and is left out", piece.name);
            self.reader.warning("W036", node, message, "robots drive over carpets and markings");
            if let Some(idx) = own {
                self.world.models.remove(idx);
            }
            return;
        }
        if let Some(building) = model.filter(|model| is_building(model)).cloned() {
            if let Some(idx) = own {
                self.world.models.remove(idx);
            }
            return self.add_solids(&piece, building, node);
        }
        self.world.map.locations.extend(front(&piece, model));
        self.add_piece(piece, node);
    }

    fn add_piece(&mut self, piece: Furniture, node: Node) {
        if self.world.map.furniture.iter().any(|other| other.name == piece.name) {
            let message = format!("there are two `{}`", piece.name);
            self.reader.error("W041", node, message, "give one of them another name");
        }
        self.world.map.furniture.push(piece);
    }

    /// Adds each solid of a building as a piece of its own: the robot's map has a box for each piece, and the box of a
    /// whole building would be around the robot.
    fn add_solids(&mut self, piece: &Furniture, building: ObjectModel, node: Node) {
        let at = piece.pose.to_isometry();
        // The doors of a building stay as in the file.
        let moving = building.moving.iter().flat_map(|part| {
            let at = part.pose.to_isometry();
            let placed = move |solid: &Part| Pose::from_isometry(&(at * solid.pose.to_isometry()));
            part.model.parts.iter().map(move |solid| Part { pose: placed(solid), ..solid.clone() })
        });
        let parts: Vec<Part> = building.parts.iter().cloned().chain(moving).collect();
        for (number, part) in (1..).zip(parts) {
            let (friction, restitution) = (Some(building.friction), Some(building.restitution));
            let body = Body { parts: vec![part], friction, restitution, fixed: true, ..Body::default() };
            let digest = digest_of(&format!("{} {number}", building.digest));
            let solid = self.place(body, digest, &at, &format!("{}_{number}", piece.name));
            self.add_piece(solid, node);
        }
    }

    /// Reads a model that is defined inside the world. A model without solid shapes but planes is left out: every world
    /// has a floor, and lights and pictures do not collide.
    fn inline(&mut self, model: Node) -> Option<Furniture> {
        let name = self.reader.attribute(model, "name")?;
        let mut shapes = Shapes::new(self.included.lookup, self.path);
        shapes.digest.update(self.reader.source.text[model.range()].as_bytes());
        let n_faults = self.reader.found.len();
        let body = sdf::read_model(model, Role::Furniture, &mut shapes, &mut self.reader);
        let at = pose(model, &mut self.reader)?;
        let is_faulty = self.reader.found.iter().skip(n_faults).any(|fault| fault.severity == Severity::Error);
        if is_faulty || body.parts.is_empty() {
            return None;
        }
        let is_still = sdf::is_static(model, &mut self.reader);
        self.warn_if_movable(is_still, name, model);
        Some(self.place(body, shapes.digest.finish(), &at, name))
    }

    fn include(&mut self, include: Node) -> Option<Furniture> {
        let known = ["uri", "name", "pose", "static", "plugin", "placement_frame"];
        self.reader.warn_about_unknown_children(include, &known);
        let uri = self.reader.required(include, "uri")?;
        let named = folder::name_in(xml::text(uri));
        if ALWAYS_THERE.contains(&named.to_lowercase().replace(' ', "_").as_str()) {
            return None;
        }
        let at = pose(include, &mut self.reader)?;
        let name = xml::child(include, "name").map_or(named.as_str(), xml::text);
        let is_still = sdf::is_static(include, &mut self.reader);
        let is_upright = (at.rotation * Vector3::z()).z >= UPRIGHT_COSINE;
        let has_pose = xml::child(include, "pose").is_some();
        let moves = |model: &ObjectModel| !is_still && !model.moving.is_empty();
        if let Some(model) = self.included.models.get(&named)
            && is_upright
            && !self.included.posed.contains(&named)
            && (model.moving.is_empty() || moves(model))
        {
            self.warn_if_movable(is_still || model.fixed, &named, include);
            // A model's origin is below its middle; the file's origin may differ.
            let foot = at * Point3::from(model.origin_m.map(|x| -x));
            return Some(Furniture { name: name.to_owned(), model: named.clone(), pose: upright(&at, foot) });
        }
        let known = self.included.models.keys().map(String::as_str);
        let model = folder::included(uri, self.included.lookup, Role::Furniture, 1, known, &mut self.reader)?;
        if model.body.parts.is_empty() {
            return None;
        }
        self.warn_if_movable(is_still || model.is_static, &named, include);
        let at = if has_pose { at } else { model.pose };
        Some(self.place(model.body, model.digest, &at, name))
    }

    /// Adds the bodies of a world in MJCF.
    fn bodies(&mut self, root: Node, source: &Source) {
        let pieces = match mjcf_world::read(source, self.path, self.included.lookup.files) {
            Ok(pieces) => pieces,
            Err(faults) => return self.reader.found.extend(faults),
        };
        for piece in pieces {
            let (model, said) = urdf::read(&piece.urdf, self.path, self.included.lookup, &piece.materials);
            let Some(mut model) = model else {
                // A body that is only seen has no solids.
                self.reader.found.extend(said.into_iter().filter(|fault| fault.code != "W038").collect());
                continue;
            };
            self.warn_if_movable(!piece.moves, &piece.name, root);
            model.body.fixed = true;
            let furniture = self.place(model.body, model.digest, &Isometry3::identity(), &piece.name);
            self.add(furniture, root);
        }
    }

    /// Adds a body as a model of its own, and returns the piece of furniture that it is at a pose.
    fn place(&mut self, body: Body, digest: String, at: &Isometry3<f64>, name: &str) -> Furniture {
        let heading = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), Pose::from_isometry(at).yaw());
        let tilt = Isometry3::from_parts(Translation3::identity(), heading.inverse() * at.rotation);
        let model = body.into_model(&format!("{}/{name}", self.world.map.name), digest, &tilt);
        let at = Isometry3::from_parts(at.translation, heading);
        let foot = at * Point3::from(model.origin_m.map(|x| -x));
        let piece = Furniture { name: name.to_owned(), model: model.name.clone(), pose: upright(&at, foot) };
        self.world.models.push(model);
        piece
    }

    fn warn_if_movable(&mut self, is_still: bool, name: &str, node: Node) {
        if !is_still {
            let message = format!("`{name}` can move in Gazebo, but is static in a world here");
            let help = "put movable objects into `[surfaceObjects]` or `nav_obstacle_list`";
            self.reader.warning("W036", node, message, help);
        }
    }
}

/// Whether a model is so large that it may be around the robot, and consists of several solids.
fn is_building(model: &ObjectModel) -> bool {
    model.size_m[..2].iter().all(|extent| *extent > ROOM_M) && (2..=MOST_PIECES).contains(&model.parts.len())
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
