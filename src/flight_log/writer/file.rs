//! MCAP files in the layout of ROS 2's recorder, under their final or a temporary name.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::error::Error;
use std::io::{self, BufWriter, Seek, Write};
use std::path::{Path, PathBuf};

use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, McapError, WriteOptions, Writer};

use super::protobuf;
use crate::flight_log::{LogError, MessageKind};

/// Quality of service that ROS 2 recorders store for sensor topics; players need it.
const QOS_PROFILE: &str = "\
- history: 1
  depth: 10
  reliability: 1
  durability: 2
  deadline: {sec: 9223372036, nsec: 854775807}
  lifespan: {sec: 9223372036, nsec: 854775807}
  liveliness: 1
  liveliness_lease_duration: {sec: 9223372036, nsec: 854775807}
  avoid_ros_namespace_conventions: false
";

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MessageType<'a> {
    /// Name of the type, such as `nav_msgs/msg/Path`.
    pub name: &'a str,
    /// Language of the definition, `ros2msg`, `protobuf` or `jsonschema`.
    pub definition_encoding: &'a str,
    /// Definition with all types that it needs.
    pub definition: Cow<'a, [u8]>,
    /// Encoding of the messages, `cdr`, `protobuf` or `json`.
    pub message_encoding: &'a str,
}

impl<'a> MessageType<'a> {
    /// ROS 2 type with messages in CDR.
    pub fn ros2(name: &'a str, definition: impl Into<Cow<'a, str>>) -> Self {
        let definition = match definition.into() {
            Cow::Borrowed(text) => Cow::Borrowed(text.as_bytes()),
            Cow::Owned(text) => Cow::Owned(text.into_bytes()),
        };
        Self { name, definition_encoding: "ros2msg", definition, message_encoding: "cdr" }
    }

    /// Video frames of Foxglove in Protocol Buffers.
    pub(in crate::flight_log) fn compressed_video() -> Self {
        Self::protobuf(MessageKind::CompressedVideoProtobuf.schema_name(), protobuf::compressed_video_definition())
    }

    /// Message of protobuf with its `FileDescriptorSet`.
    pub(super) fn protobuf(name: &'a str, definition: Vec<u8>) -> Self {
        Self { name, definition_encoding: "protobuf", definition: Cow::Owned(definition), message_encoding: "protobuf" }
    }
}

/// An MCAP file that is being written.
pub(super) struct McapFile<W: Write + Seek> {
    writer: Writer<BufWriter<W>>,
    /// Number of written messages by channel.
    sequences: BTreeMap<u16, u32>,
    path: PathBuf,
}

impl<W: Write + Seek> McapFile<W> {
    /// Starts the content of a file with this path.
    pub(super) fn start(file: W, path: &Path, options: WriteOptions) -> Result<Self, LogError> {
        let options =
            options.profile("ros2").library(concat!("dcvins ", env!("CARGO_PKG_VERSION"))).compression_threads(0); // the bytes must not depend on the machine
        let writer = options.create(BufWriter::with_capacity(1 << 20, file));
        let writer = writer.map_err(|error| write_error(path, &error))?;
        Ok(Self { writer, sequences: BTreeMap::new(), path: path.to_owned() })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Adds a channel for a topic; the same one for the same type.
    pub(super) fn channel(&mut self, topic: &str, message_type: &MessageType<'_>) -> Result<u16, LogError> {
        let failed = |error: McapError| write_error(&self.path, &error);
        let MessageType { name, definition_encoding, definition, message_encoding } = message_type;
        let schema = if name.is_empty() {
            0
        } else {
            self.writer.add_schema(name, definition_encoding, definition).map_err(failed)?
        };
        let qos = BTreeMap::from([("offered_qos_profiles".to_owned(), QOS_PROFILE.to_owned())]);
        self.writer.add_channel(schema, topic, message_encoding, &qos).map_err(failed)
    }

    /// Writes an encoded message to a channel.
    pub(super) fn write(&mut self, channel_id: u16, log_time: u64, message: &[u8]) -> Result<(), LogError> {
        let sequence = self.sequences.entry(channel_id).or_default();
        let header = MessageHeader { channel_id, sequence: *sequence, log_time, publish_time: log_time };
        *sequence = sequence.wrapping_add(1);
        self.writer.write_to_known_channel(&header, message).map_err(|error| write_error(&self.path, &error))
    }

    /// Attaches a file, such as `city.rig.yaml` or the mask of a camera.
    pub(super) fn attach(
        &mut self,
        name: &str,
        media_type: &str,
        content: &[u8],
        log_time: u64,
    ) -> Result<(), LogError> {
        let attachment = Attachment {
            log_time,
            create_time: log_time,
            name: name.to_owned(),
            media_type: media_type.to_owned(),
            data: Cow::Borrowed(content),
        };
        self.writer.attach(&attachment).map_err(|error| write_error(&self.path, &error))
    }

    pub(super) fn write_metadata(&mut self, name: &str, texts: BTreeMap<String, String>) -> Result<(), LogError> {
        let metadata = Metadata { name: name.to_owned(), metadata: texts };
        self.writer.write_metadata(&metadata).map_err(|error| write_error(&self.path, &error))
    }

    /// Writes the messages so far to the file, as a chunk.
    pub(super) fn flush(&mut self) -> Result<(), LogError> {
        self.writer.flush().map_err(|error| write_error(&self.path, &error))
    }

    /// Completes the content with its index; then `then` completes the file.
    pub(super) fn finish<T>(
        mut self,
        action: &'static str,
        then: impl FnOnce(W) -> io::Result<T>,
    ) -> Result<T, LogError> {
        self.writer.finish().map_err(|error| write_error(&self.path, &error))?;
        let flushed = self.writer.into_inner().into_inner().map_err(io::IntoInnerError::into_error);
        flushed.and_then(then).map_err(|source| LogError::Io { action, source, path: self.path })
    }
}

/// Error of the MCAP writer with its innermost cause, since its own text does not mention a full disk.
fn write_error(path: &Path, error: &(dyn Error + 'static)) -> LogError {
    let mut cause = error;
    while let Some(source) = cause.source() {
        cause = source;
    }
    LogError::Write { problem: cause.to_string(), path: path.to_owned() }
}
