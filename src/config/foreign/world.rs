//! Reads worlds of Gazebo and MuJoCo: their models as static furniture, with a location in front of
//! each surface.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::foreign::body::{Body, Role};
use crate::foreign::building::{self, Solid, Split};
use crate::foreign::elements::{Children, is_usual_gravity};
use crate::foreign::folder::{self, Including};
use crate::foreign::geometry::Shapes;
use crate::foreign::inclusions::Inclusions;
use crate::foreign::lenient::repaired;
use crate::foreign::lookup::Lookup;
use crate::foreign::nested::{SubModel, Tree, check_include, register};
use crate::foreign::sdf::check_version;
use crate::foreign::sdf_pose::pose;
use crate::foreign::world_state::{ModelState, WorldState};
use crate::foreign::xml::{self, Bound, Node, Reader};
use crate::foreign::{fronts, mjcf_world, sdf, tree_object};
use crate::{Furniture, WorldMap};
use actcheck_base::{Diagnostics, Severity, Source, SourceSpan, digest_of};
use actcheck_data::{FLOOR_M, ObjectModel, Pose};

/// Light, display and time steps do not affect a world; in Gazebo, too, roads and actors do not
/// collide. Joints have no effect where nothing moves.
const WORLD: Children = Children {
    read: &[
        "include",
        "model",
        "frame",
        "state",
        "gravity",
        "light",
        "scene",
        "gui",
        "physics",
        "magnetic_field",
        "atmosphere",
        "wind",
        "spherical_coordinates",
        "audio",
        "plugin",
        "road",
        "name",
    ],
    harmless: &["actor", "joint"],
    refused: &["population"],
};
/// Files round gravity, and it differs between places on Earth. Unit: m/s².
const GRAVITY_TOLERANCE: f64 = 0.1;
/// Included models to skip: every world already has a floor and light.
const ALWAYS_THERE: [&str; 2] = ["ground_plane", "sun"];
/// A model that is tilted by more than this gets a model of its own. Unit: cosine.
const UPRIGHT_COSINE: f64 = 0.999;

/// A world, and its models that only it has.
pub(crate) struct World {
    pub(crate) map: WorldMap,
    /// Models that are defined inside the world, and included ones with another pose than the model
    /// itself. Their names begin with that of the world.
    pub(crate) models: Vec<ObjectModel>,
}

/// The models that worlds can include.
pub(crate) struct WorldModels<'a> {
    /// Usable models by name.
    pub(crate) models: &'a BTreeMap<String, Arc<ObjectModel>>,
    /// Names of models whose files give them a pose, which that of an `<include>` replaces.
    pub(crate) posed: &'a BTreeSet<String>,
    pub(crate) lookup: &'a Lookup<'a>,
}

/// Lower things are part of the floor: a robot drives over them. Unit: metres.
pub(super) const LOW_M: f64 = 5e-3;
/// A higher slab is furniture, such as a stage, and not the floor. Unit: metres.
const SLAB_M: f64 = 0.3;

/// Farther things are left out: bodies there have left the world. Unit: metres.
pub(super) const FARTHEST_M: f64 = FLOOR_M + 1.0;

/// Reads a world in SDF or MJCF. It is `None` if there are errors.
///
/// # Errors
/// All faults of the text: it is not XML (W031) or not SDF of a supported version (W032), lacks an
/// element (W033), has an invalid value (W034) or an unsupported element (W035), has an unusable
/// mesh (W037), includes a missing or faulty model (W040), or has a duplicate name (W041).
pub(crate) fn read(
    name: &str,
    source: &Source,
    path: &Path,
    included: &WorldModels<'_>,
) -> (Option<World>, Diagnostics) {
    let text = repaired(&source.text);
    let document = match xml::parse_model(source, &text) {
        Ok(document) => document,
        Err(faults) => return (None, faults),
    };
    let map = WorldMap {
        digest: digest_of(&source.text),
        ..WorldMap::floor_only(name)
    };
    let world = World {
        map,
        models: Vec::new(),
    };
    let mut gathering = WorldReader {
        path,
        included,
        world,
        pieces: Vec::new(),
        whole: Vec::new(),
        links: BTreeMap::new(),
        inclusions: Inclusions::of_world(),
        reader: Reader::new(source),
    };
    let root = document.root_element();
    if root.has_tag_name("mujoco") {
        gathering.bodies(root, source);
    } else if check_version(root, &mut gathering.reader).is_some()
        && let Some(world) = gathering.reader.required(root, "world")
    {
        gathering.models(world);
    }
    gathering.add_all();
    gathering.add_fronts();
    let found = gathering.reader.found;
    let complete = !found.has_errors();
    (complete.then_some(gathering.world), found)
}

/// A world while it is read.
struct WorldReader<'a> {
    path: &'a Path,
    included: &'a WorldModels<'a>,
    world: World,
    /// All models of the world, before buildings are split and floors are left out, with their
    /// elements in the text.
    pieces: Vec<(Furniture, SourceSpan)>,
    /// Furniture other than the solids of buildings: its index, and its element in the text.
    whole: Vec<(usize, SourceSpan)>,
    /// Poses of the links of included models, each in the frame of its model, by the URIs.
    links: BTreeMap<String, BTreeMap<String, Isometry3<f64>>>,
    inclusions: Inclusions,
    reader: Reader<'a>,
}

impl WorldReader<'_> {
    /// Reads the models of a world in SDF, as its `<state>` leaves them.
    fn models(&mut self, world: Node) {
        WORLD.check(world, &mut self.reader);
        check_gravity(world, &mut self.reader);
        let mut state = WorldState::of(world, &mut self.reader);
        let unusable = self.register_frames(world);
        let inserted = std::mem::take(&mut state.inserted);
        let mut known = BTreeSet::new();
        for child in world.children().filter(Node::is_element).chain(inserted) {
            let is_inline = match child.tag_name().name() {
                "model" => true,
                "include" => false,
                _ => continue,
            };
            let name = if is_inline {
                child.attribute("name").unwrap_or_default().to_owned()
            } else {
                name_of_include(child)
            };
            let moved = state.take(&name);
            let is_there = !state.deleted.contains(&name);
            known.insert(name);
            if !is_there || unusable.contains(&child.range().start) {
                continue;
            }
            let piece = match is_inline {
                true => self.inline(child, moved),
                false => self.include(child, moved),
            };
            let place = self.reader.located(xml::span(child));
            self.pieces.extend(piece.map(|piece| (piece, place)));
        }
        state.warn_of_others(&known, &mut self.reader);
    }

    /// Reads the frames of those included models that elements of the world name. Returns the
    /// offsets of each `<include>` whose model has a fault, which is reported.
    fn register_frames(&mut self, world: Node) -> BTreeSet<usize> {
        let mut unusable = BTreeSet::new();
        let named: BTreeSet<&str> = world
            .descendants()
            .flat_map(|node| ["relative_to", "frame", "attached_to"].map(|key| node.attribute(key)))
            .flatten()
            .collect();
        for include in xml::children(world, "include") {
            let name = name_of_include(include);
            let inside = format!("{name}::");
            let is_named = |frame: &&str| **frame == *name || frame.starts_with(&inside);
            let is_placed = xml::child(include, "placement_frame").is_some();
            if !is_placed && !named.iter().any(is_named) {
                continue;
            }
            let Some(uri) = xml::child(include, "uri").filter(|uri| !is_always_there(*uri)) else {
                continue;
            };
            match self.included(uri) {
                Some(model) => register(include, &model.place, &mut self.reader),
                None => _ = unusable.insert(include.range().start),
            }
        }
        unusable
    }

    /// Reads an included model as it is in a world. Returns `None` after it has reported a fault.
    fn included(&mut self, uri: Node) -> Option<SubModel> {
        let known = self.included.models.keys().map(String::as_str);
        let file = Including {
            path: self.path,
            lookup: self.included.lookup,
            inclusions: &self.inclusions,
        };
        let role = (Role::Furniture, true);
        folder::included(uri, &file, role, known, &mut self.reader)
    }

    /// Adds all models. If slabs are the floor of the world, everything is moved down until their
    /// tops are at height 0.
    fn add_all(&mut self) {
        let pieces = std::mem::take(&mut self.pieces);
        let tops: Vec<Option<f64>> = pieces
            .iter()
            .map(|(piece, _)| self.top_of_slab(piece))
            .collect();
        let floor_m = self.height_of_floor(&pieces, &tops);
        if let Some((top_m, (piece, place))) = floor_m.and_then(|top_m| {
            let slab = tops.iter().position(|top| *top == Some(top_m))?;
            Some((top_m, &pieces[slab]))
        }) {
            let message = format!(
                "`{}` is the floor: the world is moved down by {:.1} cm",
                piece.name,
                100.0 * top_m
            );
            let place = place.clone();
            let help = "the floor of every world is at the height 0";
            self.reader.warning_in("W036", place, message, help);
        }
        for (mut piece, place) in pieces {
            piece.pose.position[2] -= floor_m.unwrap_or(0.0);
            self.add(piece, place);
        }
    }

    /// The height of a slab that may be a floor; `None` for other models.
    fn top_of_slab(&self, piece: &Furniture) -> Option<f64> {
        let model = self
            .model_of(&piece.model)
            .filter(|model| building::is_large(model))?;
        let foot_m = piece.pose.position[2];
        let top_m = foot_m + model.size_m[2];
        (foot_m <= LOW_M && (LOW_M..SLAB_M).contains(&top_m) && building::is_level(model))
            .then_some(top_m)
    }

    /// The height of slabs on which more than half of the models around the origin are, if there
    /// are such slabs.
    fn height_of_floor(
        &self,
        pieces: &[(Furniture, SourceSpan)],
        tops: &[Option<f64>],
    ) -> Option<f64> {
        let is_on = |at: [f64; 3], slab: &Furniture| {
            let local = slab.pose.to_isometry().inverse() * Point3::from(at);
            let size = self
                .model_of(&slab.model)
                .map_or([0.0; 3], |model| model.size_m);
            (0..2).all(|axis| local[axis].abs() <= size[axis] / 2.0)
        };
        let places: Vec<[f64; 3]> = pieces
            .iter()
            .map(|(piece, _)| piece.pose.position)
            .collect();
        let near: Vec<&[f64; 3]> = places
            .iter()
            .filter(|[x, y, _]| libm::hypot(*x, *y) <= FARTHEST_M)
            .collect();
        let n_on = |top_m: f64| {
            let slabs = || {
                pieces
                    .iter()
                    .zip(tops)
                    .filter(|(_, top)| top.is_some_and(|top| (top - top_m).abs() < LOW_M))
            };
            near.iter()
                .filter(|at| slabs().any(|((slab, _), _)| is_on(***at, slab)))
                .count()
        };
        let counted = tops.iter().flatten().map(|top_m| (n_on(*top_m), *top_m));
        let best = counted.max_by(|one, other| one.0.cmp(&other.0).then(one.1.total_cmp(&other.1)));
        // The slabs are among those on them.
        best.filter(|(count, _)| 2 * count > near.len())
            .map(|(_, top_m)| top_m)
    }

    fn model_of(&self, name: &str) -> Option<&ObjectModel> {
        let own = self.world.models.iter().find(|model| model.name == name);
        own.or_else(|| self.included.models.get(name).map(|model| &**model))
    }

    fn add(&mut self, piece: Furniture, place: SourceSpan) {
        let own = self
            .world
            .models
            .iter()
            .position(|model| model.name == piece.model);
        let model = match own {
            Some(idx) => Some(&self.world.models[idx]),
            None => self.included.models.get(&piece.model).map(|model| &**model),
        };
        if model.is_some_and(|model| piece.pose.position[2] + model.size_m[2] < LOW_M) {
            let message = format!(
                "`{}` rises less than 5 mm above the floor, and is left out",
                piece.name
            );
            let help = "robots drive over carpets and markings";
            self.reader.warning_in("W036", place, message, help);
            if let Some(idx) = own {
                self.world.models.remove(idx);
            }
            return;
        }
        let [x, y, z] = piece.pose.position;
        if libm::hypot(x, y).max(z) > FARTHEST_M && !model.is_some_and(building::is_large) {
            return self.leave_out_distant(&piece, own, place);
        }
        match model.map(|model| building::solids(model, &piece.pose.to_isometry())) {
            Some(Split::Solids(solids)) => {
                let Some(building) = model.cloned() else {
                    return;
                };
                if let Some(idx) = own {
                    self.world.models.remove(idx);
                }
                return self.add_solids(&piece, &building, solids, &place);
            }
            Some(Split::TooMany(count)) => {
                let message = format!(
                    "`{}` is one obstacle: no drive leads into the box around it",
                    piece.name
                );
                let help = format!(
                    "give it a collision mesh of fewer flat faces; it has {count}, and at most {} become obstacles of their own",
                    building::MOST_SOLIDS
                );
                self.reader.warning_in("W036", place.clone(), message, help);
            }
            Some(Split::Whole) | None => {}
        }
        self.whole
            .push((self.world.map.furniture.len(), place.clone()));
        self.add_piece(piece, place);
    }

    fn leave_out_distant(&mut self, piece: &Furniture, own: Option<usize>, place: SourceSpan) {
        let [x, y, z] = piece.pose.position;
        let message = format!(
            "`{}` at ({x:.1}, {y:.1}, {z:.1}) is beyond the end of the floor, and is left out",
            piece.name
        );
        let help = "the floor ends 14 m from the origin";
        self.reader.warning_in("W036", place, message, help);
        if let Some(idx) = own {
            self.world.models.remove(idx);
        }
    }

    /// Adds the locations, once all furniture is known.
    fn add_fronts(&mut self) {
        let pieces = self.whole.iter().map(|(idx, _)| *idx);
        let without = fronts::add_fronts(&mut self.world, self.included.models, pieces);
        let place = self
            .whole
            .iter()
            .find(|(idx, _)| without.contains(idx))
            .map(|(_, place)| place.clone());
        if let Some(place) = place {
            let names: Vec<String> = without
                .iter()
                .map(|idx| format!("`{}`", self.world.map.furniture[*idx].name))
                .collect();
            let message = format!(
                "no side with room for a robot, and therefore no location: {}",
                names.join(", ")
            );
            let help =
                "a place 0.69 m from the surface must be 0.4 m away from all other furniture";
            self.reader.warning_in("W036", place, message, help);
        }
    }

    fn add_piece(&mut self, piece: Furniture, place: SourceSpan) {
        if self
            .world
            .map
            .furniture
            .iter()
            .any(|other| other.name == piece.name)
        {
            let message = format!("there are two `{}`", piece.name);
            let help = "give one of them another name";
            self.reader.error_in("W041", place, message, help);
        }
        self.world.map.furniture.push(piece);
    }

    /// Adds each solid of a building as a piece of its own: the robot's map has a box for each
    /// piece, and the box of a whole building would be around the robot.
    fn add_solids(
        &mut self,
        piece: &Furniture,
        building: &ObjectModel,
        solids: Vec<Solid>,
        place: &SourceSpan,
    ) {
        for (number, solid) in (1..).zip(solids) {
            let (friction, restitution) = (Some(building.friction), Some(building.restitution));
            let body = Body {
                parts: vec![solid.part],
                friction,
                restitution,
                fixed: true,
                ..Body::default()
            };
            let digest = digest_of(&format!("{} {number}", building.digest));
            let placed = self.place(body, digest, &solid.at, &format!("{}_{number}", piece.name));
            self.add_piece(placed, place.clone());
        }
    }

    /// Reads a model that is defined inside the world. A model without solid shapes but planes is
    /// left out: every world has a floor, and lights and pictures do not collide.
    fn inline(&mut self, model: Node, state: Option<ModelState>) -> Option<Furniture> {
        let name = self.reader.attribute(model, "name")?;
        let mut shapes = Shapes {
            inclusions: self.inclusions.clone(),
            ..Shapes::new(self.included.lookup, self.path)
        };
        shapes
            .digest
            .update(self.reader.source.text[model.range()].as_bytes());
        let n_faults = self.reader.found.len();
        let role = Role::Furniture;
        let mut tree = Tree::read(model, role, true, &mut shapes, &mut self.reader);
        if let Some(state) = &state {
            state.apply(&mut tree, &mut self.reader);
        }
        let body = tree.into_body(role, &mut self.reader);
        let at = match state {
            Some(state) => state.pose,
            None => pose(model, &mut self.reader)?,
        };
        let is_faulty = self
            .reader
            .found
            .iter()
            .skip(n_faults)
            .any(|fault| fault.severity == Severity::Error);
        if is_faulty || body.parts.is_empty() {
            return None;
        }
        let is_still = sdf::is_static(model, &mut self.reader);
        let place = self.reader.located(xml::span(model));
        self.warn_if_movable(is_still, name, place);
        Some(self.place(body, shapes.digest.finish(), &at, name))
    }

    fn include(&mut self, include: Node, state: Option<ModelState>) -> Option<Furniture> {
        check_include(include, |_| false, &mut self.reader);
        if self.reader.boolean_attribute(include, "merge") != Some(false) {
            let message = "a world that is merged into another one can't be read".to_owned();
            let help = "write its models here, or include a model without `merge`";
            self.reader.error("W035", include, message, help);
            return None;
        }
        let uri = self.reader.required(include, "uri")?;
        let named = folder::name_in(xml::text(uri));
        if is_always_there(uri) {
            return None;
        }
        let name = name_of_include(include);
        let is_still = sdf::is_static(include, &mut self.reader);
        let at = match &state {
            Some(state) => state.pose,
            None => pose(include, &mut self.reader)?,
        };
        if let Some(model) = self.shared(uri, &named, &at, state.as_ref())
            && (model.moving.is_empty() || !is_still)
        {
            let foot = at * Point3::from(model.origin_m.map(|x| -x));
            let place = self.reader.located(xml::span(include));
            self.warn_if_movable(is_still || model.fixed, &named, place);
            // A model's origin is below its middle; the file's origin may differ.
            return Some(Furniture {
                name,
                model: named.clone(),
                pose: upright(&at, foot),
            });
        }
        let mut model = self.included(uri)?;
        if let Some(state) = &state {
            state.apply(&mut model.tree, &mut self.reader);
        }
        register(include, &model.place, &mut self.reader);
        let body = model.tree.into_body(Role::Furniture, &mut self.reader);
        let at = match state {
            Some(state) => state.pose,
            None => pose(include, &mut self.reader)?,
        };
        if body.parts.is_empty() {
            return None;
        }
        let place = self.reader.located(xml::span(include));
        self.warn_if_movable(is_still || model.is_static, &named, place);
        Some(self.place(body, model.digest, &at, &name))
    }

    /// Returns the model of the folders that an `<include>` names, unless the world gives it another
    /// shape or turns it out of the upright at its pose.
    fn shared(
        &mut self,
        uri: Node,
        named: &str,
        at: &Isometry3<f64>,
        state: Option<&ModelState>,
    ) -> Option<Arc<ObjectModel>> {
        let model = Arc::clone(self.included.models.get(named)?);
        let is_upright = (at.rotation * Vector3::z()).z >= UPRIGHT_COSINE;
        let is_other = folder::is_beside(xml::text(uri), self.path, self.included.lookup);
        if !is_upright || is_other || self.included.posed.contains(named) {
            return None;
        }
        let Some(state) = state else {
            return Some(model);
        };
        if !self.links.contains_key(named) {
            let links = self.included(uri)?.tree.links.into_iter();
            let links = links.map(|link| (link.name, link.pose)).collect();
            self.links.insert(named.to_owned(), links);
        }
        state.is_rigid(&self.links[named]).then_some(model)
    }

    /// Adds the bodies of a world in MJCF.
    fn bodies(&mut self, root: Node, source: &Source) {
        let (pieces, text, said) = match mjcf_world::read(source, self.path, self.included.lookup) {
            Ok(read) => read,
            Err(faults) => return self.reader.found.extend(faults),
        };
        self.reader.found.extend(said);
        for piece in pieces {
            let mut shapes = Shapes::new(self.included.lookup, self.path);
            shapes.digest.update(text.text.as_bytes());
            shapes.digest.update(piece.name.as_bytes());
            let (model, said) = tree_object::read(&piece.tree, &mut shapes);
            self.reader.found.extend(said);
            let solid = model.filter(|model| !model.body.parts.is_empty());
            let Some(mut model) = solid else {
                continue;
            };
            // The first link of a piece is the frame of its body.
            let place = piece.tree.links.first().map(|link| link.place.clone());
            let place = xml::at_tag(&place.unwrap_or_else(|| self.reader.place(root)));
            self.warn_if_movable(!piece.moves, &piece.name, place.clone());
            model.body.fixed = true;
            let furniture = self.place(
                model.body,
                model.digest,
                &Isometry3::identity(),
                &piece.name,
            );
            self.pieces.push((furniture, place));
        }
    }

    /// Adds a body as a model of its own, and returns the piece of furniture that it is at a pose.
    fn place(&mut self, body: Body, digest: String, at: &Isometry3<f64>, name: &str) -> Furniture {
        let heading =
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), Pose::from_isometry(at).yaw());
        let tilt = Isometry3::from_parts(Translation3::identity(), heading.inverse() * at.rotation);
        let model = body.into_model(&format!("{}/{name}", self.world.map.name), digest, &tilt);
        let at = Isometry3::from_parts(at.translation, heading);
        let foot = at * Point3::from(model.origin_m.map(|x| -x));
        let piece = Furniture {
            name: name.to_owned(),
            model: model.name.clone(),
            pose: upright(&at, foot),
        };
        self.world.models.push(model);
        piece
    }

    fn warn_if_movable(&mut self, is_still: bool, name: &str, place: SourceSpan) {
        if !is_still {
            let message = format!("`{name}` can move in its file, but is static in a world here");
            let help = "put movable objects into `[surfaceObjects]` or `nav_obstacle_list`";
            self.reader.warning_in("W036", place, message, help);
        }
    }
}

/// Whether the `<uri>` of an `<include>` names a model that every world has already.
pub(super) fn is_always_there(uri: Node) -> bool {
    let named = folder::name_in(xml::text(uri));
    ALWAYS_THERE.contains(&named.to_lowercase().replace(' ', "_").as_str())
}

/// The name of an included model in the world: its own, or that of its file.
fn name_of_include(include: Node) -> String {
    let uri = xml::child(include, "uri").map_or("", xml::text);
    xml::child(include, "name")
        .map_or_else(|| folder::name_in(uri), |name| xml::text(name).to_owned())
}

/// Reports gravity that differs from that of the simulation (W035).
fn check_gravity(world: Node, reader: &mut Reader) {
    let places = std::iter::once(world).chain(xml::children(world, "physics"));
    for node in places.filter_map(|place| xml::child(place, "gravity")) {
        let Some(written) = reader.numbers::<3>(node, xml::text(node), Bound::Finite) else {
            continue;
        };
        if !is_usual_gravity(written, GRAVITY_TOLERANCE) {
            let [x, y, z] = written;
            let message = format!("gravity of {x} {y} {z} m/s² can't be simulated");
            let help = "write `<gravity>0 0 -9.81</gravity>`, or remove it";
            reader.error("W035", node, message, help);
        }
    }
}

fn upright(at: &Isometry3<f64>, foot: Point3<f64>) -> Pose {
    Pose::upright([foot.x, foot.y, foot.z], Pose::from_isometry(at).yaw())
}
