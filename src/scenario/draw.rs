//! Draws one scene from choices.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use crate::overlap::Solid;
use crate::placement::Reach;
use crate::surroundings::Surroundings;
use crate::{Space, placement};
use actcheck_data::{
    ChoiceName, Choices, Location, ObjectAxis, ObjectModel, PlacedObject, Pose, RobotStart, Role,
    Scene, SceneObject, Surface,
};

/// Maximum number of tries to place one object; then the scene is discarded. On a half-full table
/// about every second try succeeds, so after fifty failures further tries are not worthwhile.
pub(super) const TRIES: u32 = 50;
/// Gap between two platforms on an empty floor, wide enough for a robot to drive through. Unit:
/// metres.
const PLACE_GAP_M: f64 = 1.2;
/// Number in the id of the first object of a scene with other ids; those of later objects are
/// smaller, so that their alphabetical order is another one too.
const MOST_RENAMED: usize = 999;
/// Name of the world if the configuration names none.
const DEFAULT_WORLD: &str = "empty";

/// A scene that could not be generated. The campaign counts discards.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Discard {
    /// An object or the robot has no free place.
    #[error("found no free place for `{model}` ({name}) in {tries} tries")]
    NoPlace {
        /// Name of the model.
        model: String,
        /// Prefix of its choices, such as `other.3`.
        name: String,
        /// Number of tries.
        tries: u32,
    },
    /// The scene has nothing that an action of the test is to have as the value of a designator.
    #[error("the scene has nothing for `{designator} = \"{value}\"` of action {number}")]
    NoValue {
        /// Position of the action in the test, from 1.
        number: usize,
        /// The designator.
        designator: String,
        /// The value that the test gives to it.
        value: String,
    },
}

/// Draws one scene. It depends only on the choices.
///
/// If the world has no surfaces of its own, the centre of the platform is the origin. The robot
/// starts on the platform's negative x side, or somewhere else if the test begins with a drive.
/// Apart from that, all tests of a configuration draw from the same space.
///
/// # Errors
/// No free place was found for an object or the robot, or the scene has nothing for a value of an
/// action.
pub fn draw(space: &Space, test: usize, choices: &mut Choices) -> Result<Scene, Discard> {
    let renamed = choices.exception(ChoiceName::Renamed, 2) == 1;
    let mut builder = SceneBuilder {
        space,
        choices,
        objects: Vec::new(),
        solids: Vec::new(),
        left_out: Vec::new(),
        designators: BTreeMap::new(),
        platform: None,
        front: None,
        reach: None,
        ground_m: 0.0,
        renamed,
    };
    let world = builder.choose_world();
    builder.choose_names();
    let surface = match world {
        Some(world) if world.surfaces().next().is_some() => builder.take_platform(world),
        _ => builder.set_platform(),
    };
    let mounted = surface
        .as_ref()
        .map(|surface| builder.mount(surface))
        .transpose()?
        .flatten();
    if let Some(surface) = surface {
        if !space.targets.is_empty() {
            builder.set_target(&surface)?;
        }
        builder.set_others(&surface)?;
    }
    builder.set_place(world);
    if let Some(world) = world {
        builder.surround(world);
    }
    builder.clutter_place()?;
    let drive = space.drives.get(test).copied().flatten();
    if drive.is_some() {
        builder.name_front(world);
    }
    let drives = drive == Some(0);
    let base = match mounted {
        Some(base) => base,
        None if drives => builder.start_elsewhere(world)?,
        None => builder.start_robot(surface.as_ref())?,
    };
    let mut map = world.map(Surroundings::scene_map).unwrap_or_default();
    map.locations.extend(builder.front.clone());
    builder.set_obstacles(base, world, drives, &map)?;
    let parts: Vec<SceneObject> = builder
        .objects
        .iter()
        .flat_map(SceneObject::moving_parts)
        .collect();
    builder.objects.extend(parts);
    let steps = builder.set_steps(test)?;
    space.sensing.decor.choose(builder.choices);
    let root_height_m = builder.ground_m + space.robot.core.mount_height_m;
    let name = builder
        .designators
        .get("world")
        .and_then(|names| names.first())
        .cloned();
    Ok(Scene {
        world: name.unwrap_or_else(|| DEFAULT_WORLD.to_owned()),
        map,
        objects: builder.objects,
        robot: RobotStart {
            profile: Arc::clone(&space.robot),
            base,
            root_height_m,
            knows: Arc::clone(&space.knows),
        },
        designators: builder.designators,
        steps,
        sensing: space.sensing.clone(),
        physics: space.physics.clone(),
    })
}

/// Creates a platform with the mass, friction and restitution of its model.
pub(super) fn platform(id: String, model: Arc<ObjectModel>, pose: Pose) -> SceneObject {
    SceneObject {
        id,
        role: Role::Platform,
        pose,
        mass_kg: model.mass_kg,
        friction: model.friction,
        restitution: model.restitution,
        model,
        attached: None,
    }
}

/// A scene under construction.
pub(super) struct SceneBuilder<'a> {
    pub(super) space: &'a Space,
    pub(super) choices: &'a mut Choices,
    pub(super) objects: Vec<SceneObject>,
    /// Shapes of the objects placed so far.
    pub(super) solids: Vec<Solid>,
    /// Names of the models of left-out objects.
    left_out: Vec<String>,
    pub(super) designators: BTreeMap<String, Vec<String>>,
    /// Pose of the platform on which objects are placed; `None` if it is at the origin.
    pub(super) platform: Option<Pose>,
    /// The location in front of the platform, if it is not one of the world's.
    pub(super) front: Option<Location>,
    /// Height of the floor or the surface on which the robot is mounted. Unit: metres.
    pub(super) ground_m: f64,
    /// The places within reach of a fixed arm, if its profile states them.
    pub(super) reach: Option<Reach>,
    /// Whether ids are numbers without the model's name, in falling order.
    renamed: bool,
}

impl<'a> SceneBuilder<'a> {
    /// Chooses values of designators that are names. Nominal: the first candidate.
    fn choose_names(&mut self) {
        for (designator, values) in &self.space.names {
            // In a world, the location depends on the surface.
            let is_of_world = !self.space.worlds.is_empty()
                && ["world", "objectLocation"].contains(&designator.as_str());
            if !values.is_empty() && !is_of_world {
                let value = values[self
                    .choices
                    .candidate(designator.as_str().into(), values.clone())]
                .clone();
                self.designators.insert(designator.clone(), vec![value]);
            }
        }
    }

    /// Chooses a world, if the configuration names any. Nominal: the first.
    fn choose_world(&mut self) -> Option<&'a Surroundings> {
        let worlds = &self.space.worlds;
        if worlds.is_empty() {
            return None;
        }
        let names = worlds.iter().map(|world| world.map.name.clone()).collect();
        let world = &worlds[self.choices.candidate(ChoiceName::World, names)];
        self.designators
            .insert("world".to_owned(), vec![world.map.name.clone()]);
        Some(world)
    }

    /// Chooses one of the world's surfaces, and a location in front of it.
    fn take_platform(&mut self, world: &'a Surroundings) -> Option<Surface> {
        let there: Vec<&SceneObject> = self
            .space
            .surface_names
            .iter()
            .filter_map(|name| world.surface(name))
            .collect();
        if there.is_empty() {
            return None;
        }
        let names = there.iter().map(|platform| platform.id.clone()).collect();
        let platform = there[self.choices.candidate(ChoiceName::SurfaceName, names)];
        self.designators
            .insert("objectSurface".to_owned(), vec![platform.id.clone()]);
        self.choose_location(world, Some(&platform.id));
        self.platform = Some(platform.pose);
        self.objects.push(platform.clone());
        platform.model.surface
    }

    /// Chooses one of the world's locations that the configuration names, either in front of the
    /// surface or of no surface; any of them if the scene has no surface for objects.
    fn choose_location(&mut self, world: &Surroundings, surface: Option<&str>) {
        let named = self.space.names.get("objectLocation").into_iter().flatten();
        let there = named.filter(|name| {
            let location = world
                .map
                .locations
                .iter()
                .find(|location| location.name == **name);
            // If the world has no locations, the names are the robot's own.
            world.map.locations.is_empty()
                || location.is_some_and(|location| {
                    location
                        .surface
                        .as_deref()
                        .is_none_or(|of| surface.is_none_or(|surface| of == surface))
                })
        });
        let there: Vec<String> = there.cloned().collect();
        if !there.is_empty() {
            let chosen = there[self
                .choices
                .candidate(ChoiceName::LocationName, there.clone())]
            .clone();
            self.designators
                .insert("objectLocation".to_owned(), vec![chosen]);
        }
    }

    /// Chooses the surface to place the object on: another surface of the world if it has one, or a
    /// second platform beside the first.
    fn set_place(&mut self, world: Option<&'a Surroundings>) {
        let first = self
            .designators
            .get("objectSurface")
            .and_then(|ids| ids.first())
            .cloned();
        let id = match world.filter(|world| world.surfaces().next().is_some()) {
            Some(world) => {
                let there = self
                    .space
                    .place_names
                    .iter()
                    .filter(|name| world.surface(name).is_some());
                let there: Vec<String> = there.cloned().collect();
                let others: Vec<String> = there
                    .iter()
                    .filter(|name| Some(*name) != first.as_ref())
                    .cloned()
                    .collect();
                let names = if others.is_empty() { there } else { others };
                if names.is_empty() {
                    return;
                }
                names[self.choices.candidate(ChoiceName::PlaceName, names.clone())].clone()
            }
            None => {
                let Some(model) = self.choose(ChoiceName::PlaceModel, &self.space.places) else {
                    return;
                };
                let beside = self
                    .objects
                    .first()
                    .map_or(0.0, |platform| platform.model.size_m[1] / 2.0);
                let pose = Pose::upright(
                    [0.0, beside + PLACE_GAP_M + model.size_m[1] / 2.0, 0.0],
                    0.0,
                );
                let id = self.free_id(&model);
                self.objects
                    .insert(self.objects.len().min(1), platform(id.clone(), model, pose));
                id
            }
        };
        self.designators.insert("placeSurface".to_owned(), vec![id]);
    }

    /// Adds the rest of the world's furniture and walls, after the platforms.
    fn surround(&mut self, world: &Surroundings) {
        let taken = self
            .objects
            .first()
            .filter(|object| object.role == Role::Platform)
            .map(|object| object.id.clone());
        let at = self
            .objects
            .iter()
            .take_while(|object| object.role == Role::Platform)
            .count();
        let rest: Vec<SceneObject> = world.others(taken.as_deref()).cloned().collect();
        self.objects.splice(at..at, rest);
        if self.platform.is_none() {
            self.choose_location(world, None);
        }
    }

    fn set_platform(&mut self) -> Option<Surface> {
        let model = self.choose(ChoiceName::SurfaceModel, &self.space.surfaces)?;
        let surface = model.surface;
        let id = self.free_id(&model);
        self.objects
            .push(platform(id.clone(), model, Pose::IDENTITY));
        self.designators
            .insert("objectSurface".to_owned(), vec![id]);
        surface
    }

    /// Places the target on the reachable part of the surface. Nominal: the centre, or the middle
    /// of the arm's reach.
    fn set_target(&mut self, surface: &Surface) -> Result<(), Discard> {
        let target = PlacedObject::Target;
        if let Some(model) = self.choose(
            ChoiceName::Object(target, ObjectAxis::Model),
            &self.space.targets,
        ) {
            let nominal = self.reach.map_or([0.0; 2], |reach| reach.middle());
            let id = self.place(target, model, Role::Target, surface, nominal)?;
            self.designators.insert("pickObject".to_owned(), vec![id]);
        }
        Ok(())
    }

    /// Places the other objects around the target.
    fn set_others(&mut self, surface: &Surface) -> Result<(), Discard> {
        let counts = self.space.other_counts.beside_target;
        if !self.space.others.is_empty() && counts.1 > 0 {
            let ids = self.place_others(Role::Other, counts, surface)?;
            self.designators.insert("surfaceObjects".to_owned(), ids);
        }
        Ok(())
    }

    /// Places other objects on the surface where the target is to be placed.
    fn clutter_place(&mut self) -> Result<(), Discard> {
        let counts = self.space.other_counts.at_place;
        let id = self
            .designators
            .get("placeSurface")
            .and_then(|ids| ids.first());
        let place = self.objects.iter().find(|object| Some(&object.id) == id);
        let Some((surface, pose)) =
            place.and_then(|place| Some((place.model.surface?, place.pose)))
        else {
            return Ok(());
        };
        if self.space.others.is_empty() || counts.1 == 0 {
            return Ok(());
        }
        let platform = self.platform.replace(pose);
        let placed = self.place_others(Role::PlaceOther, counts, &surface);
        self.platform = platform;
        placed.map(|_| ())
    }

    /// Places other objects anywhere on a surface and returns their ids. Nominal: the fewest, on a
    /// ring around the centre, the first at the far side.
    fn place_others(
        &mut self,
        role: Role,
        (least, most): (u32, u32),
        surface: &Surface,
    ) -> Result<Vec<String>, Discard> {
        let (more, numbered): (ChoiceName, fn(u32) -> PlacedObject) = match role {
            Role::PlaceOther => (ChoiceName::PlaceOtherCount, PlacedObject::PlaceOther),
            _ => (ChoiceName::OtherCount, PlacedObject::Other),
        };
        let count = least + self.choices.index(more, (most - least + 1) as usize) as u32;
        // Seven tenths of the distance from the centre to the edge: the ring is clear of both.
        let radius = 0.35 * surface.size_m[0].min(surface.size_m[1]);
        let mut ids = Vec::new();
        for number in 1..=count {
            let object = numbered(number);
            if let Some(model) = self.choose(
                ChoiceName::Object(object, ObjectAxis::Model),
                &self.space.others,
            ) {
                // Only shrunk runs leave objects out; the ids of the others do not change.
                if self
                    .choices
                    .exception(ChoiceName::Object(object, ObjectAxis::LeftOut), 2)
                    == 1
                {
                    self.left_out.push(model.name.clone());
                    continue;
                }
                let angle = TAU * f64::from(number - 1) / f64::from(count);
                let nominal = [radius * libm::cos(angle), radius * libm::sin(angle)];
                ids.push(self.place(object, model, role, surface, nominal)?);
            }
        }
        Ok(ids)
    }

    /// Chooses one of the models. Nominal: the first. Returns `None` if there are no models.
    pub(super) fn choose(
        &mut self,
        name: ChoiceName,
        models: &[Arc<ObjectModel>],
    ) -> Option<Arc<ObjectModel>> {
        if models.is_empty() {
            return None;
        }
        let names = models.iter().map(|model| model.name.clone()).collect();
        models.get(self.choices.candidate(name, names)).cloned()
    }

    /// Places an object on a free part of the surface and returns its id. Nominal: the position
    /// `nominal`, yaw 0, and the model's own mass, friction and restitution.
    fn place(
        &mut self,
        object: PlacedObject,
        model: Arc<ObjectModel>,
        role: Role,
        surface: &Surface,
        nominal: [f64; 2],
    ) -> Result<String, Discard> {
        let physics = &self.space.physics;
        let model = self.sized(object, model);
        let mass_scale = self.simple(object, ObjectAxis::MassScale, physics.mass_scale);
        let friction_scale = self.simple(object, ObjectAxis::FrictionScale, physics.friction_scale);
        let restitution = self.between(
            object,
            ObjectAxis::Restitution,
            physics.restitution,
            model.restitution,
        );
        for _ in 0..TRIES {
            let Some(pose) = self.try_place(object, &model, role, surface, nominal) else {
                continue;
            };
            let pose = self.on_platform(pose);
            let solid = Solid::new(&model, &pose);
            if self
                .solids
                .iter()
                .any(|standing| standing.is_in_the_way_of(&solid))
            {
                continue;
            }
            let id = self.free_id(&model);
            self.solids.push(solid);
            self.objects.push(SceneObject {
                id: id.clone(),
                role,
                pose,
                mass_kg: model.mass_kg * mass_scale,
                friction: model.friction * friction_scale,
                restitution,
                model,
                attached: None,
            });
            return Ok(id);
        }
        Err(Discard::NoPlace {
            model: model.name.clone(),
            name: object.to_string(),
            tries: TRIES,
        })
    }

    /// Draws a pose on the surface. Returns `None` if the object would overhang the edge at the
    /// drawn yaw.
    fn try_place(
        &mut self,
        object: PlacedObject,
        model: &ObjectModel,
        role: Role,
        surface: &Surface,
        nominal: [f64; 2],
    ) -> Option<Pose> {
        let share = if role == Role::Target {
            self.space.lying.0
        } else {
            self.space.lying.1
        };
        let lies = share > 0.0 && self.simple(object, ObjectAxis::Stands, (0.0, 1.0)) < share;
        let stance = if lies {
            placement::lying(model)
        } else {
            placement::standing(model)
        };
        let yaw = self.simple(object, ObjectAxis::Yaw, (-PI, PI));
        let whole = placement::area(surface, &stance, yaw)?;
        let reach = self.reach.filter(|_| role == Role::Target);
        let area = match (role, &reach) {
            (_, Some(reach)) => reach.clip(whole),
            (Role::Target, None) => placement::reachable(whole, surface),
            _ => whole,
        };
        let x = self.between(object, ObjectAxis::X, area.x, nominal[0]);
        let y = self.between(object, ObjectAxis::Y, area.y, nominal[1]);
        if reach.is_some_and(|reach| !reach.holds([x, y])) {
            return None;
        }
        let foot = Pose::upright([x, y, surface.height_m], yaw);
        Some(if lies {
            Pose::from_isometry(&(foot.to_isometry() * stance.foot_from_model))
        } else {
            foot
        })
    }

    /// Transforms a pose from the platform's frame to the world.
    fn on_platform(&self, pose: Pose) -> Pose {
        match self.platform {
            None => pose,
            Some(platform) => Pose::from_isometry(&(platform.to_isometry() * pose.to_isometry())),
        }
    }

    /// Returns the model scaled by a drawn factor.
    fn sized(&mut self, object: PlacedObject, model: Arc<ObjectModel>) -> Arc<ObjectModel> {
        let (low, high) = self.space.physics.size_scale;
        if (low, high) == (1.0, 1.0) {
            return model;
        }
        let scale = self.simple(object, ObjectAxis::SizeScale, (low, high));
        Arc::new(model.scaled(scale))
    }

    fn simple(&mut self, object: PlacedObject, axis: ObjectAxis, (low, high): (f64, f64)) -> f64 {
        self.choices
            .simple(ChoiceName::Object(object, axis), low, high)
    }

    fn between(
        &mut self,
        object: PlacedObject,
        axis: ObjectAxis,
        (low, high): (f64, f64),
        nominal: f64,
    ) -> f64 {
        self.choices
            .real(ChoiceName::Object(object, axis), low, high, nominal)
    }

    /// Returns an id: the model's name and the first free number.
    pub(super) fn free_id(&self, model: &ObjectModel) -> String {
        let standing = self.objects.iter().map(|object| &object.model.name);
        let taken = standing
            .chain(&self.left_out)
            .filter(|name| **name == model.name)
            .count();
        if self.renamed {
            let before = self.objects.len() + self.left_out.len();
            return format!("thing_{}", MOST_RENAMED.saturating_sub(before));
        }
        let ids = (taken + 1..).map(|number| format!("{}_{number}", model.name));
        // Furniture of a world may have any name.
        ids.into_iter()
            .find(|id| !self.objects.iter().any(|object| object.id == *id))
            .unwrap_or_default()
    }
}
