//! A log that is read while it is written.

use std::fs::File;
use std::path::Path;

use mcap::{Compression, WriteOptions};

use super::MessageType;
use super::file::McapFile;
use crate::flight_log::LogError;

/// Log time after which a chunk is written, so that a reader is behind by little more.
const CHUNK_NS: u64 = 50_000_000;

/// A log under its final name, written chunk by chunk; it is complete once [`Self::finish`] has returned, and readable by
/// programs that accept a log without a footer at any time before.
pub(in crate::flight_log) struct GrowingLog {
    file: McapFile<File>,
    /// Log time of the first message of the chunk that is not written yet.
    chunk_ns: Option<u64>,
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
        let file = File::create_new(path).map_err(failed)?;
        let options = WriteOptions::new().compression(Some(Compression::Lz4));
        Ok(Self { file: McapFile::start(file, path, options)?, chunk_ns: None })
    }

    /// Attaches a file, such as the rig.
    pub(in crate::flight_log) fn attach(&mut self, name: &str, content: &[u8]) -> Result<(), LogError> {
        self.file.attach(name, "application/octet-stream", content, 0)
    }

    /// Channel of a topic, the same for the same type.
    pub(in crate::flight_log) fn channel(&mut self, topic: &str, of: &MessageType<'_>) -> Result<u16, LogError> {
        self.file.channel(topic, of)
    }

    /// Writes a message; the chunk before it if that is long enough.
    pub(in crate::flight_log) fn write(&mut self, channel_id: u16, log_time: u64, data: &[u8]) -> Result<(), LogError> {
        if log_time.abs_diff(*self.chunk_ns.get_or_insert(log_time)) >= CHUNK_NS {
            self.flush()?;
            self.chunk_ns = Some(log_time);
        }
        self.file.write(channel_id, log_time, data)
    }

    /// Writes the messages so far to the file.
    pub(in crate::flight_log) fn flush(&mut self) -> Result<(), LogError> {
        if self.chunk_ns.take().is_none() { Ok(()) } else { self.file.flush() }
    }

    /// Completes the log with its index.
    pub(in crate::flight_log) fn finish(self) -> Result<(), LogError> {
        self.file.finish("complete the recording", |file| file.sync_all())
    }
}
