//! One concrete scene: all input of the simulation, as plain data.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::{ObjectModel, Physics, Pose, RobotProfile, SceneMap, Sensing};

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
}

impl SceneObject {
    /// Whether it can't move: it is a platform, or its model is fixed.
    pub fn is_fixed(&self) -> bool {
        self.role == Role::Platform || self.model.fixed
    }
}

/// The role of an object in a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
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
}

impl Role {
    const ALL: [Self; 5] = [Self::Platform, Self::Target, Self::Other, Self::PlaceOther, Self::Obstacle];

    /// Its name in messages and histories.
    pub fn word(self) -> &'static str {
        match self {
            Self::Platform => "platform",
            Self::Target => "target",
            Self::Other => "other",
            Self::PlaceOther => "place-other",
            Self::Obstacle => "obstacle",
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
    /// The kinds of objects that it can recognise: all models of the campaign, in this scene or not.
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
}
