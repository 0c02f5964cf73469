//! MCAP files of other recorders: ROS 2 messages are copied, ROS 1 messages converted.
//!
//! They are read like any log, by index and block: a damaged block is left out and counted, the others are copied.

use std::collections::BTreeMap;
use std::path::Path;

use super::super::container::{ChannelRecord, ContainerIndex, DecodedBlock};
use super::ConvertError;
use super::sink::{LogSink, Payload, SourceMessage};
use crate::flight_log::container::file::LogFile;
use crate::geometry::seconds_from_ns;

/// Reason for the missing messages of a damaged block.
const IN_DAMAGED_CHUNK: &str = "in a damaged chunk";

pub(super) fn open(path: &Path, sink: &LogSink<'_>) -> Result<LogFile, ConvertError> {
    let file = LogFile::open(path, sink.limits())?;
    let start = file.read(0..file.len().min(mcap::MAGIC.len()));
    match start {
        Ok(start) if start == mcap::MAGIC => Ok(file),
        Ok(_) => Err(ConvertError::unreadable("not an MCAP log: it does not start with the MCAP magic", path)),
        Err(problem) => Err(ConvertError::unreadable(problem, path)),
    }
}

/// Converts a file with its attachments. All readable data of a damaged or unfinished file are converted.
pub(super) fn convert(file: &LogFile, path: &Path, sink: &mut LogSink<'_>) -> Result<(), ConvertError> {
    let index = ContainerIndex::read(file);
    let is_block = |byte: usize| index.blocks.binary_search_by_key(&byte, |block| block.bytes.start).is_ok();
    // Damage of blocks is reported together with the lost messages.
    for damage in index.damages.iter().filter(|damage| !is_block(damage.byte)) {
        sink.note(format!(
            "{} is damaged at byte {} of {}: {}",
            path.display(),
            damage.byte,
            file.len(),
            damage.problem
        ));
    }
    let mut read = 0_u64;
    for (number, block) in index.blocks.iter().enumerate() {
        let decoded = DecodedBlock::decode(file, block);
        let mut found: BTreeMap<u16, u64> = BTreeMap::new();
        for message in &decoded.messages {
            *found.entry(message.channel_id).or_default() += 1;
            let log_time_ns = i64::try_from(message.log_time_ns).unwrap_or(i64::MAX);
            let data = decoded.bytes(&message.data);
            take(index.channels.get(&message.channel_id), message.channel_id, log_time_ns, data, sink)?;
        }
        read += decoded.messages.len() as u64;
        if let Some(problem) = &decoded.damage {
            let mut lost = 0;
            for (id, promised) in index.promised(file, number) {
                let count = promised.saturating_sub(found.get(&id).copied().unwrap_or(0));
                lost += count;
                if let Some(channel) = index.channels.get(&id).filter(|_| count > 0) {
                    sink.leave(&channel.topic, &channel.schema_name, count, IN_DAMAGED_CHUNK);
                }
            }
            let messages = match lost {
                0 => "an unknown number of messages is lost".to_owned(),
                lost => format!("{lost} messages are lost"),
            };
            sink.note(format!(
                "the chunk at byte {} of {} is damaged: {problem}; {messages}, from {:.3} s to {:.3} s",
                block.bytes.start,
                path.display(),
                seconds_from_ns(i64::try_from(block.log_time_ns.0).unwrap_or(i64::MAX)),
                seconds_from_ns(i64::try_from(block.log_time_ns.1).unwrap_or(i64::MAX))
            ));
        }
        sink.progress((number + 1) as f64 / index.blocks.len() as f64);
    }
    if let Some(statistics) = &index.statistics {
        let promised = statistics.values().fold(0_u64, |sum, count| sum.saturating_add(*count));
        if promised != read {
            sink.note(format!("{}: its index counts {promised} messages, {read} were read", path.display()));
        }
    }
    for place in &index.attachments {
        match ContainerIndex::attachment(file, place) {
            Some(content) => {
                let is_text = std::str::from_utf8(&content).is_ok();
                let media_type = if is_text { "text/plain" } else { "application/octet-stream" };
                sink.writer.attach(&place.name, media_type, &content, 0)?;
            }
            None => sink.note(format!("the attachment {:?} is damaged, and is left out", place.name)),
        }
    }
    if file.require_unshortened(path).is_err() {
        sink.note(format!("{} was shortened while it was read; what was cut off is lost", path.display()));
    }
    Ok(())
}

fn take(
    channel: Option<&ChannelRecord>,
    channel_id: u16,
    log_time_ns: i64,
    data: &[u8],
    sink: &mut LogSink<'_>,
) -> Result<(), ConvertError> {
    let Some(channel) = channel else {
        sink.leave(&format!("channel {channel_id}"), "", 1, "the log does not describe it");
        return Ok(());
    };
    sink.take(&SourceMessage {
        topic: &channel.topic,
        message_type: &channel.schema_name,
        definition: channel.definition.as_deref(),
        log_time_ns,
        payload: match channel.encoding.as_str() {
            "cdr" => Payload::Cdr(data),
            "ros1" => Payload::Ros1(data),
            "protobuf" => Payload::Protobuf(data),
            other => Payload::Other(other),
        },
    })
}
