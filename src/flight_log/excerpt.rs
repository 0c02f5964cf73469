//! Stretch of a log as a log of its own.

use std::collections::BTreeSet;
use std::path::Path;

use super::writer::{LogWriter, LogWriterOptions, MessageTimes, MessageType};
use crate::flight_log::container::{ChannelRecord, ContainerIndex, DecodedBlock};
use crate::flight_log::error::LogError;
use crate::flight_log::log::FlightLog;
use crate::flight_log::messages;
use crate::flight_log::messages::MessageKind;

/// Time around a stretch for which samples are copied too, in nanoseconds: images need IMU samples and joint angles
/// before and after their stamps.
const MARGIN_NS: i64 = 300_000_000;
/// Topics with at most this many messages are sent once, such as intrinsics: they are copied whole.
const SENT_ONCE: u64 = 2;

/// Content of a written excerpt.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ExcerptReport {
    pub messages: u64,
    /// Topics that are not copied, because their messages are neither in CDR nor video frames in Protocol Buffers.
    pub left_out: BTreeSet<String>,
}

/// Writes the messages of a log with stamps from `start_ns` to `end_ns` since its start, a margin around them, all
/// messages of topics that are sent once, and all attachments. Messages without a stamp go by their log times.
///
/// # Errors
/// If the file cannot be written.
pub fn write_excerpt(
    log: &FlightLog,
    (start_ns, end_ns): (i64, i64),
    path: &Path,
    options: &LogWriterOptions,
) -> Result<ExcerptReport, LogError> {
    let mut writer = LogWriter::create(path, options)?;
    let mut report = ExcerptReport::default();
    let once: BTreeSet<&str> =
        log.topics().iter().filter(|topic| topic.count <= SENT_ONCE).map(|topic| topic.topic.as_str()).collect();
    let (from_ns, to_ns) = (start_ns.saturating_sub(MARGIN_NS), end_ns.saturating_add(MARGIN_NS));
    let index = log.index();
    let mut blocks: Vec<_> = index.blocks.iter().collect();
    blocks.sort_by_key(|block| (block.log_time_ns, block.bytes.start));
    // Log time minus stamp of the last message with a stamp.
    let mut delay_ns = 0;
    for block in blocks {
        let decoded = DecodedBlock::decode(log.file(), block);
        let mut messages: Vec<_> = decoded.messages.iter().collect();
        messages.sort_by_key(|message| message.log_time_ns);
        for message in messages {
            let Some(channel) = index.channels.get(&message.channel_id) else { continue };
            let data = decoded.bytes(&message.data);
            let logged_ns = log.since_start(message.log_time_ns);
            let stamped_ns = stamp_of(channel, data).map(|stamp_ns| stamp_ns.saturating_sub(log.epoch_ns()));
            if let Some(stamped_ns) = stamped_ns {
                delay_ns = logged_ns.saturating_sub(stamped_ns);
            }
            let time_ns = stamped_ns.unwrap_or_else(|| logged_ns.saturating_sub(delay_ns));
            let is_once = once.contains(channel.topic.as_str());
            if !is_once && !(from_ns..=to_ns).contains(&time_ns) {
                continue;
            }
            let Some(message_type) = type_of(channel) else {
                report.left_out.insert(channel.topic.clone());
                continue;
            };
            let log_time_ns = i64::try_from(message.log_time_ns).unwrap_or(i64::MAX);
            let times = MessageTimes { stamp_ns: log_time_ns, log_time_ns };
            writer.write_typed(&channel.topic, &message_type, times, data)?;
            report.messages += 1;
        }
    }
    for place in &log.index().attachments {
        if let Some(content) = ContainerIndex::attachment(log.file(), place) {
            let is_text = std::str::from_utf8(&content).is_ok();
            writer.attach(&place.name, if is_text { "text/plain" } else { "application/octet-stream" }, &content, 0)?;
        }
    }
    writer.finish()?;
    Ok(report)
}

/// Header stamp of a message since the epoch, `None` for a kind without one, and if it was never set.
fn stamp_of(channel: &ChannelRecord, data: &[u8]) -> Option<i64> {
    let kind = MessageKind::of_channel(&channel.schema_name, &channel.encoding)?;
    if kind.counts_since_boot() {
        return None;
    }
    messages::stamp_ns(kind, data).ok().filter(|stamp_ns| *stamp_ns > 0)
}

fn type_of(channel: &ChannelRecord) -> Option<MessageType<'_>> {
    let definition = channel.definition.as_deref().unwrap_or_default();
    match channel.encoding.as_str() {
        "cdr" => Some(MessageType::ros2(&channel.schema_name, definition)),
        "protobuf" if channel.schema_name == MessageKind::CompressedVideoProtobuf.schema_name() => {
            Some(MessageType::compressed_video())
        }
        _ => None,
    }
}
