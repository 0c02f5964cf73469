//! Output of every conversion: the log, and the number of messages written and skipped by topic.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use super::super::container::unpack_message;
use super::super::messages::{read_video_packet, stamp_ns};
use super::super::writer::MessageType;
use super::super::{LogWriter, MessageKind, MessageTimes};
use super::options::TakenRecords;
use super::ros1_message::cdr_from_ros1;
use super::{ConversionReport, ConvertError, ConvertedTopic, ForceAgreement, VideoClock};
use crate::files::{LimitExceeded, LimitKind, LogLimits};
use crate::text::without_signed_zeros;

/// Number of characters shown of a too long name.
const SHOWN_CHARS: usize = 48;
/// Number of topics in the error of a source without usable messages.
const DESCRIBED_TOPICS: usize = 16;
/// Row of the report for the topics beyond their limit.
const OTHER_TOPICS: &str = "(other topics)";

/// Bytes of a message in the encoding of its source.
#[derive(Clone, Copy, Debug)]
pub(super) enum Payload<'a> {
    /// Bytes in the serialization of ROS 1.
    Ros1(&'a [u8]),
    /// CDR with its encapsulation header.
    Cdr(&'a [u8]),
    /// Protobuf, as Foxglove's libraries write it.
    Protobuf(&'a [u8]),
    /// Name of another encoding.
    Other(&'a str),
}

#[derive(Clone, Copy, Debug)]
pub(super) struct SourceMessage<'a> {
    pub(super) topic: &'a str,
    /// Such as `sensor_msgs/Imu` or `sensor_msgs/msg/Imu`.
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

pub(super) struct LogSink<'a> {
    pub(super) writer: LogWriter,
    tallies: BTreeMap<(String, String), Tally>,
    /// Message type of each topic in the log.
    types: BTreeMap<String, String>,
    notes: Vec<String>,
    limits: LogLimits,
    /// Relation of the video's clock to the autopilot's log.
    pub(super) video_clock: Option<VideoClock>,
    /// Evidence for it, if it was found by specific forces.
    pub(super) forces: Option<ForceAgreement>,
    /// Records of the source that can be chosen.
    pub(super) records: TakenRecords,
    /// Number of messages in the log.
    count: u64,
    progress: &'a mut dyn FnMut(f64) -> ControlFlow<()>,
    /// Last reported fraction, and messages since then.
    fraction: f64,
    since: u32,
    interrupted: bool,
}

/// Number of messages between two progress reports of a source that does not report itself.
const MESSAGES_PER_REPORT: u32 = 64;

impl<'a> LogSink<'a> {
    pub(super) fn new(
        writer: LogWriter,
        limits: LogLimits,
        records: TakenRecords,
        progress: &'a mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Self {
        let (tallies, types, notes) = (BTreeMap::new(), BTreeMap::new(), Vec::new());
        let (fraction, since, interrupted) = (0.0, 0, false);
        Self {
            writer,
            tallies,
            types,
            notes,
            limits,
            video_clock: None,
            forces: None,
            records,
            count: 0,
            progress,
            fraction,
            since,
            interrupted,
        }
    }

    /// Limits on reading the source.
    pub(super) fn limits(&self) -> &LogLimits {
        &self.limits
    }

    /// Number of messages found: those in the log and those that were skipped.
    pub(super) fn seen(&self) -> u64 {
        self.tallies.values().fold(0, |sum: u64, tally| sum.saturating_add(tally.taken).saturating_add(tally.left))
    }

    /// Number of messages in the log.
    pub(super) fn count(&self) -> u64 {
        self.count
    }

    /// Reports the completed fraction of the source, from 0 to 1.
    pub(super) fn progress(&mut self, fraction: f64) {
        (self.fraction, self.since) = (fraction, 0);
        self.interrupted |= (self.progress)(fraction).is_break();
    }

    /// Reports a position in the source at intervals; an error if the caller has stopped the conversion.
    pub(super) fn advance(&mut self, at: usize, length: usize) -> Result<(), ConvertError> {
        self.since += 1;
        if self.since >= MESSAGES_PER_REPORT {
            self.progress(at as f64 / length.max(1) as f64);
        }
        self.ensure_running()
    }

    /// Returns an error if the caller has stopped the conversion.
    pub(super) fn ensure_running(&self) -> Result<(), ConvertError> {
        if self.interrupted {
            return Err(ConvertError::Interrupted { path: self.writer.path().to_owned() });
        }
        Ok(())
    }

    /// Adds a remark to the report.
    pub(super) fn note(&mut self, note: impl Into<String>) {
        self.notes.push(without_signed_zeros(note.into()));
    }

    /// Adds a topic to the report, even without messages.
    pub(super) fn announce(&mut self, topic: &str, message_type: &str) {
        self.tally(topic, message_type);
    }

    /// Counts messages that were skipped.
    pub(super) fn leave(&mut self, topic: &str, message_type: &str, count: u64, reason: impl Into<String>) {
        let tally = self.tally(topic, message_type);
        tally.left = tally.left.saturating_add(count);
        tally.reason.get_or_insert_with(|| reason.into());
    }

    /// Counts a message that is in the log.
    pub(super) fn taken(&mut self, topic: &str, message_type: &str) -> &mut Tally {
        self.count += 1;
        if !self.types.contains_key(topic) {
            self.types.insert(topic.to_owned(), message_type.to_owned());
        }
        let tally = self.tally(topic, message_type);
        tally.taken += 1;
        tally
    }

    /// Sets the report's remark on a topic in the log.
    pub(super) fn remark(&mut self, topic: &str, message_type: &str, remark: impl Into<String>) {
        self.tally(topic, message_type).reason.get_or_insert_with(|| remark.into());
    }

    /// Row of a topic in the report; topics beyond their limit share one.
    fn tally(&mut self, topic: &str, message_type: &str) -> &mut Tally {
        let name = |name: &str| {
            if self.limits.check_name("a name", name).is_ok() {
                return name.to_owned();
            }
            let start: String = name.chars().take(SHOWN_CHARS).collect();
            format!("{start}… ({} bytes)", name.len())
        };
        let key = (name(topic), name(message_type));
        let full = self.tallies.len() as u64 >= self.limits.topics().saturating_mul(2);
        let key = if full && !self.tallies.contains_key(&key) { (OTHER_TOPICS.to_owned(), String::new()) } else { key };
        self.tallies.entry(key).or_default()
    }

    /// Reason why a topic cannot be in the log: its names, or the number of topics before it.
    fn refusal(&self, topic: &str, message_type: &str) -> Option<String> {
        let names = self.limits.check_name("the name of a topic", topic);
        if let Err(exceeded) = names.and_then(|()| self.limits.check_name("the name of a type", message_type)) {
            return Some(exceeded.to_string());
        }
        let (before, allowed) = (self.types.len() as u64, self.limits.topics());
        (before >= allowed && !self.types.contains_key(topic)).then(|| {
            let (kind, subject) = (LimitKind::Topics, "a log");
            LimitExceeded { kind, subject, found: before.saturating_add(1), allowed }.to_string()
        })
    }

    /// Writes a message into the log, or counts the reason why it cannot be written.
    pub(super) fn take(&mut self, message: &SourceMessage<'_>) -> Result<(), ConvertError> {
        self.since += 1;
        if self.since >= MESSAGES_PER_REPORT {
            self.progress(self.fraction);
        }
        self.ensure_running()?;
        let SourceMessage { topic, message_type, log_time_ns, .. } = *message;
        if let Some(other) = self.types.get(topic)
            && other != message_type
        {
            let reason = format!("the topic is in the log as {other} already");
            self.leave(topic, message_type, 1, reason);
            return Ok(());
        }
        if let Some(reason) = self.refusal(topic, message_type) {
            self.leave(topic, message_type, 1, reason);
            return Ok(());
        }
        let kind = MessageKind::from_schema_name(message_type);
        let times = MessageTimes { stamp_ns: log_time_ns, log_time_ns };
        let unpacked: Cow<'_, [u8]>;
        let payload = match message.payload {
            Payload::Cdr(bytes) => match unpack_message(bytes, &self.limits) {
                Ok(bytes) => {
                    unpacked = bytes;
                    Payload::Cdr(&unpacked)
                }
                Err(reason) => {
                    self.leave(topic, message_type, 1, reason);
                    return Ok(());
                }
            },
            other => other,
        };
        let written = match (kind, payload) {
            (Some(MessageKind::CompressedVideoProtobuf), Payload::Protobuf(bytes)) => {
                match read_video_packet(MessageKind::CompressedVideoProtobuf, bytes) {
                    Ok(packet) => {
                        let times = MessageTimes { stamp_ns: packet.stamp_ns, ..times };
                        Ok(self.writer.write_compressed_video(
                            topic,
                            packet.frame_id,
                            times,
                            packet.format,
                            packet.data,
                        )?)
                    }
                    Err(error) => Err(format!("it cannot be decoded: {error}")),
                }
            }
            // Viewers decode videos in protobuf only.
            (Some(MessageKind::CompressedVideo), Payload::Cdr(bytes)) => {
                match read_video_packet(MessageKind::CompressedVideo, bytes) {
                    Ok(packet) => {
                        let times = MessageTimes { stamp_ns: packet.stamp_ns, ..times };
                        let (frame_id, format) = (packet.frame_id, packet.format);
                        Ok(self.writer.write_compressed_video(topic, frame_id, times, format, packet.data)?)
                    }
                    Err(error) => Err(format!("it cannot be decoded: {error}")),
                }
            }
            (_, Payload::Protobuf(_)) => {
                Err("encoded as protobuf, of which only foxglove.CompressedVideo is read".to_owned())
            }
            (Some(kind), Payload::Cdr(bytes)) => match stamp_ns(kind, bytes) {
                Ok(_) => Ok(self.writer.write(topic, kind, times, bytes)?),
                Err(error) => Err(format!("it cannot be decoded: {error}")),
            },
            (Some(kind), Payload::Ros1(bytes)) => match cdr_from_ros1(kind, bytes) {
                Ok(bytes) => Ok(self.writer.write(topic, kind, times, &bytes)?),
                Err(problem) => Err(problem),
            },
            (None, Payload::Cdr(bytes)) => match message.definition {
                Some(definition) => {
                    let message_type = MessageType::ros2(message_type, definition);
                    Ok(self.writer.write_typed(topic, &message_type, times, bytes)?)
                }
                None => Err("unsupported type, and the bag does not contain its definition".to_owned()),
            },
            (None, Payload::Ros1(_)) => Err("unsupported type".to_owned()),
            (_, Payload::Other(encoding)) => Err(format!("encoded as {encoding:?}, expected CDR or ROS 1")),
        };
        match written {
            Ok(()) => {
                let tally = self.taken(topic, message_type);
                if kind.is_none() {
                    tally.reason.get_or_insert_with(|| "copied unchanged; the program does not use it".to_owned());
                }
            }
            Err(reason) => self.leave(topic, message_type, 1, reason),
        }
        Ok(())
    }

    /// Completes the log and returns the report.
    pub(super) fn finish(self, kind: &str, source: &Path) -> Result<ConversionReport, ConvertError> {
        self.ensure_running()?;
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
            let descriptions = topics.iter().take(DESCRIBED_TOPICS).map(|topic| {
                let reason = topic.reason.as_deref().unwrap_or("not read");
                format!("{} of type {}: {reason}", topic.topic, topic.message_type)
            });
            let mut reasons: Vec<String> = descriptions.collect();
            if topics.len() > DESCRIBED_TOPICS {
                reasons.push(format!("{} more topics", topics.len() - DESCRIBED_TOPICS));
            }
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
            video_clock: self.video_clock,
            forces: self.forces,
            topics,
            notes: self.notes,
        })
    }
}
