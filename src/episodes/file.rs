//! Reads an episode from an MCAP file.

use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use actcheck_base::{Diagnostic, Diagnostics, Digest, open_regular};
use actcheck_data::{Part, Pose, Shape as Geometry};
use mcap::parse_record;
use mcap::records::Record;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use nalgebra::Quaternion;
use prost::Message as _;

use crate::messages;
use crate::{
    Body, Contact, Episode, Joint, JointKind, Mark, Model, Outcome, Quantity, Shape, Site, State,
};

/// Largest record of a file: a damaged length must not request more memory. Unit: bytes. The model
/// is the largest one, with some hundred kilobytes.
const LARGEST_RECORD: usize = 64 << 20;
/// Most states of an episode.
const MOST_STATES: usize = 1_000_000;
/// Most records of a file: the channels and quantities of [`MOST_STATES`], with room to spare.
const MOST_RECORDS: usize = 16 * MOST_STATES;
/// Longest episode. Unit: seconds.
const LONGEST_SECS: f64 = 4.0 * 3600.0;
/// Largest absolute value of positions, velocities and forces. Larger ones come from a simulation
/// that diverged.
const LARGEST_VALUE: f64 = 1e6;
/// Largest difference between the length of a quaternion and 1.
const UNIT_TOLERANCE: f64 = 1e-3;

impl Episode {
    /// Reads an episode file.
    ///
    /// # Errors
    /// E001 if the file can't be read, E002 if it is not an episode file or damaged, E003 if a
    /// value is impossible, and E004 if it is too large.
    pub fn read(path: &Path) -> Result<(Self, String), Diagnostics> {
        let mut records = Records::open(path)?;
        let read = Reader::default().read(&mut records);
        let episode = read.map_err(|fault| fault.of_file(path))?;
        Ok((episode, records.digest.finish()))
    }

    /// Reads the environment that an episode file names; empty if it names none.
    ///
    /// # Errors
    /// As [`Episode::read`].
    pub fn environment(path: &Path) -> Result<String, Diagnostics> {
        let mut records = Records::open(path)?;
        let mut environment = None;
        let read = records.each(|record| {
            if let Record::Metadata(metadata) = record
                && metadata.name == METADATA
            {
                environment = Some(metadata.metadata.get("environment").cloned());
            }
            Ok(())
        });
        let found = read.and(environment.ok_or(FileFault::Missing("metadata `actcheck.episode`")));
        found
            .map(Option::unwrap_or_default)
            .map_err(|fault| fault.of_file(path))
    }
}

/// Name of the metadata with the origin of an episode.
const METADATA: &str = "actcheck.episode";

/// The records of a file, read one after the other: memory does not depend on the file's size.
struct Records {
    file: File,
    digest: Digest,
}

impl Records {
    fn open(path: &Path) -> Result<Self, Diagnostics> {
        let shown = path.display();
        let unreadable = |error: std::io::Error| {
            Diagnostic::error("E001", format!("can't read {shown}: {error}"))
                .help("give files that `actcheck.record` or `actcheck import` wrote")
        };
        let file = open_regular(path).map_err(|error| Diagnostics::from(unreadable(error)))?;
        Ok(Self {
            file,
            digest: Digest::new(),
        })
    }

    /// Calls a function with each record, those within chunks too.
    fn each(
        &mut self,
        mut see: impl FnMut(Record<'_>) -> Result<(), FileFault>,
    ) -> Result<(), FileFault> {
        let options = LinearReaderOptions::default()
            .with_validate_chunk_crcs(true)
            .with_validate_data_section_crc(true)
            .with_validate_summary_section_crc(true)
            .with_record_length_limit(LARGEST_RECORD);
        let mut reader = LinearReader::new_with_options(options);
        let mut count = 0;
        while let Some(event) = reader.next_event() {
            match event? {
                LinearReadEvent::ReadRequest(size) => {
                    let buffer = reader.insert(size.min(LARGEST_RECORD));
                    let count = self.file.read(buffer)?;
                    self.digest.update(&buffer[..count]);
                    reader.notify_read(count);
                }
                LinearReadEvent::Record { opcode: 0, .. } => {
                    return Err(FileFault::Damaged("a record has no kind"));
                }
                LinearReadEvent::Record { data, opcode } => {
                    count += 1;
                    if count > MOST_RECORDS {
                        return Err(FileFault::TooMany);
                    }
                    see(parse_record(opcode, data)?)?;
                }
            }
        }
        if self.file.read(&mut [0])? > 0 {
            return Err(FileFault::Damaged("the file goes on after its end"));
        }
        Ok(())
    }
}

/// Why a file can't be read.
#[derive(Debug, thiserror::Error)]
enum FileFault {
    #[error("not an MCAP file, or damaged: {0}")]
    Mcap(#[from] mcap::McapError),
    #[error("not an MCAP file, or damaged: {0}")]
    Damaged(&'static str),
    #[error("can't be read: {0}")]
    Unreadable(#[from] std::io::Error),
    #[error("a message on `{topic}` can't be read: {reason}")]
    Message { topic: String, reason: String },
    #[error("it has no `{0}`")]
    Missing(&'static str),
    #[error("its format is {0:?}")]
    Format(String),
    #[error("{0}")]
    Value(String),
    #[error("it has more than {MOST_STATES} states")]
    TooLong,
    #[error("it has more than {MOST_RECORDS} records")]
    TooMany,
    #[error("it lasts {0} s, longer than {LONGEST_SECS} s")]
    TooLate(f64),
}

impl FileFault {
    fn of_file(&self, path: &Path) -> Diagnostics {
        let (code, message, help) = self.words();
        Diagnostic::error(code, format!("{}: {message}", path.display()))
            .help(help)
            .into()
    }

    fn words(&self) -> (&'static str, String, &'static str) {
        let (code, help) = match self {
            Self::Unreadable(_) => ("E001", "copy the file again from its source"),
            Self::Mcap(_) | Self::Damaged(_) | Self::Message { .. } => {
                ("E002", "record it again, or copy it again from its source")
            }
            Self::Missing(_) => (
                "E002",
                "it is not an episode file: `actcheck import` reads those of `actcheck.record`, and HDF5 files, LeRobot datasets and bags",
            ),
            Self::Format(_) => (
                "E002",
                "this version reads format 1: install the version that wrote the file",
            ),
            Self::Value(_) => (
                "E003",
                "the simulation diverged, or the file was edited: leave this episode out",
            ),
            Self::TooLong | Self::TooMany | Self::TooLate(_) => ("E004", "record shorter episodes"),
        };
        (code, self.to_string(), help)
    }
}

/// The state of reading a file.
#[derive(Default)]
struct Reader {
    topics: HashMap<u16, String>,
    about: Option<BTreeMap<String, String>>,
    model: Option<Model>,
    /// Poses of the bodies that don't move.
    fixed: Vec<Pose>,
    /// Indices of the moving bodies.
    moving: Vec<usize>,
    by_name: HashMap<String, usize>,
    /// States by their time, in nanoseconds.
    states: BTreeMap<u64, State>,
    /// Marks, each with its time in nanoseconds.
    marks: Vec<(u64, Mark)>,
    has_contacts: bool,
}

impl Reader {
    fn read(mut self, records: &mut Records) -> Result<Episode, FileFault> {
        records.each(|record| {
            match record {
                Record::Channel(channel) => {
                    self.topics.insert(channel.id, channel.topic);
                }
                Record::Metadata(metadata) if metadata.name == METADATA => {
                    self.about = Some(metadata.metadata);
                }
                Record::Message { header, data } => {
                    if let Some(topic) = self.topics.get(&header.channel_id).cloned() {
                        self.message(&topic, header.log_time, &data)?;
                    }
                }
                _ => {}
            }
            Ok(())
        })?;
        self.finish()
    }

    fn message(&mut self, topic: &str, time: u64, data: &[u8]) -> Result<(), FileFault> {
        let unreadable = |reason: String| FileFault::Message {
            topic: topic.to_owned(),
            reason,
        };
        let wire = |error: prost::DecodeError| unreadable(error.to_string());
        let json = |error: serde_json::Error| unreadable(error.to_string());
        match topic {
            "/model" => {
                let model: messages::ModelMessage = serde_json::from_slice(data).map_err(json)?;
                self.set_model(model)?;
            }
            "/tf" => {
                let found = messages::FrameTransforms::decode(data).map_err(wire)?;
                self.poses(time, found)?;
            }
            "/velocities" => {
                let found = messages::Velocities::decode(data).map_err(wire)?;
                self.velocities(time, &found)?;
            }
            "/joints" => {
                let found = messages::Joints::decode(data).map_err(wire)?;
                self.joints(time, found)?;
            }
            "/contacts" => {
                let found = messages::Contacts::decode(data).map_err(wire)?;
                self.contacts(time, &found)?;
            }
            "/outcome" => {
                let found = messages::OutcomeMessage::decode(data).map_err(wire)?;
                self.state(time)?.outcome = Some(Outcome {
                    reward: found.reward,
                    success: found.success,
                    terminated: found.terminated,
                    truncated: found.truncated,
                });
            }
            "/marks" => {
                let mark: messages::MarkMessage = serde_json::from_slice(data).map_err(json)?;
                if !matches!(mark.event.as_str(), "begin" | "end") {
                    return Err(unreadable(format!(
                        "the event is `{}`, not `begin` or `end`",
                        mark.event
                    )));
                }
                let mark = Mark {
                    time_secs: 0.0,
                    action: mark.action,
                    begins: mark.event == "begin",
                    parameters: mark
                        .parameters
                        .into_iter()
                        .map(|(name, values)| (name, values.list()))
                        .collect(),
                    reported: mark.reported,
                    message: mark.message.unwrap_or_default(),
                };
                self.marks.push((time, mark));
            }
            _ => {}
        }
        Ok(())
    }

    /// Returns the state at a time, which is created with the poses of the fixed bodies.
    fn state(&mut self, time: u64) -> Result<&mut State, FileFault> {
        if self.states.len() >= MOST_STATES && !self.states.contains_key(&time) {
            return Err(FileFault::TooLong);
        }
        Ok(self.states.entry(time).or_insert_with(|| State {
            poses: self.fixed.clone(),
            ..State::default()
        }))
    }

    fn model(&self) -> Result<&Model, FileFault> {
        self.model
            .as_ref()
            .ok_or(FileFault::Missing("message on `/model` before the states"))
    }

    fn set_model(&mut self, model: messages::ModelMessage) -> Result<(), FileFault> {
        if self.model.is_some() {
            return Err(FileFault::Value(
                "the model changes within the episode".to_owned(),
            ));
        }
        let count = model.bodies.len();
        for (idx, body) in model.bodies.iter().enumerate() {
            if body.parent.is_some_and(|parent| parent >= idx) {
                return Err(FileFault::Value(format!(
                    "body `{}` comes before the body that carries it",
                    body.name
                )));
            }
            self.fixed.push(match (body.position, body.rotation) {
                (Some(position), Some(rotation)) => pose(&body.name, position, rotation)?,
                _ => Pose::IDENTITY,
            });
            self.by_name.entry(body.name.clone()).or_insert(idx);
            if body.moves {
                self.moving.push(idx);
            }
        }
        let of_model = model
            .joints
            .iter()
            .map(|joint| (&joint.name, joint.body))
            .chain(model.sites.iter().map(|site| (&site.name, site.body)));
        for (name, body) in of_model {
            if body >= count {
                return Err(FileFault::Value(format!(
                    "`{name}` belongs to body {body}, but there are {count} bodies"
                )));
            }
        }
        self.model = Some(converted(model)?);
        Ok(())
    }

    fn poses(&mut self, time: u64, found: messages::FrameTransforms) -> Result<(), FileFault> {
        self.model()?;
        let mut poses = Vec::new();
        for (number, transform) in found.transforms.into_iter().enumerate() {
            // Usually in the model's order.
            let expected = self.moving.get(number).copied();
            let is_expected = expected.is_some_and(|idx| {
                self.model
                    .as_ref()
                    .is_some_and(|model| model.bodies[idx].name == transform.child_frame_id)
            });
            let idx = match expected.filter(|_| is_expected) {
                Some(idx) => Some(idx),
                None => self.by_name.get(&transform.child_frame_id).copied(),
            };
            let (Some(idx), Some(at), Some(turn)) =
                (idx, transform.translation, transform.rotation)
            else {
                continue;
            };
            let rotation = [turn.x, turn.y, turn.z, turn.w];
            poses.push((
                idx,
                pose(&transform.child_frame_id, [at.x, at.y, at.z], rotation)?,
            ));
        }
        let state = self.state(time)?;
        for (idx, pose) in poses {
            state.poses[idx] = pose;
        }
        Ok(())
    }

    fn velocities(&mut self, time: u64, found: &messages::Velocities) -> Result<(), FileFault> {
        let count = self.model()?.bodies.len();
        let moving = self.moving.clone();
        if found.linear.len() != 3 * moving.len() || found.angular.len() != 3 * moving.len() {
            return Err(FileFault::Value(format!(
                "the velocities at {} s are not those of {} moving bodies",
                secs(time),
                moving.len()
            )));
        }
        checked("velocity", time, found.linear.iter().chain(&found.angular))?;
        let mut velocities = vec![[[0.0; 3]; 2]; count];
        for ((idx, linear), angular) in moving
            .into_iter()
            .zip(found.linear.chunks_exact(3))
            .zip(found.angular.chunks_exact(3))
        {
            velocities[idx] = [
                [linear[0], linear[1], linear[2]],
                [angular[0], angular[1], angular[2]],
            ];
        }
        self.state(time)?.velocities = velocities;
        Ok(())
    }

    fn joints(&mut self, time: u64, found: messages::Joints) -> Result<(), FileFault> {
        let scalar = self
            .model()?
            .joints
            .iter()
            .filter(|joint| joint.is_scalar());
        let count = scalar.count();
        for (quantity, values) in [
            ("position of a joint", &found.position),
            ("velocity of a joint", &found.velocity),
            ("effort of a joint", &found.effort),
        ] {
            if !values.is_empty() && values.len() != count {
                return Err(FileFault::Value(format!(
                    "{} values for {count} joints at {} s",
                    values.len(),
                    secs(time)
                )));
            }
            checked(quantity, time, values)?;
        }
        let state = self.state(time)?;
        state.positions = found.position;
        state.speeds = found.velocity;
        state.efforts = found.effort;
        Ok(())
    }

    fn contacts(&mut self, time: u64, found: &messages::Contacts) -> Result<(), FileFault> {
        self.has_contacts = true;
        let bodies = self.model()?.bodies.len();
        let count = found.first.len();
        let is_complete = found.second.len() == count
            && [found.normal_force.len(), found.distance.len()]
                .iter()
                .all(|len| *len == count || *len == 0)
            && [found.force.len(), found.position.len()]
                .iter()
                .all(|len| *len == 3 * count || *len == 0);
        if !is_complete {
            return Err(FileFault::Value(format!(
                "the contacts at {} s are incomplete",
                secs(time)
            )));
        }
        let values = [
            &found.normal_force,
            &found.force,
            &found.position,
            &found.distance,
        ];
        checked("quantity of a contact", time, values.into_iter().flatten())?;
        let three = |list: &[f64], idx: usize| {
            list.get(3 * idx..3 * idx + 3)
                .map_or([0.0; 3], |found| [found[0], found[1], found[2]])
        };
        let mut contacts = Vec::with_capacity(count);
        for idx in 0..count {
            let pair = [found.first[idx], found.second[idx]].map(|body| body as usize);
            if pair.iter().any(|body| *body >= bodies) {
                return Err(FileFault::Value(format!(
                    "a contact at {} s is one of body {}, but there are {bodies} bodies",
                    secs(time),
                    pair[0].max(pair[1])
                )));
            }
            contacts.push(Contact {
                bodies: pair,
                normal_n: found.normal_force.get(idx).copied().unwrap_or_default(),
                force_n: three(&found.force, idx),
                point_m: three(&found.position, idx),
                distance_m: found.distance.get(idx).copied().unwrap_or_default(),
            });
        }
        self.state(time)?.contacts = contacts;
        Ok(())
    }

    fn finish(self) -> Result<Episode, FileFault> {
        let about = self
            .about
            .ok_or(FileFault::Missing("metadata `actcheck.episode`"))?;
        match about.get("format").map(String::as_str) {
            Some("1") => {}
            other => return Err(FileFault::Format(other.unwrap_or_default().to_owned())),
        }
        let mut lacks = crate::Lacks::default();
        for word in about.get("lacks").map_or("", String::as_str).split(',') {
            if let Some(quantity) = Quantity::from_word(word.trim()) {
                lacks.add(quantity);
            }
        }
        if !self.has_contacts {
            lacks.add(Quantity::Contacts);
        }
        let model = self
            .model
            .ok_or(FileFault::Missing("message on `/model`"))?;
        let (Some(begin), Some(end)) = (
            self.states.keys().next().copied(),
            self.states.keys().next_back().copied(),
        ) else {
            return Err(FileFault::Missing("states"));
        };
        if secs(end - begin) > LONGEST_SECS {
            return Err(FileFault::TooLate(secs(end - begin)));
        }
        // Other programs count time from another moment than the first state.
        let since_begin = |time: u64| secs(time.saturating_sub(begin));
        let states = self.states.into_iter().map(|(time, mut state)| {
            state.time_secs = since_begin(time);
            state
        });
        let marks = self.marks.into_iter().map(|(time, mut mark)| {
            mark.time_secs = since_begin(time);
            mark
        });
        Ok(Episode {
            about,
            model,
            states: states.collect(),
            marks: marks.collect(),
            lacks,
        })
    }
}

/// Time in seconds.
fn secs(nanos: u64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "exact up to 104 days")]
    let secs = nanos as f64 / 1e9;
    secs
}

/// Checks that values are numbers of a plausible size.
fn checked<'v>(
    quantity: &str,
    time: u64,
    values: impl IntoIterator<Item = &'v f64>,
) -> Result<(), FileFault> {
    match values
        .into_iter()
        .find(|value| value.is_nan() || value.abs() > LARGEST_VALUE)
    {
        Some(value) => Err(FileFault::Value(format!(
            "a {quantity} is {value} at {} s",
            secs(time)
        ))),
        None => Ok(()),
    }
}

/// A pose with a unit quaternion.
fn pose(name: &str, position: [f64; 3], rotation: [f64; 4]) -> Result<Pose, FileFault> {
    let [x, y, z, w] = rotation;
    let turn = Quaternion::new(w, x, y, z);
    let is_position = |value: &f64| value.is_finite() && value.abs() <= LARGEST_VALUE;
    let is_unit = (turn.norm() - 1.0).abs() <= UNIT_TOLERANCE;
    if !is_unit || !position.iter().all(is_position) {
        return Err(FileFault::Value(format!(
            "the pose of `{name}` is impossible: position {position:?}, quaternion {rotation:?}"
        )));
    }
    let unit = turn / turn.norm();
    Ok(Pose {
        position,
        rotation: [unit.i, unit.j, unit.k, unit.w],
    })
}

fn converted(model: messages::ModelMessage) -> Result<Model, FileFault> {
    let bodies = model
        .bodies
        .into_iter()
        .map(|body| {
            let shapes = body
                .shapes
                .iter()
                .map(|shape| converted_shape(&body.name, shape))
                .collect::<Result<Vec<Shape>, FileFault>>()?;
            Ok(Body {
                name: body.name,
                parent: body.parent,
                moves: body.moves,
                mass_kg: body.mass,
                shapes,
            })
        })
        .collect::<Result<Vec<Body>, FileFault>>()?;
    let joints = model
        .joints
        .into_iter()
        .map(|joint| {
            let kind = match joint.kind.as_str() {
                "hinge" => JointKind::Hinge,
                "slide" => JointKind::Slide,
                "ball" => JointKind::Ball,
                "free" => JointKind::Free,
                other => {
                    return Err(FileFault::Value(format!(
                        "joint `{}` is of the unknown kind `{other}`",
                        joint.name
                    )));
                }
            };
            Ok(Joint {
                name: joint.name,
                body: joint.body,
                kind,
                limits: joint.limits,
                max_effort: joint.max_effort,
                max_velocity: joint.max_velocity,
            })
        })
        .collect::<Result<Vec<Joint>, FileFault>>()?;
    let sites = model
        .sites
        .into_iter()
        .map(|site| {
            Ok(Site {
                pose: pose(&site.name, site.position, site.rotation)?,
                name: site.name,
                body: site.body,
            })
        })
        .collect::<Result<Vec<Site>, FileFault>>()?;
    Ok(Model {
        bodies,
        joints,
        actuators: model
            .actuators
            .into_iter()
            .map(|named| named.name)
            .collect(),
        sites,
    })
}

fn converted_shape(body: &str, shape: &messages::ShapeMessage) -> Result<Shape, FileFault> {
    let wrong = || {
        FileFault::Value(format!(
            "body `{body}` has a shape `{}` with the sizes {:?}",
            shape.kind, shape.size
        ))
    };
    if !shape
        .size
        .iter()
        .chain(shape.points.iter().flatten())
        .all(|value| value.is_finite() && value.abs() <= LARGEST_VALUE)
        || shape.size.iter().any(|value| *value < 0.0)
    {
        return Err(wrong());
    }
    let geometry = match (shape.kind.as_str(), shape.size.as_slice()) {
        ("plane", _) => None,
        ("box", [x, y, z]) => Some(Geometry::Box { size: [*x, *y, *z] }),
        ("sphere", [radius]) => Some(Geometry::Sphere { radius: *radius }),
        ("cylinder", [radius, height]) => Some(Geometry::Cylinder {
            radius: *radius,
            height: *height,
        }),
        ("capsule", [radius, height]) => Some(Geometry::Capsule {
            radius: *radius,
            height: *height,
        }),
        ("ellipsoid", [a, b, c]) => Some(Geometry::Hull {
            points: ellipsoid([*a, *b, *c]),
            volume: 4.0 / 3.0 * std::f64::consts::PI * a * b * c,
        }),
        // The volume is used for masses, which an episode states itself.
        ("hull", _) if shape.points.len() >= 4 => Some(Geometry::Hull {
            points: shape.points.clone(),
            volume: 0.0,
        }),
        _ => return Err(wrong()),
    };
    let at = pose(body, shape.position, shape.rotation)?;
    Ok(Shape {
        part: geometry.map(|shape| Part { pose: at, shape }),
        collides: shape.collides,
        friction: shape.friction,
    })
}

/// Returns points on an ellipsoid, every 22.5 degrees.
fn ellipsoid([a, b, c]: [f64; 3]) -> Vec<[f64; 3]> {
    use std::f64::consts::PI;
    let mut points = vec![[0.0, 0.0, c], [0.0, 0.0, -c]];
    for ring in 1..8 {
        let polar = f64::from(ring) * PI / 8.0;
        for step in 0..16 {
            let around = f64::from(step) * PI / 8.0;
            points.push([
                a * libm::sin(polar) * libm::cos(around),
                b * libm::sin(polar) * libm::sin(around),
                c * libm::cos(polar),
            ]);
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::path::{Path, PathBuf};

    use mcap::Writer;
    use mcap::records::MessageHeader;

    use super::*;

    /// An episode file of the tests, written again with other times of its messages, and a mark at
    /// its end.
    fn with_times(folder: &Path, time_of: impl Fn(u64) -> u64) -> PathBuf {
        let source = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("../../tests/data/episodes/good-000001.mcap");
        let path = folder.join("episode.mcap");
        let mut writer = Writer::new(File::create(&path).expect("a new file")).expect("a writer");
        let mut channels: HashMap<u16, u16> = HashMap::new();
        let none = BTreeMap::new();
        let mut last = 0;
        let mut records = Records::open(&source).expect("the file exists");
        records
            .each(|record| {
                match record {
                    Record::Channel(channel) => {
                        let id = writer.add_channel(0, &channel.topic, "", &none)?;
                        channels.insert(channel.id, id);
                    }
                    Record::Message { header, data } => {
                        last = last.max(time_of(header.log_time));
                        let header = MessageHeader {
                            channel_id: channels[&header.channel_id],
                            log_time: time_of(header.log_time),
                            ..header
                        };
                        writer.write_to_known_channel(&header, &data)?;
                    }
                    Record::Metadata(metadata) => writer.write_metadata(&metadata)?,
                    _ => {}
                }
                Ok(())
            })
            .expect("the file can be copied");
        let channel_id = writer
            .add_channel(0, "/marks", "", &none)
            .expect("a channel");
        let mark = br#"{"action": "Pick", "event": "begin", "parameters": {}}"#;
        let header = MessageHeader {
            channel_id,
            sequence: 0,
            log_time: last,
            publish_time: last,
        };
        writer
            .write_to_known_channel(&header, mark)
            .expect("a mark");
        writer.finish().expect("a finished file");
        path
    }

    #[test]
    fn times_count_from_the_first_state() {
        let folder = tempfile::tempdir().expect("a folder");
        // As of a clock that counts since 1970.
        let path = with_times(folder.path(), |time| time + 1_796_000_000_123_456_789);
        let (episode, _) = Episode::read(&path).expect("the file is valid");
        let times = |at: usize| episode.states[at].time_secs;
        let last = times(episode.states.len() - 1);
        assert_eq!(times(0).to_bits(), 0.0f64.to_bits());
        assert!((times(1) - 0.1).abs() < 1e-9, "{}", times(1));
        let mark = episode.marks.last().expect("a mark");
        assert_eq!(mark.time_secs.to_bits(), last.to_bits());
    }

    #[test]
    fn an_endless_episode_is_a_fault() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = with_times(folder.path(), |time| time * 1_000_000);
        let faults = Episode::read(&path).expect_err("it lasts days");
        let codes: Vec<&str> = faults.into_iter().map(|fault| fault.code).collect();
        assert_eq!(codes, ["E004"]);
    }
}
