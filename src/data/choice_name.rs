//! Names of choices: their meaning, unit and group, and their written form.
//!
//! Histories, case files and exports hold the written form, so it must not change.

use std::convert::Infallible;
use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::choice_parts::{
    ObjectAxis, PlacedObject, PlanarAxis, SightingAxis, StartAxis, WheelAxis,
};

/// The name of a choice.
///
/// The written form is a path, such as `target.yaw`, and can be read again.
///
/// ```
/// use actcheck_data::{ChoiceName, ObjectAxis, PlacedObject};
///
/// let name = ChoiceName::Object(PlacedObject::Other(3), ObjectAxis::X);
/// assert_eq!(name.to_string(), "other.3.x");
/// assert_eq!("other.3.x".parse(), Ok(name.clone()));
/// assert_eq!(name.unit(), "m");
/// assert!(!name.is_noise());
/// ```
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(from = "String", into = "String")]
pub enum ChoiceName {
    /// The world that contains the scene, a candidate.
    World,
    /// The piece of the world's furniture that holds the target, a candidate.
    SurfaceName,
    /// The model of the surface that is added to the scene to hold the target, a candidate.
    SurfaceModel,
    /// The location in front of the surface, a candidate.
    LocationName,
    /// The piece of the world's furniture to place the target on, a candidate.
    PlaceName,
    /// The model of the surface that is added to the scene to place the target on, a candidate.
    PlaceModel,
    /// Number of other objects beside the target, above the least.
    OtherCount,
    /// Number of other objects on the surface to place the target on, above the least.
    PlaceOtherCount,
    /// A property of an object.
    Object(PlacedObject, ObjectAxis),
    /// A coordinate of the robot's initial base pose.
    Robot(StartAxis),
    /// Number of the test's last actions that a shrunk run leaves out.
    ActionsLeftOut,
    /// Whether all objects have other ids than usual: a relation between runs asks for it.
    Renamed,
    /// The value of a designator in one action of the test, a candidate: the id of an object of the
    /// scene.
    Step {
        /// Position of the action in the test, from 1.
        number: u32,
        /// The designator.
        designator: String,
    },
    /// Horizontal direction to the light of images.
    LightAzimuth,
    /// Height of the light of images above the horizon.
    LightElevation,
    /// Brightness of the light of images.
    LightBrightness,
    /// Brightness of the light from all around.
    LightAmbient,
    /// Pattern of the tables in images, a candidate.
    TableTexture,
    /// Colour of the tables in images, a candidate.
    TableColour,
    /// Seed of the colours of objects in images; 0 for those of their files.
    ObjectColours,
    /// Seed of all randomness of a program that performs actions.
    SkillSeed,
    /// Seed of a motion planner's samples.
    MotionSamples,
    /// Error of the initial localisation.
    Localisation(PlanarAxis),
    /// Error of the wheel odometry on a stretch of the path.
    Odometry(WheelAxis),
    /// Error of a landmark's measurement.
    Landmark(PlanarAxis),
    /// Error of the gap between the fingers.
    Gripper,
    /// Seed of an image's noise.
    CameraFrame,
    /// Error of a perceived object. Create it with [`ChoiceName::sighting`].
    Sighting {
        /// Id of the object.
        id: String,
        /// The coordinate.
        axis: SightingAxis,
    },
    /// The value of a designator of the configuration that is not an object, a candidate. Any other
    /// name is one too.
    Designator(String),
}

/// The group of a choice. Shrinking makes the choices of a group nominal together, in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ChoiceGroup {
    /// Sensor noise.
    Noise,
    /// Mass, friction and restitution.
    Physics,
    /// The robot's start.
    Start,
    /// Poses of other objects and obstacles.
    OtherPoses,
    /// The target's pose.
    TargetPose,
    /// All others: candidates, sizes and seeds.
    Rest,
}

/// The table of obstacles, whose candidates belong to no designator.
pub const OBSTACLE_LIST: &str = "nav_obstacle_list";

/// Prefix of sensor noise.
const SENSE: &str = "sense.";
/// Prefix of the values of one action.
const STEP: &str = "step.";
const LOCALISATION: &str = "localisation";
const LANDMARK: &str = "odometry.landmark";
const ODOMETRY: &str = "odometry";

/// Names without a variable part.
const FIXED: [(ChoiceName, &str); 21] = [
    (ChoiceName::World, "world"),
    (ChoiceName::SurfaceName, "surface.name"),
    (ChoiceName::SurfaceModel, "surface.model"),
    (ChoiceName::LocationName, "location.name"),
    (ChoiceName::PlaceName, "place.name"),
    (ChoiceName::PlaceModel, "place.model"),
    (ChoiceName::OtherCount, "other.count"),
    (ChoiceName::PlaceOtherCount, "place_other.count"),
    (ChoiceName::ActionsLeftOut, "test.left_out"),
    (ChoiceName::Renamed, "scene.renamed"),
    (ChoiceName::LightAzimuth, "light.azimuth"),
    (ChoiceName::LightElevation, "light.elevation"),
    (ChoiceName::LightBrightness, "light.brightness"),
    (ChoiceName::LightAmbient, "light.ambient"),
    (ChoiceName::TableTexture, "table.texture"),
    (ChoiceName::TableColour, "table.colour"),
    (ChoiceName::ObjectColours, "objects.colours"),
    (ChoiceName::SkillSeed, "skill.seed"),
    (ChoiceName::MotionSamples, "motion.samples"),
    (ChoiceName::Gripper, "sense.gripper"),
    (ChoiceName::CameraFrame, "sense.camera.frame"),
];

impl ChoiceName {
    /// Returns the name of the error of a perceived object.
    pub fn sighting(id: &str, axis: SightingAxis) -> Self {
        match id {
            // Furniture may have any name. As text, this one is the name of another choice.
            LOCALISATION | LANDMARK | ODOMETRY => format!("{SENSE}{id}.{}", axis.word()).into(),
            _ => Self::Sighting {
                id: id.to_owned(),
                axis,
            },
        }
    }

    /// All names of choices that are made only during a run and belong to no object.
    pub fn of_runs() -> Vec<Self> {
        let planar = PlanarAxis::ALL
            .into_iter()
            .flat_map(|axis| [Self::Localisation(axis), Self::Landmark(axis)]);
        let wheels = WheelAxis::ALL.into_iter().map(Self::Odometry);
        let single = [
            Self::SkillSeed,
            Self::MotionSamples,
            Self::Gripper,
            Self::CameraFrame,
        ];
        planar.chain(wheels).chain(single).collect()
    }

    /// Whether the choice is made only during a run, and not for its scene.
    pub fn is_of_run(&self) -> bool {
        self.is_noise() || matches!(self, Self::SkillSeed | Self::MotionSamples)
    }

    /// Whether the choice is sensor noise.
    pub fn is_noise(&self) -> bool {
        match self {
            Self::Localisation(_)
            | Self::Odometry(_)
            | Self::Landmark(_)
            | Self::Gripper
            | Self::CameraFrame
            | Self::Sighting { .. } => true,
            Self::Designator(name) => name.starts_with(SENSE),
            _ => false,
        }
    }

    /// Returns the unit of the values; empty for candidates, counts, seeds, factors and errors of
    /// the wheel odometry.
    pub fn unit(&self) -> &'static str {
        match self {
            Self::Object(_, ObjectAxis::X | ObjectAxis::Y)
            | Self::Robot(StartAxis::Gap | StartAxis::Side | StartAxis::X | StartAxis::Y)
            | Self::Localisation(PlanarAxis::X | PlanarAxis::Y)
            | Self::Landmark(PlanarAxis::X | PlanarAxis::Y)
            | Self::Gripper => "m",
            Self::Sighting { axis, .. } if *axis != SightingAxis::Yaw => "m",
            Self::Object(_, ObjectAxis::Yaw)
            | Self::LightAzimuth
            | Self::LightElevation
            | Self::Robot(StartAxis::Heading)
            | Self::Localisation(PlanarAxis::Heading)
            | Self::Landmark(PlanarAxis::Heading)
            | Self::Sighting { .. } => "rad",
            _ => "",
        }
    }

    /// Returns the group, or `None` if the choice only sets how much there is: objects and actions.
    pub fn group(&self) -> Option<ChoiceGroup> {
        match self {
            Self::OtherCount
            | Self::PlaceOtherCount
            | Self::ActionsLeftOut
            | Self::Renamed
            | Self::Object(_, ObjectAxis::LeftOut) => None,
            Self::Object(
                _,
                ObjectAxis::MassScale | ObjectAxis::FrictionScale | ObjectAxis::Restitution,
            ) => Some(ChoiceGroup::Physics),
            Self::Object(PlacedObject::Target, ObjectAxis::X | ObjectAxis::Y | ObjectAxis::Yaw) => {
                Some(ChoiceGroup::TargetPose)
            }
            Self::Object(_, ObjectAxis::X | ObjectAxis::Y | ObjectAxis::Yaw) => {
                Some(ChoiceGroup::OtherPoses)
            }
            Self::Robot(_) => Some(ChoiceGroup::Start),
            _ if self.is_noise() => Some(ChoiceGroup::Noise),
            _ => Some(ChoiceGroup::Rest),
        }
    }

    /// Returns the simplest value, or `None` if it depends on the scene, such as the middle of the
    /// surface.
    pub fn simplest(&self) -> Option<f64> {
        match self {
            Self::Object(_, axis) => match axis {
                ObjectAxis::SizeScale
                | ObjectAxis::MassScale
                | ObjectAxis::FrictionScale
                | ObjectAxis::Stands => Some(1.0),
                ObjectAxis::Model | ObjectAxis::LeftOut | ObjectAxis::Yaw => Some(0.0),
                ObjectAxis::Restitution | ObjectAxis::X | ObjectAxis::Y => None,
            },
            Self::Robot(StartAxis::Side) => Some(0.0),
            Self::Robot(_) => None,
            Self::MotionSamples => Some(0.5),
            _ => Some(0.0),
        }
    }

    /// Returns the configuration's table with the candidates: a designator, or [`OBSTACLE_LIST`].
    /// Returns `None` if the choice is not one of candidates.
    pub fn candidates(&self) -> Option<&str> {
        match self {
            Self::World => Some("world"),
            Self::SurfaceName | Self::SurfaceModel => Some("objectSurface"),
            Self::LocationName => Some("objectLocation"),
            Self::PlaceName | Self::PlaceModel => Some("placeSurface"),
            Self::Object(object, ObjectAxis::Model) => Some(match object {
                PlacedObject::Target => "pickObject",
                PlacedObject::Other(_) | PlacedObject::PlaceOther(_) => "surfaceObjects",
                PlacedObject::Obstacle(_) => OBSTACLE_LIST,
            }),
            Self::Designator(name) => Some(name),
            _ => None,
        }
    }

    /// Returns the object, if it is one of several that a scene can leave out.
    pub fn numbered_object(&self) -> Option<PlacedObject> {
        match self {
            Self::Object(object, _) => Some(*object).filter(|object| object.is_numbered()),
            _ => None,
        }
    }

    /// Returns the object, if there are several of its kind, and the name with `*` in place of its
    /// number or id.
    pub fn pooled(&self) -> (Option<String>, String) {
        match self {
            Self::Object(object, axis) if object.is_numbered() => (
                Some(object.to_string()),
                format!("{}.*.{}", object.word(), axis.word()),
            ),
            Self::Sighting { id, axis } => (
                Some(format!("{SENSE}{id}")),
                format!("{SENSE}*.{}", axis.word()),
            ),
            _ => (None, self.to_string()),
        }
    }

    /// Reads the part of a sensor noise's name after the prefix.
    fn read_noise(rest: &str) -> Option<Self> {
        let (id, axis) = rest.rsplit_once('.')?;
        match id {
            LOCALISATION => PlanarAxis::read(axis).map(Self::Localisation),
            LANDMARK => PlanarAxis::read(axis).map(Self::Landmark),
            ODOMETRY => WheelAxis::read(axis).map(Self::Odometry),
            _ => SightingAxis::read(axis).map(|axis| Self::Sighting {
                id: id.to_owned(),
                axis,
            }),
        }
    }

    /// Reads the part of the name of an action's value after the prefix.
    fn read_step(rest: &str) -> Option<Self> {
        let (written, designator) = rest.split_once('.')?;
        let number: u32 = written.parse().ok()?;
        let is_canonical = number > 0 && number.to_string() == written && !designator.is_empty();
        is_canonical.then(|| Self::Step {
            number,
            designator: designator.to_owned(),
        })
    }

    fn read(text: &str) -> Option<Self> {
        if let Some((name, _)) = FIXED.into_iter().find(|(_, written)| *written == text) {
            return Some(name);
        }
        if let Some(rest) = text.strip_prefix(SENSE) {
            return Self::read_noise(rest);
        }
        if let Some(rest) = text.strip_prefix(STEP) {
            return Self::read_step(rest);
        }
        let (of, axis) = text.rsplit_once('.')?;
        match of {
            "robot" => StartAxis::read(axis).map(Self::Robot),
            _ => Some(Self::Object(
                PlacedObject::read(of)?,
                ObjectAxis::read(axis)?,
            )),
        }
    }
}

impl fmt::Display for ChoiceName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Object(object, axis) => write!(f, "{object}.{}", axis.word()),
            Self::Robot(axis) => write!(f, "robot.{}", axis.word()),
            Self::Step { number, designator } => write!(f, "{STEP}{number}.{designator}"),
            Self::Localisation(axis) => write!(f, "{SENSE}{LOCALISATION}.{}", axis.word()),
            Self::Odometry(axis) => write!(f, "{SENSE}{ODOMETRY}.{}", axis.word()),
            Self::Landmark(axis) => write!(f, "{SENSE}{LANDMARK}.{}", axis.word()),
            Self::Sighting { id, axis } => write!(f, "{SENSE}{id}.{}", axis.word()),
            Self::Designator(name) => f.write_str(name),
            _ => FIXED
                .iter()
                .find(|(name, _)| name == self)
                .map_or(Ok(()), |(_, written)| f.write_str(written)),
        }
    }
}

impl FromStr for ChoiceName {
    type Err = Infallible;

    /// Reads the written form. Any text is a name: if no other kind matches, it is a designator's.
    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(Self::read(text).unwrap_or_else(|| Self::Designator(text.to_owned())))
    }
}

impl From<&str> for ChoiceName {
    fn from(text: &str) -> Self {
        match text.parse() {
            Ok(name) => name,
        }
    }
}

impl From<String> for ChoiceName {
    fn from(text: String) -> Self {
        text.as_str().into()
    }
}

impl From<ChoiceName> for String {
    fn from(name: ChoiceName) -> Self {
        name.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Names as histories and case files have them, in any version of the program.
    const WRITTEN: [&str; 48] = [
        "world",
        "surface.name",
        "surface.model",
        "location.name",
        "place.name",
        "place.model",
        "other.count",
        "place_other.count",
        "target.model",
        "target.size_scale",
        "target.mass_scale",
        "target.friction_scale",
        "target.restitution",
        "target.stands",
        "target.yaw",
        "target.x",
        "target.y",
        "other.12.left_out",
        "place_other.3.model",
        "obstacle.1.x",
        "robot.gap",
        "robot.side",
        "robot.heading",
        "robot.x",
        "robot.y",
        "test.left_out",
        "step.3.pickObject",
        "light.azimuth",
        "light.elevation",
        "light.brightness",
        "light.ambient",
        "table.texture",
        "table.colour",
        "objects.colours",
        "skill.seed",
        "motion.samples",
        "sense.localisation.x",
        "sense.localisation.heading",
        "sense.odometry.along",
        "sense.odometry.veering",
        "sense.odometry.landmark.y",
        "sense.odometry.landmark.heading",
        "sense.gripper",
        "sense.camera.frame",
        "sense.glass_1.x",
        "sense.side.table_1.height",
        "sense.salt_shaker_2.yaw",
        "place_other.1.friction_scale",
    ];

    #[test]
    fn every_written_name_is_read_as_its_own_variant_and_written_alike() {
        for written in WRITTEN {
            let name = ChoiceName::from(written);
            assert!(!matches!(name, ChoiceName::Designator(_)), "{written}");
            assert_eq!(name.to_string(), written);
        }
    }

    #[test]
    fn any_other_text_is_a_designator_and_written_alike() {
        for written in [
            "objectLocation",
            "step.0.pickObject",
            "step.x",
            "target",
            "other.01.x",
            "other.x",
            "sense.",
            "sense.x",
            "robot.z",
            "",
            ".",
        ] {
            assert_eq!(
                ChoiceName::from(written),
                ChoiceName::Designator(written.to_owned())
            );
            assert_eq!(ChoiceName::from(written).to_string(), written);
        }
    }

    #[test]
    fn furniture_of_any_name_can_be_seen() {
        for id in [
            "localisation",
            "odometry",
            "odometry.landmark",
            "camera",
            "mug_1",
        ] {
            for axis in SightingAxis::ALL {
                let name = ChoiceName::sighting(id, axis);
                assert_eq!(name.to_string(), format!("sense.{id}.{}", axis.word()));
                assert_eq!(ChoiceName::from(name.to_string()), name);
                assert!(name.is_noise(), "{name}");
            }
        }
    }

    #[test]
    fn names_have_units_and_groups() {
        let of = |text: &str| {
            (
                ChoiceName::from(text).unit(),
                ChoiceName::from(text).group(),
            )
        };
        for (text, unit, group) in [
            ("target.x", "m", Some(ChoiceGroup::TargetPose)),
            ("obstacle.2.yaw", "rad", Some(ChoiceGroup::OtherPoses)),
            ("other.2.left_out", "", None),
            ("other.count", "", None),
            ("robot.heading", "rad", Some(ChoiceGroup::Start)),
            ("target.mass_scale", "", Some(ChoiceGroup::Physics)),
            ("target.model", "", Some(ChoiceGroup::Rest)),
            ("sense.gripper", "m", Some(ChoiceGroup::Noise)),
            ("sense.mug_1.depth", "m", Some(ChoiceGroup::Noise)),
            ("sense.mug_1.yaw", "rad", Some(ChoiceGroup::Noise)),
            ("sense.odometry.along", "", Some(ChoiceGroup::Noise)),
            ("objectLocation", "", Some(ChoiceGroup::Rest)),
        ] {
            assert_eq!(of(text), (unit, group), "{text}");
        }
    }

    #[test]
    fn choices_of_runs_are_not_of_scenes() {
        let of_runs: Vec<String> = ChoiceName::of_runs()
            .iter()
            .map(ToString::to_string)
            .collect();
        for written in WRITTEN {
            let name = ChoiceName::from(written);
            let listed = of_runs.iter().any(|other| other == written)
                || matches!(name, ChoiceName::Sighting { .. });
            assert_eq!(name.is_of_run(), listed, "{written}");
        }
    }
}
