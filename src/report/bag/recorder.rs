//! Writes messages as an MCAP file.

use std::collections::BTreeMap;
use std::io::Cursor;

use mcap::records::MessageHeader;
use mcap::{McapError, WriteOptions, Writer};

use crate::bag::cdr::{Cdr, Stamp};
use crate::bag::types::{Topic, schema, schema_name};

/// A bag can't be written. No run should cause this, but the library can return it.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct BagFault(#[from] McapError);

/// Messages of a bag.
#[derive(Debug, Default)]
pub(super) struct Recorder {
    messages: Vec<(Stamp, Topic, Vec<u8>)>,
}

impl Recorder {
    /// Adds a message.
    pub fn add(&mut self, topic: Topic, at: Stamp, message: Cdr) {
        self.messages.push((at, topic, message.finish()));
    }

    /// Returns the bytes of the file, with the messages in order of time. `about` is stored as
    /// metadata.
    ///
    /// # Errors
    /// The library can't write a record.
    pub fn finish(mut self, about: BTreeMap<String, String>) -> Result<Vec<u8>, BagFault> {
        self.messages.sort_by_key(|(at, ..)| *at);
        // With one thread, compressed chunks do not depend on the machine.
        let options = WriteOptions::new()
            .profile("ros2")
            .library("actcheck")
            .compression_threads(0);
        let mut writer: Writer<Cursor<Vec<u8>>> = options.create(Cursor::default())?;
        writer.write_metadata(&mcap::records::Metadata {
            name: "actcheck.run".to_owned(),
            metadata: about,
        })?;
        let mut channels: BTreeMap<&str, (u16, u32)> = BTreeMap::new();
        for (at, topic, data) in &self.messages {
            let (channel, sent) = match channels.get(topic.name) {
                Some(known) => *known,
                None => (begin(&mut writer, topic)?, 0),
            };
            channels.insert(topic.name, (channel, sent + 1));
            let header = MessageHeader {
                channel_id: channel,
                sequence: sent,
                log_time: at.0,
                publish_time: at.0,
            };
            writer.write_to_known_channel(&header, data)?;
        }
        writer.finish()?;
        Ok(writer.into_inner().into_inner())
    }
}

/// Adds a topic with its type. Returns the number of its channel.
fn begin(writer: &mut Writer<Cursor<Vec<u8>>>, topic: &Topic) -> Result<u16, BagFault> {
    let (name, text) = (schema_name(topic.kind), schema(topic.kind));
    let schema = writer.add_schema(&name, "ros2msg", text.as_bytes())?;
    let qos = [("offered_qos_profiles".to_owned(), profile(topic))].into();
    Ok(writer.add_channel(schema, topic.name, "cdr", &qos)?)
}

/// The quality of service of a topic, in YAML, with the numbers of rmw: all versions of `rosbag2` read
/// these in a file without a version.
fn profile(topic: &Topic) -> String {
    /// The longest time: no limit.
    const NEVER: &str = "{sec: 9223372036, nsec: 854775807}";
    let durability = if topic.is_latched { 1 } else { 2 };
    format!(
        "- history: 1\n  depth: 10\n  reliability: 1\n  durability: {durability}\n  deadline: {NEVER}\n  lifespan: {NEVER}\n  \
         liveliness: 1\n  liveliness_lease_duration: {NEVER}\n  avoid_ros_namespace_conventions: false\n"
    )
}
