//! The messages of an episode file. `clients/episode.proto` describes them for other programs.

use serde::Deserialize;

/// `foxglove.FrameTransforms`: the poses of the moving bodies.
#[derive(Clone, PartialEq, prost::Message)]
pub(crate) struct FrameTransforms {
    #[prost(message, repeated, tag = "1")]
    pub(crate) transforms: Vec<FrameTransform>,
}

#[derive(Clone, PartialEq, prost::Message)]
pub(crate) struct FrameTransform {
    #[prost(string, tag = "3")]
    pub(crate) child_frame_id: String,
    #[prost(message, optional, tag = "4")]
    pub(crate) translation: Option<Vector3>,
    #[prost(message, optional, tag = "5")]
    pub(crate) rotation: Option<Quaternion>,
}

#[derive(Clone, Copy, PartialEq, prost::Message)]
pub(crate) struct Vector3 {
    #[prost(double, tag = "1")]
    pub(crate) x: f64,
    #[prost(double, tag = "2")]
    pub(crate) y: f64,
    #[prost(double, tag = "3")]
    pub(crate) z: f64,
}

#[derive(Clone, Copy, PartialEq, prost::Message)]
pub(crate) struct Quaternion {
    #[prost(double, tag = "1")]
    pub(crate) x: f64,
    #[prost(double, tag = "2")]
    pub(crate) y: f64,
    #[prost(double, tag = "3")]
    pub(crate) z: f64,
    #[prost(double, tag = "4")]
    pub(crate) w: f64,
}

/// `actcheck.Velocities`.
#[derive(Clone, PartialEq, prost::Message)]
pub(crate) struct Velocities {
    #[prost(double, repeated, tag = "1")]
    pub(crate) linear: Vec<f64>,
    #[prost(double, repeated, tag = "2")]
    pub(crate) angular: Vec<f64>,
}

/// `actcheck.Joints`.
#[derive(Clone, PartialEq, prost::Message)]
pub(crate) struct Joints {
    #[prost(double, repeated, tag = "1")]
    pub(crate) position: Vec<f64>,
    #[prost(double, repeated, tag = "2")]
    pub(crate) velocity: Vec<f64>,
    #[prost(double, repeated, tag = "3")]
    pub(crate) effort: Vec<f64>,
}

/// `actcheck.Contacts`.
#[derive(Clone, PartialEq, prost::Message)]
pub(crate) struct Contacts {
    #[prost(uint32, repeated, tag = "1")]
    pub(crate) first: Vec<u32>,
    #[prost(uint32, repeated, tag = "2")]
    pub(crate) second: Vec<u32>,
    #[prost(double, repeated, tag = "3")]
    pub(crate) normal_force: Vec<f64>,
    #[prost(double, repeated, tag = "4")]
    pub(crate) force: Vec<f64>,
    #[prost(double, repeated, tag = "5")]
    pub(crate) position: Vec<f64>,
    #[prost(double, repeated, tag = "6")]
    pub(crate) distance: Vec<f64>,
}

/// `actcheck.Outcome`.
#[derive(Clone, Copy, PartialEq, prost::Message)]
pub(crate) struct OutcomeMessage {
    #[prost(double, tag = "1")]
    pub(crate) reward: f64,
    #[prost(bool, optional, tag = "2")]
    pub(crate) success: Option<bool>,
    #[prost(bool, tag = "3")]
    pub(crate) terminated: bool,
    #[prost(bool, tag = "4")]
    pub(crate) truncated: bool,
}

/// `actcheck.Model`.
#[derive(Debug, Deserialize)]
pub(crate) struct ModelMessage {
    pub(crate) bodies: Vec<BodyMessage>,
    #[serde(default)]
    pub(crate) joints: Vec<JointMessage>,
    #[serde(default)]
    pub(crate) actuators: Vec<Named>,
    #[serde(default)]
    pub(crate) sites: Vec<SiteMessage>,
}

#[derive(Debug, Deserialize)]
pub(crate) struct Named {
    pub(crate) name: String,
}

#[derive(Debug, Deserialize)]
pub(crate) struct BodyMessage {
    pub(crate) name: String,
    pub(crate) parent: Option<usize>,
    pub(crate) moves: bool,
    pub(crate) mass: Option<f64>,
    #[serde(default)]
    pub(crate) shapes: Vec<ShapeMessage>,
    /// Pose of a body that does not move.
    pub(crate) position: Option<[f64; 3]>,
    pub(crate) rotation: Option<[f64; 4]>,
}

#[derive(Debug, Deserialize)]
pub(crate) struct ShapeMessage {
    pub(crate) kind: String,
    #[serde(default)]
    pub(crate) size: Vec<f64>,
    #[serde(default)]
    pub(crate) points: Vec<[f64; 3]>,
    pub(crate) position: [f64; 3],
    pub(crate) rotation: [f64; 4],
    pub(crate) collides: bool,
    pub(crate) friction: Option<f64>,
}

#[derive(Debug, Deserialize)]
pub(crate) struct JointMessage {
    pub(crate) name: String,
    pub(crate) body: usize,
    pub(crate) kind: String,
    pub(crate) limits: Option<[f64; 2]>,
    pub(crate) max_effort: Option<f64>,
    pub(crate) max_velocity: Option<f64>,
}

#[derive(Debug, Deserialize)]
pub(crate) struct SiteMessage {
    pub(crate) name: String,
    pub(crate) body: usize,
    pub(crate) position: [f64; 3],
    pub(crate) rotation: [f64; 4],
}

/// `actcheck.Mark`.
#[derive(Debug, Deserialize)]
pub(crate) struct MarkMessage {
    pub(crate) action: String,
    pub(crate) event: String,
    #[serde(default)]
    pub(crate) parameters: std::collections::BTreeMap<String, Values>,
    pub(crate) reported: Option<bool>,
    pub(crate) message: Option<String>,
}

/// The value of a designator, or several.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
pub(crate) enum Values {
    One(String),
    Several(Vec<String>),
}

impl Values {
    /// The values as a list.
    pub(crate) fn list(self) -> Vec<String> {
        match self {
            Self::One(value) => vec![value],
            Self::Several(values) => values,
        }
    }
}
