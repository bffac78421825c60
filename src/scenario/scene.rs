//! One concrete scene: everything that the simulation needs to know, as plain data.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::base::Pose;
use crate::config::{ObjectModel, Physics, RobotProfile, Sensing};
use crate::scenario::SceneMap;

/// A sampled scene. Frame of all poses: world; z up; the floor at 0.
#[derive(Debug, Clone)]
pub struct Scene {
    /// Name of the world that it lies in (`[world] worlds`).
    pub world: String,
    /// The names of its places.
    pub map: SceneMap,
    /// Platforms, the grasp target and the others; platforms first.
    pub objects: Vec<SceneObject>,
    /// The robot and where it starts.
    pub robot: RobotStart,
    /// Values of the designators: ids of objects, or names of locations.
    pub designators: BTreeMap<String, Vec<String>>,
    /// What sensors get wrong in this run.
    pub sensing: Sensing,
    /// What physics is stepped with.
    pub physics: Physics,
}

/// One object of a scene.
#[derive(Debug, Clone)]
pub struct SceneObject {
    /// Unique in the scene: the model's name and a number, such as `glass_1`.
    pub id: String,
    /// Its form and class.
    pub model: Arc<ObjectModel>,
    /// What it is there for.
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
    /// Whether nothing moves it: a platform, and what its model says is fixed.
    pub fn is_fixed(&self) -> bool {
        self.role == Role::Platform || self.model.fixed
    }
}

/// What an object is there for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// Carries others and never moves.
    Platform,
    /// What the robot is asked to handle.
    Target,
    /// Stands around, where the target does.
    Other,
    /// Stands on the surface that the target is to be placed on.
    PlaceOther,
    /// Stands in the way of the base.
    Obstacle,
}

impl Role {
    const ALL: [Self; 5] = [Self::Platform, Self::Target, Self::Other, Self::PlaceOther, Self::Obstacle];

    /// The word for it, for people and in histories.
    pub fn word(self) -> &'static str {
        match self {
            Self::Platform => "platform",
            Self::Target => "target",
            Self::Other => "other",
            Self::PlaceOther => "place-other",
            Self::Obstacle => "obstacle",
        }
    }

    /// Whether it only stands around: neither handled nor furniture.
    pub fn is_bystander(self) -> bool {
        matches!(self, Self::Other | Self::PlaceOther | Self::Obstacle)
    }

    /// The role of a word.
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|role| role.word() == word)
    }
}

/// The robot at the beginning.
#[derive(Debug, Clone)]
pub struct RobotStart {
    /// Which robot.
    pub profile: Arc<RobotProfile>,
    /// Where its base stands. Units: metres, metres, radians. Shape: x, y, heading.
    pub base: [f64; 3],
    /// The kinds of things that it can tell apart: all that there are models of, whatever stands in the scene.
    pub knows: Arc<[KnownKind]>,
}

/// A kind of thing that can be handled, as a robot knows it: by its size.
#[derive(Debug, Clone, PartialEq)]
pub struct KnownKind {
    /// Name of the model.
    pub name: String,
    /// Its class in the ontology: an IRI.
    pub category: String,
    /// Outer dimensions as it stands. Unit: metres. Shape: x, y, z.
    pub size_m: [f64; 3],
}
