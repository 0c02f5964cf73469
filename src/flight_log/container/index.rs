use std::collections::BTreeMap;
use std::ops::Range;

use mcap::MAGIC;
use mcap::records::{ChunkHeader, Record, op};

use super::block::{Block, DecodedBlock, chunk_header, message_header, parse_definition};
use super::{RECORD_HEADER, record_at};

/// Size of the blocks into which messages outside of chunks are grouped.
const PLAIN_BLOCK_BYTES: usize = 1 << 20;

/// A channel of the log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ChannelRecord {
    pub(crate) topic: String,
    /// `sensor_msgs/msg/Imu`; empty without a schema.
    pub(crate) schema_name: String,
    /// `cdr`.
    pub(crate) encoding: String,
}

/// Position of one message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct MessagePosition {
    /// Nanoseconds since the epoch.
    pub(crate) log_time_ns: u64,
    /// Number of its block.
    pub(crate) block: usize,
    /// Offset of its record in the block's records.
    pub(crate) offset: u64,
}

/// A file attached to the log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct AttachmentRef {
    pub(crate) name: String,
    /// Range of its record in the file.
    pub(crate) bytes: Range<usize>,
}

/// Damage found while indexing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Damage {
    /// Byte offset of the damage in the file.
    pub(crate) byte: usize,
    /// Largest log time before the damage, 0 without any.
    pub(crate) after_log_time_ns: u64,
    pub(crate) problem: String,
}

/// Positions of the messages of one channel in one block.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Entries {
    /// In the message index record at this byte of the file.
    Record(usize),
    /// Log time and offset, from a scan of the file.
    Own(Vec<(u64, u64)>),
}

/// Blocks, channels and messages of an MCAP file.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct ContainerIndex {
    pub(crate) profile: String,
    pub(crate) channels: BTreeMap<u16, ChannelRecord>,
    /// In the order of the file.
    pub(crate) blocks: Vec<Block>,
    entries: Vec<BTreeMap<u16, Entries>>,
    pub(crate) attachments: Vec<AttachmentRef>,
    /// Messages by channel, as the file's statistics count them.
    pub(crate) statistics: Option<BTreeMap<u16, u64>>,
    /// Damage, in the order of the file.
    pub(crate) damages: Vec<Damage>,
    /// Whether the file's own index is used.
    pub(crate) from_summary: bool,
}

impl ContainerIndex {
    /// Reads the file's index, or builds one when the file has no valid one.
    pub(crate) fn read(file: &[u8]) -> Self {
        match Self::from_summary(file) {
            Ok(index) => index,
            Err(reason) => {
                let mut index = Self::from_scan(file);
                if let Some(problem) = reason {
                    let after_log_time_ns = index.blocks.iter().map(|block| block.log_time_ns.1).max().unwrap_or(0);
                    // A truncated file has no index either: the truncation is reported alone.
                    if index.damages.is_empty() {
                        index.damages.push(Damage { byte: file.len(), after_log_time_ns, problem });
                    }
                }
                index
            }
        }
    }

    /// The index at the end of the file. The error is the damage to report, `None` when the file has no index.
    fn from_summary(file: &[u8]) -> Result<Self, Option<String>> {
        // Footer: opcode, length, summary start (8 bytes), summary offsets' start (8), checksum (4); then the magic.
        const FOOTER: usize = RECORD_HEADER + 20;
        let footer_start = file.len().checked_sub(FOOTER + MAGIC.len()).filter(|start| *start >= MAGIC.len());
        let Some(footer_start) = footer_start.filter(|_| file.ends_with(MAGIC)) else {
            return Err(Some("the file does not end with the MCAP magic".into()));
        };
        let footer =
            record_at(file, footer_start).ok().and_then(|record| mcap::parse_record(record.opcode, record.body).ok());
        let Some(Record::Footer(footer)) = footer else {
            return Err(Some("the file has no footer".into()));
        };
        if footer.summary_start == 0 {
            return Err(None);
        }
        let start = usize::try_from(footer.summary_start).ok().filter(|start| *start < footer_start);
        let Some(start) = start else {
            return Err(Some(format!("the footer places the index at byte {}", footer.summary_start)));
        };
        // The checksum covers everything from the summary's start to its own place in the footer.
        let checksum = crc32fast::hash(&file[start..footer_start + RECORD_HEADER + 16]);
        if footer.summary_crc != 0 && checksum != footer.summary_crc {
            return Err(Some(format!("the index at byte {start} is damaged (its checksum fails)")));
        }
        let mut index = Self { from_summary: true, ..Self::default() };
        let mut schemas = BTreeMap::new();
        let mut promised_chunks = None;
        let mut position = MAGIC.len();
        if let Ok(record) = record_at(file, position)
            && let Some(Record::Header(header)) = parse_definition(record.opcode, record.body)
        {
            index.profile = header.profile;
        }
        position = start;
        while position < footer_start {
            let record = record_at(file, position).map_err(Some)?;
            match parse_definition(record.opcode, record.body) {
                Some(Record::ChunkIndex(chunk)) => {
                    let bytes = chunk_bytes(chunk.chunk_start_offset, chunk.chunk_length);
                    let Some(bytes) = bytes.filter(|bytes| bytes.end <= start) else {
                        return Err(Some(format!("the index places a chunk at byte {}", chunk.chunk_start_offset)));
                    };
                    let log_time_ns = (chunk.message_start_time, chunk.message_end_time);
                    index.blocks.push(Block { bytes, is_chunk: true, log_time_ns });
                    let offsets = chunk.message_index_offsets.iter();
                    index.entries.push(
                        offsets
                            .filter_map(|(id, at)| Some((*id, Entries::Record(usize::try_from(*at).ok()?))))
                            .collect(),
                    );
                }
                Some(Record::AttachmentIndex(attachment)) => {
                    if let Some(bytes) = chunk_bytes(attachment.offset, attachment.length) {
                        index.attachments.push(AttachmentRef { name: attachment.name, bytes });
                    }
                }
                Some(Record::Statistics(statistics)) => {
                    promised_chunks = Some((statistics.chunk_count as usize, statistics.message_count));
                    index.statistics = Some(statistics.channel_message_counts);
                }
                Some(other) => index.define(&mut schemas, &other),
                None => return Err(Some(format!("the index at byte {start} is damaged at byte {position}"))),
            }
            position = record.end;
        }
        // Without chunk indexes, channels or message indexes the rest has to be scanned.
        let without_entries = index.entries.iter().all(|entries| entries.is_empty());
        let lacks_chunks = match promised_chunks {
            Some((chunks, messages)) => chunks != index.blocks.len() || (messages > 0 && chunks == 0),
            None => index.blocks.is_empty(),
        };
        if lacks_chunks || index.channels.is_empty() || without_entries {
            return Err(None);
        }
        let mut order: Vec<usize> = (0..index.blocks.len()).collect();
        order.sort_by_key(|number| index.blocks[*number].bytes.start);
        index.blocks = order.iter().map(|number| index.blocks[*number].clone()).collect();
        index.entries = order.iter().map(|number| std::mem::take(&mut index.entries[*number])).collect();
        Ok(index)
    }

    /// Scans all records once.
    fn from_scan(file: &[u8]) -> Self {
        let mut index = Self::default();
        let mut schemas = BTreeMap::new();
        let mut position = MAGIC.len();
        let mut finished = false;
        while position < file.len() && !finished {
            let record = match record_at(file, position) {
                Ok(record) => record,
                Err(problem) => {
                    index.scan_cut_chunk(file, position, &mut schemas);
                    index.report(position, problem);
                    return index;
                }
            };
            match record.opcode {
                op::CHUNK => index.scan_chunk(file, position..record.end, &mut schemas),
                op::MESSAGE => index.scan_plain_message(position, record.end, record.body),
                op::MESSAGE_INDEX => {} // our own entries are there already
                op::FOOTER => finished = true,
                op::ATTACHMENT => match attachment(record.body) {
                    Some((name, _)) => {
                        index.attachments.push(AttachmentRef { name: name.into(), bytes: position..record.end });
                    }
                    None => index.report(position, "a damaged attachment".into()),
                },
                op::HEADER | op::SCHEMA | op::CHANNEL => match parse_definition(record.opcode, record.body) {
                    Some(Record::Header(header)) => index.profile = header.profile,
                    Some(other) => index.define(&mut schemas, &other),
                    None => index.report(position, format!("a damaged record (opcode {:#04x})", record.opcode)),
                },
                0 => {
                    index.report(position, "zeros instead of a record".into());
                    return index;
                }
                _ => {}
            }
            position = record.end;
        }
        index
    }

    fn scan_chunk(&mut self, file: &[u8], bytes: Range<usize>, schemas: &mut BTreeMap<u16, String>) {
        let mut block = Block { bytes, is_chunk: true, log_time_ns: (0, 0) };
        if let Ok((ChunkHeader { message_start_time, message_end_time, .. }, _)) = chunk_header(file, &block) {
            block.log_time_ns = (message_start_time, message_end_time);
        }
        let decoded = DecodedBlock::decode(file, &block);
        for (opcode, range) in &decoded.definitions {
            if let Some(record) = parse_definition(*opcode, decoded.bytes(file, range)) {
                self.define(schemas, &record);
            }
        }
        let mut entries: BTreeMap<u16, Entries> = BTreeMap::new();
        let log_times = || decoded.messages.iter().map(|message| message.log_time_ns);
        if let (Some(first), Some(last)) = (log_times().min(), log_times().max()) {
            block.log_time_ns = (first, last);
        } else if block.bytes.end > file.len() {
            block.log_time_ns.1 = block.log_time_ns.0;
        }
        for message in &decoded.messages {
            let entry = (message.log_time_ns, message.offset as u64);
            if let Entries::Own(list) = entries.entry(message.channel_id).or_insert_with(|| Entries::Own(Vec::new())) {
                list.push(entry);
            }
        }
        if let Some(problem) = &decoded.damage {
            self.report(block.bytes.start, problem.clone());
        }
        self.blocks.push(block);
        self.entries.push(entries);
    }

    /// Indexes the readable messages of a truncated chunk.
    fn scan_cut_chunk(&mut self, file: &[u8], position: usize, schemas: &mut BTreeMap<u16, String>) {
        if file.get(position) != Some(&op::CHUNK) || file.len() < position + RECORD_HEADER {
            return;
        }
        let damages = self.damages.len();
        self.scan_chunk(file, position..usize::MAX, schemas);
        self.damages.truncate(damages); // the caller reports the cut
    }

    fn scan_plain_message(&mut self, position: usize, end: usize, body: &[u8]) {
        let Some((channel_id, log_time_ns)) = message_header(body) else {
            self.report(position, format!("a message record of {} bytes", body.len()));
            return;
        };
        let grows = self.blocks.last().is_some_and(|block| {
            !block.is_chunk && block.bytes.end == position && position - block.bytes.start < PLAIN_BLOCK_BYTES
        });
        if !grows {
            self.blocks.push(Block { bytes: position..end, is_chunk: false, log_time_ns: (log_time_ns, log_time_ns) });
            self.entries.push(BTreeMap::new());
        }
        if let (Some(block), Some(entries)) = (self.blocks.last_mut(), self.entries.last_mut()) {
            block.bytes.end = end;
            block.log_time_ns.0 = block.log_time_ns.0.min(log_time_ns);
            block.log_time_ns.1 = block.log_time_ns.1.max(log_time_ns);
            let offset = (position - block.bytes.start) as u64;
            if let Entries::Own(list) = entries.entry(channel_id).or_insert_with(|| Entries::Own(Vec::new())) {
                list.push((log_time_ns, offset));
            }
        }
    }

    fn define(&mut self, schemas: &mut BTreeMap<u16, String>, record: &Record<'_>) {
        match record {
            Record::Schema { header, .. } => {
                schemas.insert(header.id, header.name.clone());
            }
            Record::Channel(channel) => {
                let schema_name = schemas.get(&channel.schema_id).cloned().unwrap_or_default();
                let (topic, encoding) = (channel.topic.clone(), channel.message_encoding.clone());
                self.channels.insert(channel.id, ChannelRecord { topic, schema_name, encoding });
            }
            _ => {}
        }
    }

    fn report(&mut self, byte: usize, problem: String) {
        let after_log_time_ns = self.blocks.iter().map(|block| block.log_time_ns.1).max().unwrap_or(0);
        self.damages.push(Damage { byte, after_log_time_ns, problem });
    }

    /// The content of an attachment, `None` when it is damaged.
    pub(crate) fn attachment<'a>(file: &'a [u8], place: &AttachmentRef) -> Option<&'a [u8]> {
        let record = record_at(file, place.bytes.start).ok().filter(|record| record.opcode == op::ATTACHMENT)?;
        attachment(record.body).map(|(_, content)| content)
    }

    /// Numbers of the blocks with messages of some channels.
    pub(super) fn blocks_with(&self, channel_ids: &[u16]) -> Vec<usize> {
        let has = |entries: &BTreeMap<u16, Entries>| channel_ids.iter().any(|id| entries.contains_key(id));
        self.entries.iter().enumerate().filter(|(_, entries)| has(entries)).map(|(number, _)| number).collect()
    }

    /// The positions of the messages of some channels in some blocks, in the order of their log times.
    pub(super) fn positions(&self, file: &[u8], blocks: &[usize], channel_ids: &[u16]) -> Vec<MessagePosition> {
        let mut positions = Vec::new();
        for number in blocks.iter().copied() {
            for (channel_id, entries) in self.entries[number].iter().filter(|(id, _)| channel_ids.contains(id)) {
                let indexed = match entries {
                    Entries::Own(list) => Some(list.clone()),
                    Entries::Record(at) => message_index(file, *at, *channel_id, &self.blocks[number]),
                };
                let list = indexed.unwrap_or_else(|| {
                    // The index record is damaged; the block itself is read.
                    let decoded = DecodedBlock::decode(file, &self.blocks[number]);
                    let own = decoded.messages.iter().filter(|message| message.channel_id == *channel_id);
                    own.map(|message| (message.log_time_ns, message.offset as u64)).collect()
                });
                let place = |(log_time_ns, offset)| MessagePosition { log_time_ns, block: number, offset };
                positions.extend(list.into_iter().map(place));
            }
        }
        positions.sort();
        positions
    }
}

/// Name and content of an attachment record's body, `None` when it is damaged (its checksum counts too).
fn attachment(body: &[u8]) -> Option<(&str, &[u8])> {
    let text = |at: usize| {
        let length = u32::from_le_bytes(body.get(at..at + 4)?.try_into().ok()?) as usize;
        let end = (at + 4).checked_add(length)?;
        Some((std::str::from_utf8(body.get(at + 4..end)?).ok()?, end))
    };
    // Log time and creation time (8 bytes each), name, media type, size (8), content, checksum (4).
    let (name, end) = text(16)?;
    let (_media_type, end) = text(end)?;
    let size = u64::from_le_bytes(body.get(end..end + 8)?.try_into().ok()?);
    let content_end = (end + 8).checked_add(usize::try_from(size).ok()?)?;
    let content = body.get(end + 8..content_end)?;
    let checksum = u32::from_le_bytes(body.get(content_end..content_end + 4)?.try_into().ok()?);
    (checksum == 0 || checksum == crc32fast::hash(&body[..content_end])).then_some((name, content))
}

/// The record's bytes from the offset and length of an index.
fn chunk_bytes(offset: u64, length: u64) -> Option<Range<usize>> {
    let start = usize::try_from(offset).ok()?;
    Some(start..start.checked_add(usize::try_from(length).ok()?)?)
}

/// Log times and offsets in the message index record at a byte, `None` when there is no such record or it is
/// inconsistent with the block: message indexes have no checksum.
fn message_index(file: &[u8], at: usize, channel_id: u16, block: &Block) -> Option<Vec<(u64, u64)>> {
    let record = record_at(file, at).ok().filter(|record| record.opcode == op::MESSAGE_INDEX)?;
    // Channel (2 bytes), size of the list (4), then log time and offset (8 each) of every message.
    let (head, list) = record.body.split_at_checked(6)?;
    let size = u32::from_le_bytes([head[2], head[3], head[4], head[5]]) as usize;
    if u16::from_le_bytes([head[0], head[1]]) != channel_id || size != list.len() || !size.is_multiple_of(16) {
        return None;
    }
    let (first, last) = block.log_time_ns;
    list.chunks_exact(16)
        .map(|entry| {
            let log_time = u64::from_le_bytes(entry[..8].try_into().ok()?);
            let offset = u64::from_le_bytes(entry[8..].try_into().ok()?);
            (log_time >= first && log_time <= last).then_some((log_time, offset))
        })
        .collect()
}
