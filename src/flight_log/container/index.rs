use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::Arc;

use mcap::MAGIC;
use mcap::records::{ChunkHeader, Record, op};

use super::block::{Block, DecodedBlock, MESSAGE_HEADER, chunk_header, message_header, parse_definition};
use super::file::{FileWindow, LogFile};
use super::{RECORD_HEADER, record_at, record_in_file};
use crate::files::limits::DEFINITION_BYTES;
use crate::files::{LimitExceeded, LimitKind};

/// Channel (2 bytes) and size of the list (4) of a message index.
const MESSAGE_INDEX_HEAD: usize = 6;
/// Footer: opcode, length, summary start (8 bytes), summary offsets' start (8), checksum (4); the magic follows.
const FOOTER_BYTES: usize = RECORD_HEADER + 20;
const NO_END_MAGIC: &str = "the file does not end with the MCAP magic";
/// Messages outside of chunks are gathered into blocks of about this size.
const PLAIN_BLOCK_BYTES: usize = 1 << 20;

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ChannelRecord {
    pub(crate) topic: String,
    /// Such as `sensor_msgs/msg/Imu`; empty without a schema.
    pub(crate) schema_name: String,
    /// Encoding of the messages, such as `cdr`.
    pub(crate) encoding: String,
    /// Message definition in the language `ros2msg`, `None` for another language.
    pub(crate) definition: Option<Arc<str>>,
}

/// Schema of a log, with its definition if that is in the language `ros2msg`.
#[derive(Clone, Debug)]
struct SchemaRecord {
    name: String,
    definition: Option<Arc<str>>,
}

/// State of [`ContainerIndex::define`] from earlier definitions.
#[derive(Debug, Default)]
struct Definitions {
    schemas: BTreeMap<u16, SchemaRecord>,
    /// Size of all stored definitions.
    bytes: usize,
    /// Rejected channels, reported once.
    refused: BTreeSet<u16>,
    /// Channel of the index for each channel of the file, in a file in which a recording goes on; `None` in the first file,
    /// where both are the same.
    renumbered: Option<Arc<BTreeMap<u16, u16>>>,
}

impl Definitions {
    /// Channel of the index for a channel of the file; `None` if that is not defined.
    fn indexed(&self, channel_id: u16) -> Option<u16> {
        self.renumbered.as_ref().map_or(Some(channel_id), |known| known.get(&channel_id).copied())
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct MessagePosition {
    /// Nanoseconds since the epoch.
    pub(crate) log_time_ns: u64,
    pub(crate) block: usize,
    /// Offset of the message record in the block's records.
    pub(crate) offset: u64,
}

/// File attached to the log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct AttachmentRef {
    pub(crate) name: String,
    /// Range of the attachment record in the file.
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
    Scanned(Vec<(u64, u64)>),
}

/// Place of a scan that goes on when more of the file has been written.
#[derive(Debug)]
pub(crate) struct ScanState {
    /// Start of the next record in the file.
    position: usize,
    definitions: Definitions,
}

impl Default for ScanState {
    fn default() -> Self {
        Self { position: MAGIC.len(), definitions: Definitions::default() }
    }
}

impl ScanState {
    /// Scan of a file in which a recording goes on, with definitions of its own.
    pub(crate) fn of_part(start: usize) -> Self {
        let definitions = Definitions { renumbered: Some(Arc::default()), ..Definitions::default() };
        Self { position: start + MAGIC.len(), definitions }
    }

    /// Smallest length of a log of which the footer has been reached.
    pub(crate) fn complete_bytes(&self) -> usize {
        self.position + FOOTER_BYTES + MAGIC.len()
    }
}

/// Reason why a scan has stopped.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum ScanEnd {
    /// At the footer: the log is complete.
    Footer,
    /// At the end of the file, between two records.
    EndOfFile,
    /// At a record that is not complete, or at zeros; with the problem.
    Incomplete(String),
    /// At a limit, which is reported.
    Limit,
}

/// Blocks, channels and messages of an MCAP file.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct ContainerIndex {
    pub(crate) profile: String,
    pub(crate) channels: BTreeMap<u16, ChannelRecord>,
    /// In the order of the file.
    pub(crate) blocks: Vec<Block>,
    entries: Vec<Arc<BTreeMap<u16, Entries>>>,
    /// True if messages outside of chunks may be added to the last block.
    extends_last: bool,
    pub(crate) attachments: Vec<AttachmentRef>,
    /// Number of messages by channel, by the file's statistics.
    pub(crate) statistics: Option<BTreeMap<u16, u64>>,
    /// Damage, in the order of the file.
    pub(crate) damages: Vec<Damage>,
    /// True if the index of the file is used.
    pub(crate) from_summary: bool,
    /// Number of messages indexed by scanning the file.
    scanned_messages: u64,
    /// Number of messages by block and channel, by the message indexes after a damaged block, from scanning the file.
    scanned_promises: BTreeMap<usize, BTreeMap<u16, u64>>,
}

impl ContainerIndex {
    /// Reads the index of the file, or builds one if the file has no valid one.
    pub(crate) fn read(file: &LogFile) -> Self {
        match Self::from_summary(file) {
            Ok(index) => index,
            Err(reason) => {
                let mut index = Self::from_scan(file);
                if let Some(problem) = reason {
                    let after_log_time_ns = index.last_log_time_ns();
                    // A truncated file has no index either, so only the truncation is reported.
                    if index.damages.is_empty() {
                        index.damages.push(Damage { byte: file.len(), after_log_time_ns, problem });
                    }
                }
                index
            }
        }
    }

    /// Reads the index at the end of the file. The error is the damage to report, `None` for a file without index.
    fn from_summary(file: &LogFile) -> Result<Self, Option<String>> {
        let footer_start = file.len().checked_sub(FOOTER_BYTES + MAGIC.len()).filter(|start| *start >= MAGIC.len());
        let Some(footer_start) = footer_start else {
            return Err(Some(NO_END_MAGIC.into()));
        };
        let end = file.read(footer_start..file.len()).map_err(Some)?;
        if !end.ends_with(MAGIC) {
            return Err(Some(NO_END_MAGIC.into()));
        }
        let footer = record_at(&end, 0).ok().and_then(|record| mcap::parse_record(record.opcode, record.body).ok());
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
        // The checksum covers everything from the summary's start to its own position in the footer.
        let summary = file.read(start..footer_start + RECORD_HEADER + 16).map_err(Some)?;
        let checksum = crc32fast::hash(&summary);
        if footer.summary_crc != 0 && checksum != footer.summary_crc {
            return Err(Some(format!("the index at byte {start} is damaged (its checksum fails)")));
        }
        let mut index = Self { from_summary: true, ..Self::default() };
        let mut definitions = Definitions::default();
        let mut promised_chunks = None;
        index.read_profile(file);
        let mut position = 0;
        while start + position < footer_start {
            let record = record_at(&summary, position).map_err(Some)?;
            match parse_definition(record.opcode, record.body) {
                Some(Record::ChunkIndex(chunk)) => {
                    let bytes = chunk_bytes(chunk.chunk_start_offset, chunk.chunk_length);
                    let Some(bytes) = bytes.filter(|bytes| bytes.end <= start) else {
                        return Err(Some(format!("the index places a chunk at byte {}", chunk.chunk_start_offset)));
                    };
                    let log_time_ns = (chunk.message_start_time, chunk.message_end_time);
                    index.blocks.push(Block { bytes, is_chunk: true, log_time_ns, renumbered: None });
                    let offsets = chunk.message_index_offsets.iter();
                    let entries =
                        offsets.filter_map(|(id, at)| Some((*id, Entries::Record(usize::try_from(*at).ok()?))));
                    index.entries.push(Arc::new(entries.collect()));
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
                Some(other) => index.define(file, &mut definitions, &other, start + position),
                None => {
                    let byte = start + position;
                    return Err(Some(format!("the index at byte {start} is damaged at byte {byte}")));
                }
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
        index.entries = order.iter().map(|number| Arc::clone(&index.entries[*number])).collect();
        if let Some(pair) = index.blocks.windows(2).find(|pair| pair[1].bytes.start < pair[0].bytes.end) {
            return Err(Some(format!("the index places two chunks at byte {}", pair[1].bytes.start)));
        }
        Ok(index)
    }

    fn read_profile(&mut self, file: &LogFile) {
        let mut window = FileWindow::new(file);
        if let Ok((op::HEADER, body)) = record_in_file(&mut window, file, MAGIC.len())
            && let Ok(body) = file.read(body)
            && let Some(Record::Header(header)) = parse_definition(op::HEADER, &body)
        {
            self.profile = header.profile;
        }
    }

    /// Scans all records once.
    fn from_scan(file: &LogFile) -> Self {
        let (mut index, mut state) = (Self::default(), ScanState::default());
        if let ScanEnd::Incomplete(problem) = index.scan(file, &mut state) {
            index.scan_cut_chunk(file, state.position, &mut state.definitions);
            index.report(state.position, problem);
        }
        index
    }

    /// Adds the complete records after the place of the scan.
    pub(crate) fn scan(&mut self, file: &LogFile, state: &mut ScanState) -> ScanEnd {
        let ScanState { position: next, definitions } = state;
        let mut window = FileWindow::new(file);
        // Blocks of an earlier part have been read by now.
        self.extends_last = false;
        while *next < file.len() {
            let position = *next;
            let (opcode, body) = match record_in_file(&mut window, file, position) {
                Ok(record) => record,
                Err(problem) => return ScanEnd::Incomplete(problem),
            };
            let end = body.end;
            match opcode {
                op::CHUNK => self.scan_chunk(file, position..end, definitions),
                op::MESSAGE => {
                    let header = window.read(body.start..body.end.min(body.start + MESSAGE_HEADER));
                    self.scan_plain_message(position, end, header.unwrap_or_default(), definitions);
                }
                // Entries of readable blocks exist already; only the counts of damaged blocks are needed.
                op::MESSAGE_INDEX => {
                    if let Ok(head) = window.read(body.start..body.end.min(body.start + MESSAGE_INDEX_HEAD)) {
                        self.scan_message_index(head, definitions);
                    }
                }
                op::FOOTER => return ScanEnd::Footer,
                op::ATTACHMENT => {
                    match file.read(body).map(|body| attachment(&body).map(|(name, _)| name.to_owned())) {
                        Ok(Some(name)) => self.attachments.push(AttachmentRef { name, bytes: position..end }),
                        Ok(None) => self.report(position, "a damaged attachment".into()),
                        Err(problem) => self.report(position, problem),
                    }
                }
                op::HEADER | op::SCHEMA | op::CHANNEL => match file.read(body) {
                    Ok(body) => match parse_definition(opcode, &body) {
                        Some(Record::Header(header)) => self.profile = header.profile,
                        Some(other) => self.define(file, definitions, &other, position),
                        None => self.report(position, format!("a damaged record (opcode {opcode:#04x})")),
                    },
                    Err(problem) => self.report(position, problem),
                },
                0 => return ScanEnd::Incomplete("zeros instead of a record".into()),
                _ => {}
            }
            let allowed = file.limits().messages(file.len() as u64);
            if self.scanned_messages > allowed {
                let (kind, subject, found) = (LimitKind::Messages, "a log", self.scanned_messages);
                self.report(position, LimitExceeded { kind, subject, found, allowed }.to_string());
                return ScanEnd::Limit;
            }
            *next = end;
        }
        ScanEnd::EndOfFile
    }

    fn scan_chunk(&mut self, file: &LogFile, bytes: Range<usize>, definitions: &mut Definitions) {
        let mut block = Block { bytes, is_chunk: true, log_time_ns: (0, 0), renumbered: None };
        if let Ok((ChunkHeader { message_start_time, message_end_time, .. }, _)) = chunk_header(file, &block) {
            block.log_time_ns = (message_start_time, message_end_time);
        }
        let decoded = DecodedBlock::decode(file, &block);
        for (opcode, range) in &decoded.definitions {
            if let Some(record) = parse_definition(*opcode, decoded.bytes(range)) {
                self.define(file, definitions, &record, block.bytes.start);
            }
        }
        block.renumbered.clone_from(&definitions.renumbered);
        let mut entries: BTreeMap<u16, Entries> = BTreeMap::new();
        let log_times = || decoded.messages.iter().map(|message| message.log_time_ns);
        if let (Some(first), Some(last)) = (log_times().min(), log_times().max()) {
            block.log_time_ns = (first, last);
        } else if block.bytes.end > file.len() {
            block.log_time_ns.1 = block.log_time_ns.0;
        }
        for message in &decoded.messages {
            let entry = (message.log_time_ns, message.offset as u64);
            let Some(channel_id) = definitions.indexed(message.channel_id) else { continue };
            if let Entries::Scanned(list) = entries.entry(channel_id).or_insert_with(|| Entries::Scanned(Vec::new())) {
                list.push(entry);
            }
        }
        self.scanned_messages += decoded.messages.len() as u64;
        if let Some(problem) = &decoded.damage {
            self.report(block.bytes.start, problem.clone());
            self.scanned_promises.insert(self.blocks.len(), BTreeMap::new());
        }
        self.blocks.push(block);
        self.entries.push(Arc::new(entries));
    }

    /// Stores the number of messages of a message index record after a damaged chunk.
    fn scan_message_index(&mut self, head: &[u8], definitions: &Definitions) {
        let Some(number) = self.blocks.len().checked_sub(1) else { return };
        if let (Some(promises), &[c0, c1, s0, s1, s2, s3]) = (self.scanned_promises.get_mut(&number), head) {
            let count = u32::from_le_bytes([s0, s1, s2, s3]) / 16;
            let channel_id = definitions.indexed(u16::from_le_bytes([c0, c1]));
            promises.extend(channel_id.map(|id| (id, u64::from(count))));
        }
    }

    /// Indexes the readable messages of a truncated chunk.
    fn scan_cut_chunk(&mut self, file: &LogFile, position: usize, definitions: &mut Definitions) {
        if file.len() < position + RECORD_HEADER || file.read(position..position + 1).ok() != Some(vec![op::CHUNK]) {
            return;
        }
        let damages = self.damages.len();
        self.scan_chunk(file, position..usize::MAX, definitions);
        self.damages.truncate(damages); // the caller reports the cut
    }

    fn scan_plain_message(&mut self, position: usize, end: usize, header: &[u8], definitions: &Definitions) {
        let Some((channel_id, log_time_ns)) = message_header(header) else {
            self.report(position, format!("a message record of {} bytes", end - position - RECORD_HEADER));
            return;
        };
        let Some(channel_id) = definitions.indexed(channel_id) else { return };
        let grows = self.blocks.last().is_some_and(|block| {
            !block.is_chunk && block.bytes.end == position && position - block.bytes.start < PLAIN_BLOCK_BYTES
        });
        if !grows || !self.extends_last {
            let log_time_ns = (log_time_ns, log_time_ns);
            self.blocks.push(Block { bytes: position..end, is_chunk: false, log_time_ns, renumbered: None });
            self.entries.push(Arc::default());
            self.extends_last = true;
        }
        self.scanned_messages += 1;
        if let (Some(block), Some(entries)) = (self.blocks.last_mut(), self.entries.last_mut()) {
            block.bytes.end = end;
            block.renumbered.clone_from(&definitions.renumbered);
            block.log_time_ns.0 = block.log_time_ns.0.min(log_time_ns);
            block.log_time_ns.1 = block.log_time_ns.1.max(log_time_ns);
            let offset = (position - block.bytes.start) as u64;
            let entries = Arc::make_mut(entries);
            if let Entries::Scanned(list) = entries.entry(channel_id).or_insert_with(|| Entries::Scanned(Vec::new())) {
                list.push((log_time_ns, offset));
            }
        }
    }

    /// Stores a schema or a channel; the first definition of a channel is used, and names beyond the limits are
    /// rejected.
    fn define(&mut self, file: &LogFile, definitions: &mut Definitions, record: &Record<'_>, byte: usize) {
        let limits = file.limits();
        match record {
            Record::Schema { header, data } => {
                let allowed = limits.check_name("the name of a message type", &header.name).is_ok();
                if !allowed || definitions.schemas.contains_key(&header.id) {
                    return;
                }
                let text = std::str::from_utf8(data).ok().filter(|_| header.encoding == "ros2msg");
                let text = text.filter(|text| definitions.bytes + text.len() <= DEFINITION_BYTES);
                definitions.bytes += text.map_or(0, str::len);
                let schema = SchemaRecord { name: header.name.clone(), definition: text.map(Arc::from) };
                definitions.schemas.insert(header.id, schema);
            }
            Record::Channel(channel) => {
                let schema = definitions.schemas.get(&channel.schema_id);
                let taken = ChannelRecord {
                    topic: channel.topic.clone(),
                    schema_name: schema.map(|schema| schema.name.clone()).unwrap_or_default(),
                    encoding: channel.message_encoding.clone(),
                    definition: schema.and_then(|schema| schema.definition.clone()),
                };
                let id = match &mut definitions.renumbered {
                    None => channel.id,
                    Some(known) => *Arc::make_mut(known).entry(channel.id).or_insert_with(|| {
                        let same = self.channels.iter().find(|(_, other)| **other == taken);
                        let next = || self.channels.last_key_value().map_or(0, |(last, _)| last.saturating_add(1));
                        same.map_or_else(next, |(id, _)| *id)
                    }),
                };
                let problem = match self.channels.get(&id) {
                    Some(known) if *known == taken => return,
                    Some(known) => Some(format!(
                        "channel {} is defined again as {:?}; its first definition, {:?}, is used",
                        channel.id, taken.topic, known.topic
                    )),
                    None => {
                        let names = limits.check_name("the name of a topic", &taken.topic);
                        let names = names.and_then(|()| limits.check_name("the name of an encoding", &taken.encoding));
                        names.err().map(|error| format!("channel {} is not read: {error}", channel.id))
                    }
                };
                match problem {
                    None => {
                        self.channels.insert(id, taken);
                    }
                    Some(problem) if definitions.refused.insert(channel.id) => self.report(byte, problem),
                    Some(_) => {}
                }
            }
            _ => {}
        }
    }

    /// Smallest log time, `None` without messages.
    pub(crate) fn first_log_time_ns(&self) -> Option<u64> {
        self.blocks.iter().map(|block| block.log_time_ns.0).min()
    }

    /// Time from the first to the last message.
    pub(crate) fn span_ns(&self) -> u64 {
        self.last_log_time_ns() - self.first_log_time_ns().unwrap_or(0)
    }

    /// Largest log time, 0 without messages.
    pub(crate) fn last_log_time_ns(&self) -> u64 {
        self.last_log_time_ns_of(self.blocks.len())
    }

    /// Largest log time of the first blocks, 0 without messages.
    pub(crate) fn last_log_time_ns_of(&self, blocks: usize) -> u64 {
        self.blocks.iter().take(blocks).map(|block| block.log_time_ns.1).max().unwrap_or(0)
    }

    fn report(&mut self, byte: usize, problem: String) {
        let after_log_time_ns = self.last_log_time_ns();
        self.damages.push(Damage { byte, after_log_time_ns, problem });
    }

    /// Content of an attachment, `None` if it is damaged.
    pub(crate) fn attachment(file: &LogFile, place: &AttachmentRef) -> Option<Vec<u8>> {
        let bytes = file.read(place.bytes.start..place.bytes.end.min(file.len())).ok()?;
        let record = record_at(&bytes, 0).ok().filter(|record| record.opcode == op::ATTACHMENT)?;
        attachment(record.body).map(|(_, content)| content.to_vec())
    }

    /// Numbers of the blocks from one on with messages of some channels.
    pub(super) fn blocks_with(&self, channel_ids: &[u16], from: usize) -> Vec<usize> {
        let has = |number: &usize| channel_ids.iter().any(|id| self.entries[*number].contains_key(id));
        (from..self.blocks.len()).filter(has).collect()
    }

    /// Positions of the messages of some channels in some blocks, in the order of their log times.
    pub(super) fn positions(&self, file: &LogFile, blocks: &[usize], channel_ids: &[u16]) -> Vec<MessagePosition> {
        let mut positions = Vec::new();
        for number in blocks.iter().copied() {
            for (channel_id, entries) in self.entries[number].iter().filter(|(id, _)| channel_ids.contains(id)) {
                let indexed = match entries {
                    Entries::Scanned(list) => Some(list.clone()),
                    Entries::Record(at) => self.message_index(file, *at, *channel_id, number),
                };
                let list = indexed.unwrap_or_else(|| {
                    // The index record is damaged, so the block itself is read.
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

    /// Number of messages of each channel of a block, by its message indexes; channels with a damaged index are
    /// missing.
    pub(crate) fn promised(&self, file: &LogFile, number: usize) -> BTreeMap<u16, u64> {
        if let Some(promises) = self.scanned_promises.get(&number) {
            return promises.clone();
        }
        let count = |channel_id: u16, entries: &Entries| match entries {
            Entries::Scanned(list) => Some(list.len() as u64),
            Entries::Record(at) => self.message_index(file, *at, channel_id, number).map(|list| list.len() as u64),
        };
        let counts = self.entries[number].iter().filter_map(|(id, entries)| Some((*id, count(*id, entries)?)));
        counts.collect()
    }

    /// Log times and offsets of the message index record at a byte, `None` if there is no such record or it is
    /// inconsistent with the block: message indexes have no checksum. They lie between their chunk and the next one, so
    /// that no two chunks share one.
    fn message_index(&self, file: &LogFile, at: usize, channel_id: u16, number: usize) -> Option<Vec<(u64, u64)>> {
        let block = &self.blocks[number];
        let end = self.blocks.get(number + 1).map_or(file.len(), |next| next.bytes.start).min(file.len());
        let at = Some(at).filter(|at| *at >= block.bytes.end && *at < end)?;
        let mut window = FileWindow::new(file);
        let (opcode, body) = record_in_file(&mut window, file, at).ok()?;
        if opcode != op::MESSAGE_INDEX || body.end > end {
            return None;
        }
        let body = window.read(body).ok()?;
        // Channel (2 bytes), size of the list (4), then log time and offset (8 each) of every message.
        let (head, list) = body.split_at_checked(MESSAGE_INDEX_HEAD)?;
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
}

/// Name and content of an attachment record's body, `None` if it is damaged or its checksum is wrong.
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

/// Range of a record by the offset and length in an index.
fn chunk_bytes(offset: u64, length: u64) -> Option<Range<usize>> {
    let start = usize::try_from(offset).ok()?;
    Some(start..start.checked_add(usize::try_from(length).ok()?)?)
}
