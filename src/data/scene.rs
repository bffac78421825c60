//! One concrete scene: all input of the simulation, as plain data.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::{
    MovingPart, ObjectModel, Part, PartJoint, Physics, Pose, Rim, RobotProfile, SceneMap, Sensing,
    Shape,
};

/// A sampled scene. Frame of all poses: world; z up; the floor at 0.
#[derive(Debug, Clone)]
pub struct Scene {
    /// Name of its world (`[world] worlds`).
    pub world: String,
    /// Its named places.
    pub map: SceneMap,
    /// Platforms, the target and the other objects; platforms first.
    pub objects: Vec<SceneObject>,
    /// The robot and where it starts.
    pub robot: RobotStart,
    /// Values of the designators: ids of objects, or names of locations.
    pub designators: BTreeMap<String, Vec<String>>,
    /// The same for each action of the test, with the values that the test gives. Actions beyond
    /// have those of the scene.
    pub steps: Vec<BTreeMap<String, Vec<String>>>,
    /// Sensor noise of the run.
    pub sensing: Sensing,
    /// Parameters of the physics engine.
    pub physics: Physics,
}

/// One object of a scene.
#[derive(Debug, Clone)]
pub struct SceneObject {
    /// Unique in the scene: the model's name and a number, such as `glass_1`.
    pub id: String,
    /// Its model: shape and class.
    pub model: Arc<ObjectModel>,
    /// Its role in the scene.
    pub role: Role,
    /// Pose of the model's origin.
    pub pose: Pose,
    /// Unit: kilograms.
    pub mass_kg: f64,
    /// Sliding friction coefficient.
    pub friction: f64,
    /// Coefficient of restitution.
    pub restitution: f64,
    /// The object that carries it, if it is a part that a joint moves.
    pub attached: Option<Attached>,
}

impl SceneObject {
    /// Whether it can't move: it is a platform, or its model is fixed.
    pub fn is_fixed(&self) -> bool {
        self.role == Role::Platform || self.model.fixed
    }

    /// Returns the parts of the object that joints move, as objects of their own.
    pub fn moving_parts(&self) -> Vec<Self> {
        let id_of = |part: &MovingPart| format!("{}_{}", self.id, part.name);
        let (mass_scale, friction_scale) = (
            self.mass_kg / self.model.mass_kg,
            self.friction / self.model.friction.max(f64::MIN_POSITIVE),
        );
        let place = self.pose.to_isometry();
        let part = |part: &MovingPart| {
            let carrier = part.on.and_then(|on| self.model.moving.get(on));
            Self {
                id: id_of(part),
                model: Arc::clone(&part.model),
                role: Role::Part,
                pose: Pose::from_isometry(&(place * part.pose.to_isometry())),
                mass_kg: part.model.mass_kg * mass_scale,
                friction: part.model.friction * friction_scale,
                restitution: part.model.restitution,
                attached: Some(Attached {
                    to: carrier.map_or_else(|| self.id.clone(), id_of),
                    whole: self.id.clone(),
                    frame: self.pose,
                    joint: part.joint,
                }),
            }
        };
        self.model.moving.iter().map(part).collect()
    }
}

/// The attachment of a part to another object.
#[derive(Debug, Clone, PartialEq)]
pub struct Attached {
    /// Id of the object that carries it: the whole object, or another part of it.
    pub to: String,
    /// Id of the object that it is a part of.
    pub whole: String,
    /// The frame of the joint's axis. Frame: world.
    pub frame: Pose,
    /// How it moves.
    pub joint: PartJoint,
}

/// The role of an object in a scene.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize,
)]
pub enum Role {
    /// Carries other objects and never moves.
    Platform,
    /// The object that the robot is asked to handle.
    Target,
    /// Another object on the surface of the target.
    Other,
    /// Another object on the surface where the target is to be placed.
    PlaceOther,
    /// An obstacle for the base.
    Obstacle,
    /// A part of another object that a joint moves, such as a drawer.
    Part,
}

impl Role {
    const ALL: [Self; 6] = [
        Self::Platform,
        Self::Target,
        Self::Other,
        Self::PlaceOther,
        Self::Obstacle,
        Self::Part,
    ];

    /// Its name in messages and histories.
    pub fn word(self) -> &'static str {
        match self {
            Self::Platform => "platform",
            Self::Target => "target",
            Self::Other => "other",
            Self::PlaceOther => "place-other",
            Self::Obstacle => "obstacle",
            Self::Part => "part",
        }
    }

    /// Whether it is neither the target nor furniture.
    pub fn is_bystander(self) -> bool {
        matches!(self, Self::Other | Self::PlaceOther | Self::Obstacle)
    }

    /// Returns the role with this name, or `None`.
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|role| role.word() == word)
    }
}

/// The robot at the start of a run.
#[derive(Debug, Clone)]
pub struct RobotStart {
    /// The robot.
    pub profile: Arc<RobotProfile>,
    /// Pose of its base. Units: metres, metres, radians. Shape: x, y, heading.
    pub base: [f64; 3],
    /// Height of its root above the floor. Unit: metres.
    pub root_height_m: f64,
    /// The kinds of objects that it can recognise: all models of the campaign, in this scene or
    /// not.
    pub knows: Arc<[KnownKind]>,
}

/// A kind of object that the robot recognises by its size.
#[derive(Debug, Clone, PartialEq)]
pub struct KnownKind {
    /// Name of the model.
    pub name: String,
    /// Its class in the ontology: an IRI.
    pub category: String,
    /// Outer dimensions when upright. Unit: metres. Shape: x, y, z.
    pub size_m: [f64; 3],
    /// The wall of an open vessel, which a hand can take at its rim.
    pub rim: Option<Rim>,
    /// Whether it is a box.
    pub is_box: bool,
}

impl KnownKind {
    /// Returns the knowledge about a model.
    pub fn of(model: &ObjectModel) -> Self {
        Self {
            name: model.name.clone(),
            category: model.category.clone(),
            size_m: model.size_m,
            rim: model.rim(),
            is_box: matches!(
                model.parts.as_slice(),
                [Part {
                    shape: Shape::Box { .. },
                    ..
                }]
            ),
        }
    }
}
