//! A log that is read while it is written.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;
use mcap::{Attachment, Compression, WriteOptions, Writer};

use super::{QOS_PROFILE, write_error};
use crate::flight_log::LogError;

/// Log time after which a chunk is written, so that a reader is behind by little more.
const CHUNK_NS: u64 = 50_000_000;

/// Topic of a [`GrowingLog`] with its type.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::flight_log) struct TopicType {
    pub(in crate::flight_log) topic: String,
    /// Encoding of the messages, such as `cdr`.
    pub(in crate::flight_log) encoding: String,
    pub(in crate::flight_log) schema_name: String,
    /// Language of the schema, such as `ros2msg`.
    pub(in crate::flight_log) schema_language: String,
    pub(in crate::flight_log) schema: Vec<u8>,
}

/// A log under its final name, written chunk by chunk; it is complete once [`Self::finish`] has returned, and readable by
/// programs that accept a log without a footer at any time before.
pub(in crate::flight_log) struct GrowingLog {
    writer: Writer<BufWriter<File>>,
    /// Number of written messages by channel.
    sequences: BTreeMap<u16, u32>,
    /// Log time of the first message of the chunk that is not written yet.
    chunk_ns: Option<u64>,
    path: PathBuf,
}

impl GrowingLog {
    /// Creates a log and its folder.
    ///
    /// # Errors
    /// If the file exists, or its folder cannot be written.
    pub(in crate::flight_log) fn create(path: &Path) -> Result<Self, LogError> {
        let failed = |source| LogError::Io { action: "create the recording", source, path: path.to_owned() };
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(failed)?;
        }
        let file = BufWriter::with_capacity(1 << 20, File::create_new(path).map_err(failed)?);
        let options = WriteOptions::new()
            .profile("ros2")
            .library(concat!("dcvins ", env!("CARGO_PKG_VERSION")))
            .compression(Some(Compression::Lz4))
            .compression_threads(0);
        let writer = options.create(file).map_err(|error| write_error(path, &error))?;
        Ok(Self { writer, sequences: BTreeMap::new(), chunk_ns: None, path: path.to_owned() })
    }

    /// Attaches a file, such as the rig.
    pub(in crate::flight_log) fn attach(&mut self, name: &str, content: &[u8]) -> Result<(), LogError> {
        let attachment = Attachment {
            log_time: 0,
            create_time: 0,
            name: name.to_owned(),
            media_type: "application/octet-stream".to_owned(),
            data: Cow::Borrowed(content),
        };
        self.writer.attach(&attachment).map_err(|error| write_error(&self.path, &error))
    }

    /// Channel of a topic, the same for the same type.
    pub(in crate::flight_log) fn channel(&mut self, topic: &TopicType) -> Result<u16, LogError> {
        let failed = |error: mcap::McapError| write_error(&self.path, &error);
        let schema = if topic.schema_name.is_empty() {
            0
        } else {
            self.writer.add_schema(&topic.schema_name, &topic.schema_language, &topic.schema).map_err(failed)?
        };
        let qos = BTreeMap::from([("offered_qos_profiles".to_owned(), QOS_PROFILE.to_owned())]);
        self.writer.add_channel(schema, &topic.topic, &topic.encoding, &qos).map_err(failed)
    }

    /// Writes a message; the chunk before it if that is long enough.
    pub(in crate::flight_log) fn write(&mut self, channel_id: u16, log_time: u64, data: &[u8]) -> Result<(), LogError> {
        if log_time.abs_diff(*self.chunk_ns.get_or_insert(log_time)) >= CHUNK_NS {
            self.flush()?;
            self.chunk_ns = Some(log_time);
        }
        let sequence = self.sequences.entry(channel_id).or_default();
        let header = MessageHeader { channel_id, sequence: *sequence, log_time, publish_time: log_time };
        *sequence = sequence.wrapping_add(1);
        self.writer.write_to_known_channel(&header, data).map_err(|error| write_error(&self.path, &error))
    }

    /// Writes the messages so far to the file.
    pub(in crate::flight_log) fn flush(&mut self) -> Result<(), LogError> {
        if self.chunk_ns.take().is_none() {
            return Ok(());
        }
        self.writer.flush().map_err(|error| write_error(&self.path, &error))
    }

    /// Completes the log with its index.
    pub(in crate::flight_log) fn finish(mut self) -> Result<(), LogError> {
        self.writer.finish().map(drop).map_err(|error| write_error(&self.path, &error))?;
        let failed = |source| LogError::Io { action: "complete the recording", source, path: self.path.clone() };
        let file = self.writer.into_inner().into_inner().map_err(|error| failed(error.into_error()))?;
        file.sync_all().map_err(failed)
    }
}
