//! Messages of the protocol, except commands and observations, which have their own modules.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::observation::Observed;
use actcheck_actions::ExternalFault;
use actcheck_data::Pose;

/// Version of the protocol. Versions are incompatible with each other.
pub const PROTOCOL: u32 = 1;

/// A pose on the wire.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WirePose {
    pub position_m: [f64; 3],
    pub quaternion_xyzw: [f64; 4],
}

/// An object, perceived or true. Frame of its pose: world, by the robot's belief unless it is
/// ground truth.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WireObject {
    pub id: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub category: Option<String>,
    pub pose: WirePose,
    pub size_m: [f64; 3],
    /// Whether it is fixed furniture.
    pub furniture: bool,
}

/// Ground truth about all objects.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Truth {
    pub objects: Vec<WireObject>,
}

/// The kind of object that a designator's value refers to.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WireKind {
    pub category: String,
    pub size_m: [f64; 3],
}

/// Description of a binary frame that follows a message.
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

/// The type of a message from the program.
#[derive(Deserialize)]
struct Typed<'a> {
    #[serde(borrow, rename = "type")]
    kind: std::borrow::Cow<'a, str>,
}

/// The type of a message.
///
/// # Errors
/// The message is not a JSON object with a `type`.
pub fn kind_of(message: &[u8]) -> Result<String, ExternalFault> {
    let typed: Typed<'_> =
        serde_json::from_slice(message).map_err(|error| wrong("a message", &error, message))?;
    Ok(short(&typed.kind))
}

/// Parses a message of a known type.
///
/// # Errors
/// The message is not JSON, or has missing, unknown or invalid fields.
pub fn parse<'a, T: Deserialize<'a>>(kind: &str, message: &'a [u8]) -> Result<T, ExternalFault> {
    serde_json::from_slice(message)
        .map_err(|error| wrong(&format!("a message `{kind}`"), &error, message))
}

/// Longest quoted part of an invalid message. Unit: characters.
const QUOTED: usize = 80;

/// Longest name or reason of a message that is repeated in a fault. Unit: characters.
const REPEATED: usize = 300;

/// The beginning of a text: a message may hold a name of a megabyte.
pub fn short(text: &str) -> String {
    match text.char_indices().nth(REPEATED) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

fn wrong(what: &str, error: &serde_json::Error, message: &[u8]) -> ExternalFault {
    let error = short(&error.to_string());
    let text = String::from_utf8_lossy(&message[..message.len().min(4 * QUOTED)]);
    let quoted: String = text
        .chars()
        .take(QUOTED)
        .flat_map(char::escape_debug)
        .collect();
    ExternalFault {
        late: false,
        reason: format!("it sent {what} that can't be parsed: {error}, in `{quoted}`"),
    }
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

/// A message without content besides its type.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plain {
    #[serde(rename = "type")]
    _kind: serde::de::IgnoredAny,
}

/// A request for perception.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ask {
    #[serde(rename = "type")]
    _kind: serde::de::IgnoredAny,
    pub what: What,
    #[serde(default)]
    pub of: Option<String>,
}

/// Data that can be requested.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum What {
    Depth,
    Rgb,
    Cloud,
    Objects,
}

impl What {
    /// The word for it in messages.
    pub fn word(self) -> &'static str {
        match self {
            Self::Depth => "depth",
            Self::Rgb => "rgb",
            Self::Cloud => "cloud",
            Self::Objects => "objects",
        }
    }
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

/// An object perceived by the program.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PerceivedOnWire {
    pub pose: WirePose,
    pub size_m: [f64; 3],
    #[serde(default)]
    pub category: Option<String>,
}

/// The level surface perceived by the program.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlaneOnWire {
    pub pose: WirePose,
    pub size_m: [f64; 2],
}

/// The object held by the program's robot.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeldOnWire {
    pub pose: WirePose,
    pub size_m: [f64; 3],
}

/// Quaternions shorter than this have no direction.
const SHORTEST: f64 = 1e-6;

impl WirePose {
    /// A pose for the wire.
    pub fn of(pose: &Pose) -> Self {
        Self {
            position_m: pose.position,
            quaternion_xyzw: pose.rotation,
        }
    }

    /// A pose from the wire, with its quaternion normalised.
    ///
    /// # Errors
    /// The quaternion is not finite, or too short to be a rotation.
    pub fn pose(&self) -> Result<Pose, ExternalFault> {
        let length = self
            .quaternion_xyzw
            .iter()
            .map(|part| part * part)
            .sum::<f64>()
            .sqrt();
        if !length.is_finite() || length < SHORTEST {
            let reason = format!(
                "it sent a pose whose quaternion {:?} is not a rotation",
                self.quaternion_xyzw
            );
            return Err(ExternalFault {
                late: false,
                reason,
            });
        }
        Ok(Pose {
            position: self.position_m,
            rotation: self.quaternion_xyzw.map(|part| part / length),
        })
    }
}
