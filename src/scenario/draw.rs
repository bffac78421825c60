//! One scene from a list of choices.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use crate::base::{Choices, Pose};
use crate::config::{ObjectModel, Surface};
use crate::scenario::overlap::Solid;
use crate::scenario::{RobotStart, Role, Scene, SceneObject, Space, placement};

/// Places tried for one object before the scene is given up. On a table that is half full, about every second try finds
/// a free place: fifty that fail mean that there is none worth looking for.
const TRIES: u32 = 50;
/// Gap between the surface's edge and the middle of the robot's base. Unit: metres. Shape: least, nominal, most.
const BASE_GAP_M: [f64; 3] = [0.59, 0.69, 0.79];
/// The base stands at most this far beside the surface's middle. Unit: metres.
const BASE_SIDE_M: f64 = 0.05;
/// The base heads at most this far beside the surface's middle. Unit: radians.
const BASE_HEADING_RAD: f64 = 0.05;
/// World of a configuration that names none.
const DEFAULT_WORLD: &str = "empty";

/// A scene that could not be made, as data: the campaign counts it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("found no free place for `{model}` ({name}) in {tries} tries")]
pub struct Discard {
    /// Name of the model.
    pub model: String,
    /// Under which its choices are recorded, such as `other.3`.
    pub name: String,
    /// How many places were tried.
    pub tries: u32,
}

/// One scene: a function of the choices alone.
///
/// The platform's middle is the world's origin; the robot stands on its negative x side. All tests of a configuration
/// draw from the same space.
///
/// # Errors
/// An object found no free place.
pub fn draw(space: &Space, _test: usize, choices: &mut Choices) -> Result<Scene, Discard> {
    let mut hand = Hand {
        space,
        choices,
        objects: Vec::new(),
        solids: Vec::new(),
        left_out: Vec::new(),
        designators: BTreeMap::new(),
    };
    hand.choose_names();
    let surface = hand.set_platform();
    if let Some(surface) = surface {
        if !space.targets.is_empty() {
            hand.set_target(&surface)?;
        }
        hand.set_others(&surface)?;
    }
    let base = hand.start_robot(surface.as_ref());
    let world = hand.designators.get("world").and_then(|names| names.first()).cloned();
    Ok(Scene {
        world: world.unwrap_or_else(|| DEFAULT_WORLD.to_owned()),
        objects: hand.objects,
        robot: RobotStart { profile: Arc::clone(&space.robot), base },
        designators: hand.designators,
        sensing: space.sensing.clone(),
        physics: space.physics.clone(),
    })
}

/// A scene in the making.
struct Hand<'a> {
    space: &'a Space,
    choices: &'a mut Choices,
    objects: Vec<SceneObject>,
    /// Forms of the objects that stand on the surface.
    solids: Vec<Solid>,
    /// Models of the objects that a record leaves out.
    left_out: Vec<String>,
    designators: BTreeMap<String, Vec<String>>,
}

impl Hand<'_> {
    /// Designators whose values are names: nominal is the first candidate.
    fn choose_names(&mut self) {
        for (designator, values) in &self.space.names {
            if !values.is_empty() {
                let value = values[self.choices.index(designator, values.len())].clone();
                self.designators.insert(designator.clone(), vec![value]);
            }
        }
    }

    fn set_platform(&mut self) -> Option<Surface> {
        let model = self.choose("surface.model", &self.space.surfaces)?;
        let surface = model.surface;
        let id = self.free_id(&model);
        self.objects.push(SceneObject {
            id: id.clone(),
            role: Role::Platform,
            pose: Pose::IDENTITY,
            mass_kg: model.mass_kg,
            friction: model.friction,
            restitution: model.restitution,
            model,
        });
        self.designators.insert("objectSurface".to_owned(), vec![id]);
        surface
    }

    /// The target may stand anywhere that the robot can be asked to reach into; nominal is the middle.
    fn set_target(&mut self, surface: &Surface) -> Result<(), Discard> {
        if let Some(model) = self.choose("target.model", &self.space.targets) {
            let id = self.place("target", model, Role::Target, surface, [0.0, 0.0])?;
            self.designators.insert("pickObject".to_owned(), vec![id]);
        }
        Ok(())
    }

    /// The others may stand anywhere. Nominal is the fewest, on a ring around the middle, the first at the far side.
    fn set_others(&mut self, surface: &Surface) -> Result<(), Discard> {
        let (least, most) = self.space.other_count;
        if self.space.others.is_empty() || most == 0 {
            return Ok(());
        }
        let more = self.choices.index("other.count", (most - least + 1) as usize);
        let count = least as usize + more;
        // Seven tenths of the way out, where the ring keeps clear of the middle and of the edge.
        let radius = 0.35 * surface.size_m[0].min(surface.size_m[1]);
        let mut ids = Vec::new();
        for number in 1..=count {
            let name = format!("other.{number}");
            if let Some(model) = self.choose(&format!("{name}.model"), &self.space.others) {
                // Only a shrunk record leaves one out; the ids of the others stay as they were.
                if self.choices.exception(&format!("{name}.left_out"), 2) == 1 {
                    self.left_out.push(model.name.clone());
                    continue;
                }
                let angle = TAU * (number - 1) as f64 / count as f64;
                let nominal = [radius * libm::cos(angle), radius * libm::sin(angle)];
                ids.push(self.place(&name, model, Role::Other, surface, nominal)?);
            }
        }
        self.designators.insert("surfaceObjects".to_owned(), ids);
        Ok(())
    }

    /// One of some models: nominal is the first.
    fn choose(&mut self, name: &str, models: &[Arc<ObjectModel>]) -> Option<Arc<ObjectModel>> {
        if models.is_empty() {
            return None;
        }
        models.get(self.choices.index(name, models.len())).cloned()
    }

    /// Sets an object down where nothing is in its way, and gives its id. Nominal is `nominal`, not turned, and the
    /// model's own mass, friction and restitution.
    fn place(
        &mut self,
        name: &str,
        model: Arc<ObjectModel>,
        role: Role,
        surface: &Surface,
        nominal: [f64; 2],
    ) -> Result<String, Discard> {
        let physics = &self.space.physics;
        let mass_scale = self.between(&format!("{name}.mass_scale"), physics.mass_scale, 1.0);
        let friction_scale = self.between(&format!("{name}.friction_scale"), physics.friction_scale, 1.0);
        let restitution = self.between(&format!("{name}.restitution"), physics.restitution, model.restitution);
        for _ in 0..TRIES {
            let Some(pose) = self.try_place(name, &model, role, surface, nominal) else { continue };
            let solid = Solid::new(&model, &pose);
            if self.solids.iter().any(|standing| standing.is_in_the_way_of(&solid)) {
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
            });
            return Ok(id);
        }
        Err(Discard { model: model.name.clone(), name: name.to_owned(), tries: TRIES })
    }

    /// A pose on the surface, or nothing where the object, turned as it was drawn, would stick out.
    fn try_place(
        &mut self,
        name: &str,
        model: &ObjectModel,
        role: Role,
        surface: &Surface,
        nominal: [f64; 2],
    ) -> Option<Pose> {
        let yaw = self.between(&format!("{name}.yaw"), (-PI, PI), 0.0);
        let whole = placement::area(surface, model, yaw)?;
        let area = if role == Role::Target { placement::reachable(whole, surface) } else { whole };
        let x = self.between(&format!("{name}.x"), area.x, nominal[0]);
        let y = self.between(&format!("{name}.y"), area.y, nominal[1]);
        Some(Pose::upright([x, y, surface.height_m], yaw))
    }

    /// Where the base stands, facing the surface: nominal is straight in front of its middle.
    fn start_robot(&mut self, surface: Option<&Surface>) -> [f64; 3] {
        let [least, nominal, most] = BASE_GAP_M;
        let edge = surface.map_or(0.0, |surface| surface.size_m[0] / 2.0);
        let gap = self.choices.real("robot.gap", least, most, nominal);
        let side = self.choices.real("robot.side", -BASE_SIDE_M, BASE_SIDE_M, 0.0);
        let heading = self.choices.real("robot.heading", -BASE_HEADING_RAD, BASE_HEADING_RAD, 0.0);
        [-edge - gap, side, heading]
    }

    fn between(&mut self, name: &str, (low, high): (f64, f64), nominal: f64) -> f64 {
        self.choices.real(name, low, high, nominal)
    }

    /// The model's name and the first number that is free.
    fn free_id(&self, model: &ObjectModel) -> String {
        let standing = self.objects.iter().map(|object| &object.model.name);
        let taken = standing.chain(&self.left_out).filter(|name| **name == model.name).count();
        format!("{}_{}", model.name, taken + 1)
    }
}
