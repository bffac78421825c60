//! What goes over the wire, but for commands and observations, which go often and have files of their own.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::actions::OutsideFault;
use crate::base::Pose;
use crate::protocol::observation::Observed;

/// Version of the protocol. Another version may understand nothing of this one.
pub const PROTOCOL: u32 = 1;

/// A pose on the wire.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WirePose {
    pub position_m: [f64; 3],
    pub quaternion_xyzw: [f64; 4],
}

/// Something that is seen, or that truly is. Frame of its pose: world, by the robot's belief unless it is the truth.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WireObject {
    pub id: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub category: Option<String>,
    pub pose: WirePose,
    pub size_m: [f64; 3],
    /// Whether it stands for good.
    pub furniture: bool,
}

/// Everything as it truly is.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Truth {
    pub objects: Vec<WireObject>,
}

/// What a program is told with the value of a designator: what kind of thing it stands for.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WireKind {
    pub category: String,
    pub size_m: [f64; 3],
}

/// Binary frames that follow a message.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Binary {
    pub name: &'static str,
    pub dtype: &'static str,
    pub shape: Vec<usize>,
}

/// Messages to the program.
#[derive(Debug, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum ToProgram<'a> {
    Reset {
        run: &'a str,
        index: u64,
        seed: u64,
    },
    Begin {
        action: &'a str,
        parameters: BTreeMap<&'a str, &'a [String]>,
        kinds: BTreeMap<&'a str, WireKind>,
        budget_s: f64,
        observation: Observed<'a>,
    },
    Abort {
        reason: &'a str,
    },
    Error {
        reason: &'a str,
    },
    Bye,
}

/// A message from the program: its type first.
#[derive(Deserialize)]
struct Typed<'a> {
    #[serde(borrow, rename = "type")]
    kind: std::borrow::Cow<'a, str>,
}

/// The type of a message.
pub fn kind_of(message: &[u8]) -> Result<String, OutsideFault> {
    let typed: Typed<'_> = serde_json::from_slice(message).map_err(|error| wrong("a message", &error, message))?;
    Ok(typed.kind.into_owned())
}

/// A message of a known type.
pub fn parse<'a, T: Deserialize<'a>>(kind: &str, message: &'a [u8]) -> Result<T, OutsideFault> {
    serde_json::from_slice(message).map_err(|error| wrong(&format!("a message `{kind}`"), &error, message))
}

/// Longest part of a wrong message that is quoted. Unit: characters.
const QUOTED: usize = 80;

fn wrong(what: &str, error: &serde_json::Error, message: &[u8]) -> OutsideFault {
    let text = String::from_utf8_lossy(&message[..message.len().min(4 * QUOTED)]);
    let quoted: String = text.chars().take(QUOTED).flat_map(char::escape_debug).collect();
    OutsideFault { late: false, reason: format!("it sent {what} that can't be read: {error}, in `{quoted}`") }
}

/// The program's introduction.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hello {
    #[serde(rename = "type")]
    _kind: serde::de::IgnoredAny,
    pub protocol: u32,
    #[serde(default)]
    pub name: Option<String>,
    pub actions: Vec<String>,
}

/// A message that says nothing but its type.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plain {
    #[serde(rename = "type")]
    _kind: serde::de::IgnoredAny,
}

/// A request for what the robot sees.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ask {
    #[serde(rename = "type")]
    _kind: serde::de::IgnoredAny,
    pub what: What,
    #[serde(default)]
    pub of: Option<String>,
}

/// What can be asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum What {
    Depth,
    Cloud,
    Objects,
}

/// The end of an action.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct End {
    #[serde(rename = "type")]
    _kind: serde::de::IgnoredAny,
    pub succeeded: bool,
    #[serde(default)]
    pub message: String,
    #[serde(default)]
    pub perceived: Option<Vec<PerceivedOnWire>>,
    #[serde(default)]
    pub plane: Option<PlaneOnWire>,
    #[serde(default)]
    pub held: Option<HeldOnWire>,
}

/// Something that the program perceived.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PerceivedOnWire {
    pub pose: WirePose,
    pub size_m: [f64; 3],
    #[serde(default)]
    pub category: Option<String>,
}

/// The level surface that it perceived.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlaneOnWire {
    pub pose: WirePose,
    pub size_m: [f64; 2],
}

/// What it holds.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeldOnWire {
    pub pose: WirePose,
    pub size_m: [f64; 3],
}

/// Quaternions shorter than this point nowhere.
const SHORTEST: f64 = 1e-6;

impl WirePose {
    /// A pose for the wire.
    pub fn of(pose: &Pose) -> Self {
        Self { position_m: pose.position, quaternion_xyzw: pose.rotation }
    }

    /// A pose from the wire, its quaternion brought to length 1.
    pub fn pose(&self) -> Result<Pose, OutsideFault> {
        let length = self.quaternion_xyzw.iter().map(|part| part * part).sum::<f64>().sqrt();
        if !length.is_finite() || length < SHORTEST {
            let reason = format!("it sent a pose whose quaternion {:?} is no rotation", self.quaternion_xyzw);
            return Err(OutsideFault { late: false, reason });
        }
        Ok(Pose { position: self.position_m, rotation: self.quaternion_xyzw.map(|part| part / length) })
    }
}
