//! The output of every conversion: the log, and the number of messages written and skipped by topic.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::super::writer::MessageType;
use super::super::{LogWriter, MessageKind, MessageTimes};
use super::ros1_message::cdr_from_ros1;
use super::{ConversionReport, ConvertError, ConvertedTopic};

/// Bytes of a message in the encoding of its source.
#[derive(Clone, Copy, Debug)]
pub(super) enum Payload<'a> {
    /// ROS 1 serialization.
    Ros1(&'a [u8]),
    /// CDR with its encapsulation header.
    Cdr(&'a [u8]),
    /// Anything else, by the name of its encoding.
    Other(&'a str),
}

/// One message of a source.
#[derive(Clone, Copy, Debug)]
pub(super) struct SourceMessage<'a> {
    pub(super) topic: &'a str,
    /// `sensor_msgs/Imu` or `sensor_msgs/msg/Imu`.
    pub(super) message_type: &'a str,
    /// Definition of the type as `ros2msg`, for types that are copied without being read.
    pub(super) definition: Option<&'a str>,
    /// Nanoseconds since the epoch.
    pub(super) log_time_ns: i64,
    pub(super) payload: Payload<'a>,
}

/// Number of messages written and skipped of one topic.
#[derive(Debug, Default)]
pub(super) struct Tally {
    taken: u64,
    left: u64,
    reason: Option<String>,
}

/// The log being written.
pub(super) struct Sink<'a> {
    pub(super) writer: LogWriter,
    tallies: BTreeMap<(String, String), Tally>,
    /// The message type of each topic in the log.
    types: BTreeMap<String, String>,
    notes: Vec<String>,
    progress: &'a mut dyn FnMut(f64),
}

impl<'a> Sink<'a> {
    pub(super) fn new(writer: LogWriter, progress: &'a mut dyn FnMut(f64)) -> Self {
        Self { writer, tallies: BTreeMap::new(), types: BTreeMap::new(), notes: Vec::new(), progress }
    }

    /// Reports the fraction of the source that is done, from 0 to 1.
    pub(super) fn progress(&mut self, fraction: f64) {
        (self.progress)(fraction);
    }

    /// Adds a remark to the report.
    pub(super) fn note(&mut self, note: impl Into<String>) {
        self.notes.push(note.into());
    }

    /// Adds a topic to the report, even without messages.
    pub(super) fn announce(&mut self, topic: &str, message_type: &str) {
        self.tallies.entry((topic.to_owned(), message_type.to_owned())).or_default();
    }

    /// Counts messages that were skipped.
    pub(super) fn leave(&mut self, topic: &str, message_type: &str, count: u64, reason: impl Into<String>) {
        let tally = self.tallies.entry((topic.to_owned(), message_type.to_owned())).or_default();
        tally.left += count;
        tally.reason.get_or_insert_with(|| reason.into());
    }

    /// Counts a message that is in the log.
    pub(super) fn taken(&mut self, topic: &str, message_type: &str) -> &mut Tally {
        let tally = self.tallies.entry((topic.to_owned(), message_type.to_owned())).or_default();
        if tally.taken == 0 {
            self.types.insert(topic.to_owned(), message_type.to_owned());
        }
        tally.taken += 1;
        tally
    }

    /// Writes a message to the log, or counts it as skipped with the reason.
    pub(super) fn take(&mut self, message: &SourceMessage<'_>) -> Result<(), ConvertError> {
        let SourceMessage { topic, message_type, log_time_ns, .. } = *message;
        if let Some(other) = self.types.get(topic)
            && other != message_type
        {
            let reason = format!("the topic is in the log as {other} already");
            self.leave(topic, message_type, 1, reason);
            return Ok(());
        }
        let kind = MessageKind::from_schema_name(message_type);
        let times = MessageTimes { stamp_ns: log_time_ns, log_time_ns };
        let written = match (kind, message.payload) {
            (Some(kind), Payload::Cdr(bytes)) => Ok(self.writer.write(topic, kind, times, bytes)?),
            (Some(kind), Payload::Ros1(bytes)) => match cdr_from_ros1(kind, bytes) {
                Ok(bytes) => Ok(self.writer.write(topic, kind, times, &bytes)?),
                Err(problem) => Err(problem),
            },
            (None, Payload::Cdr(bytes)) => match message.definition {
                Some(definition) => {
                    let message_type = MessageType::ros2(message_type, definition);
                    Ok(self.writer.write_typed(topic, &message_type, times, bytes)?)
                }
                None => Err("the program reads no such type, and the bag does not hold its definition".to_owned()),
            },
            (None, Payload::Ros1(_)) => Err("the program reads no such type".to_owned()),
            (_, Payload::Other(encoding)) => Err(format!("encoded as '{encoding}', expected CDR or ROS 1")),
        };
        match written {
            Ok(()) => {
                let tally = self.taken(topic, message_type);
                if kind.is_none() {
                    tally.reason.get_or_insert_with(|| "copied as it is; the program does not read it".to_owned());
                }
            }
            Err(reason) => self.leave(topic, message_type, 1, reason),
        }
        Ok(())
    }

    /// Completes the log.
    pub(super) fn finish(self, kind: &str, source: &Path) -> Result<ConversionReport, ConvertError> {
        let topics: Vec<ConvertedTopic> = self
            .tallies
            .into_iter()
            .map(|((topic, message_type), tally)| ConvertedTopic {
                topic,
                message_type,
                taken: tally.taken,
                left: tally.left,
                reason: tally.reason.or_else(|| (tally.taken + tally.left == 0).then(|| "no messages".to_owned())),
            })
            .collect();
        let usable =
            |topic: &ConvertedTopic| topic.taken > 0 && MessageKind::from_schema_name(&topic.message_type).is_some();
        if !topics.iter().any(usable) {
            let descriptions = topics.iter().map(|topic| {
                let reason = topic.reason.as_deref().unwrap_or("not read");
                format!("{} of type {}: {reason}", topic.topic, topic.message_type)
            });
            let mut reasons: Vec<String> = descriptions.collect();
            reasons.extend(self.notes);
            return Err(ConvertError::NothingUsable { topics: reasons.join("; "), path: source.to_owned() });
        }
        self.writer.finish()?;
        Ok(ConversionReport {
            kind: kind.to_owned(),
            source: source.to_owned(),
            log: PathBuf::new(),
            rig: None,
            duration_s: 0.0,
            topics,
            notes: self.notes,
        })
    }
}
