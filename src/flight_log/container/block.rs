use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use mcap::records::{ChunkHeader, Record, op};

use super::file::LogFile;
use super::unpack::unpack_chunk;
use super::{RECORD_HEADER, record_at};
use crate::files::LogLimits;

/// Range of the file with messages: one chunk record, or message records outside of chunks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Block {
    /// Range in the file; its end lies beyond the file's end if the log is truncated inside the block.
    pub(crate) bytes: Range<usize>,
    pub(crate) is_chunk: bool,
    /// Smallest and largest log time of the messages.
    pub(crate) log_time_ns: (u64, u64),
    /// Channel of the index for each channel of the file, in a file in which a recording goes on.
    pub(crate) renumbered: Option<Arc<BTreeMap<u16, u16>>>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct MessageSpan {
    pub(crate) channel_id: u16,
    pub(crate) log_time_ns: u64,
    /// Start of the message record in the block's records.
    pub(crate) offset: usize,
    /// Range of the message data in the block's records.
    pub(crate) data: Range<usize>,
}

/// Records of a block, decompressed and checked.
#[derive(Debug)]
pub(crate) struct DecodedBlock {
    records: Vec<u8>,
    /// In the order of the file.
    pub(crate) messages: Vec<MessageSpan>,
    /// Schema and channel records, as opcode and body.
    pub(crate) definitions: Vec<(u8, Range<usize>)>,
    /// Damage of the block; `messages` precede it.
    pub(crate) damage: Option<String>,
}

impl DecodedBlock {
    /// Decodes a block of a file. A chunk with a wrong checksum has no message; one truncated by the file's end has
    /// those before the end.
    pub(crate) fn decode(file: &LogFile, block: &Block) -> Self {
        let end = block.bytes.end.min(file.len());
        let read = if block.is_chunk {
            read_chunk(file, block)
        } else {
            file.read(block.bytes.start..end).map(|bytes| (bytes, None))
        };
        match read {
            Ok((records, damage)) => {
                let mut decoded = Self::from_records(records, damage);
                if let Some(known) = &block.renumbered {
                    decoded.messages.retain_mut(|message| {
                        let indexed = known.get(&message.channel_id).copied();
                        message.channel_id = indexed.unwrap_or(message.channel_id);
                        indexed.is_some()
                    });
                }
                decoded
            }
            Err(damage) => {
                Self { records: Vec::new(), messages: Vec::new(), definitions: Vec::new(), damage: Some(damage) }
            }
        }
    }

    fn from_records(records: Vec<u8>, mut damage: Option<String>) -> Self {
        let mut messages = Vec::new();
        let mut definitions = Vec::new();
        let mut offset = 0;
        while offset < records.len() {
            let record = match record_at(&records, offset) {
                Ok(record) => record,
                Err(problem) => {
                    damage.get_or_insert(problem);
                    break;
                }
            };
            match record.opcode {
                op::MESSAGE => match message_header(record.body) {
                    Some((channel_id, log_time_ns)) => {
                        let data = record.end - record.body.len() + MESSAGE_HEADER..record.end;
                        messages.push(MessageSpan { channel_id, log_time_ns, offset, data });
                    }
                    None => {
                        damage.get_or_insert_with(|| format!("a message record of {} bytes", record.body.len()));
                    }
                },
                op::SCHEMA | op::CHANNEL => {
                    definitions.push((record.opcode, record.end - record.body.len()..record.end));
                }
                _ => {}
            }
            offset = record.end;
        }
        Self { records, messages, definitions, damage }
    }

    /// Bytes at a range of a [`MessageSpan`] or a definition.
    pub(crate) fn bytes(&self, range: &Range<usize>) -> &[u8] {
        &self.records[range.clone()]
    }

    /// Message whose record starts at an offset of the message index.
    pub(crate) fn message_at(&self, offset: u64) -> Option<&MessageSpan> {
        let index = self.messages.binary_search_by_key(&offset, |message| message.offset as u64).ok()?;
        self.messages.get(index)
    }
}

/// Channel (2 bytes), sequence (4), log time (8), publish time (8).
pub(crate) const MESSAGE_HEADER: usize = 22;

/// Channel and log time of a message record's body.
pub(crate) fn message_header(body: &[u8]) -> Option<(u16, u64)> {
    let header = body.get(..MESSAGE_HEADER)?;
    let channel_id = u16::from_le_bytes([header[0], header[1]]);
    let log_time = u64::from_le_bytes([
        header[6], header[7], header[8], header[9], header[10], header[11], header[12], header[13],
    ]);
    Some((channel_id, log_time))
}

/// Start, end and size (8 bytes each), checksum (4), then the compression's name and the compressed size (8).
const COMPRESSION_NAME_AT: usize = 28;
/// Longest name of a compression; `zstd` and `lz4` are in use.
const COMPRESSION_NAME_BYTES: usize = 64;

/// Returns the header of a block's chunk record, with the range of its data in the file (cut at the file's end).
pub(crate) fn chunk_header(file: &LogFile, block: &Block) -> Result<(ChunkHeader, Range<usize>), String> {
    const LARGEST: usize = RECORD_HEADER + COMPRESSION_NAME_AT + 4 + COMPRESSION_NAME_BYTES + 8;
    let record_end = block.bytes.end.min(file.len());
    let body_start = block.bytes.start.saturating_add(RECORD_HEADER);
    if body_start > record_end {
        return Err("the file ends inside a chunk's header".into());
    }
    let start = file.read(block.bytes.start..block.bytes.start.saturating_add(LARGEST).min(record_end))?;
    if start[0] != op::CHUNK {
        return Err(format!("opcode {:#04x}, expected a chunk by the index", start[0]));
    }
    let body = &start[RECORD_HEADER..];
    let name_length = body
        .get(COMPRESSION_NAME_AT..COMPRESSION_NAME_AT + 4)
        .map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    let header_length = name_length
        .filter(|length| *length < COMPRESSION_NAME_BYTES)
        .map(|length| COMPRESSION_NAME_AT + 4 + length + 8);
    let header = header_length.and_then(|length| body.get(..length)).ok_or("a damaged chunk header")?;
    // `parse_record` accepts a chunk header only with its data, so the fields are read one by one.
    let number = |at: usize| {
        let mut bytes = [0; 8];
        bytes.copy_from_slice(&header[at..at + 8]);
        u64::from_le_bytes(bytes)
    };
    let compression = std::str::from_utf8(&header[COMPRESSION_NAME_AT + 4..header.len() - 8])
        .map_err(|error| format!("a damaged chunk header ({error})"))?;
    let parsed = ChunkHeader {
        message_start_time: number(0),
        message_end_time: number(8),
        uncompressed_size: number(16),
        uncompressed_crc: u32::from_le_bytes([header[24], header[25], header[26], header[27]]),
        compression: compression.to_owned(),
        compressed_size: number(header.len() - 8),
    };
    let data_start = body_start + header.len();
    let data_length =
        usize::try_from(parsed.compressed_size).map_err(|error| format!("a damaged chunk header ({error})"))?;
    let promised_end = data_start.saturating_add(data_length);
    if promised_end > block.bytes.end {
        return Err(format!("a chunk of {data_length} compressed bytes in a record that ends before"));
    }
    Ok((parsed, data_start..promised_end.min(file.len())))
}

/// Reads, decompresses and checks a chunk: returns its records, and the damage if it is truncated.
fn read_chunk(file: &LogFile, block: &Block) -> Result<(Vec<u8>, Option<String>), String> {
    const CUT: &str = "the file ends inside this chunk";
    let (header, range) = chunk_header(file, block)?;
    let cut = (range.len() as u64) < header.compressed_size;
    let stored = range.len() as u64;
    let data = file.read(range)?;
    let records = if header.compression.is_empty() {
        data
    } else {
        let limits = file.limits();
        limits.check_record("a chunk", header.uncompressed_size, stored).map_err(|error| error.to_string())?;
        let claimed = usize::try_from(header.uncompressed_size).map_err(|error| error.to_string())?;
        let (records, problem) = unpack_chunk(&header.compression, &data, claimed);
        if let Some(problem) = problem.filter(|_| !cut) {
            return Err(format!("the chunk cannot be decompressed ({problem})"));
        }
        records
    };
    if cut {
        return Ok((records, Some(CUT.into())));
    }
    if records.len() as u64 != header.uncompressed_size {
        let more = if records.len() as u64 > header.uncompressed_size { "more than" } else { "fewer than" };
        return Err(format!("the chunk holds {more} the {} bytes of its header", header.uncompressed_size));
    }
    let checksum = crc32fast::hash(&records);
    if header.uncompressed_crc != 0 && checksum != header.uncompressed_crc {
        return Err(format!("checksum {checksum:08x} instead of {:08x}", header.uncompressed_crc));
    }
    Ok((records, None))
}

/// Cache of recently decoded blocks.
#[derive(Debug)]
pub(crate) struct BlockCache {
    /// The most recently used block is the last.
    entries: Vec<(usize, Arc<DecodedBlock>)>,
    capacity: usize,
    /// Largest size of a cache with more than two blocks.
    capacity_bytes: u64,
}

impl BlockCache {
    /// Creates a cache of `capacity` blocks.
    pub(crate) fn new(capacity: usize) -> Self {
        Self { entries: Vec::with_capacity(capacity + 1), capacity, capacity_bytes: u64::MAX }
    }

    /// Limits the size of a cache with more than two blocks.
    pub(crate) fn with_capacity_bytes(self, capacity_bytes: u64) -> Self {
        Self { capacity_bytes, ..self }
    }

    /// Returns a block, decoded now or cached. The least recently used blocks are dropped, by number and by bytes.
    pub(crate) fn get(&mut self, file: &LogFile, blocks: &[Block], number: usize) -> Option<Arc<DecodedBlock>> {
        if let Some(found) = self.entries.iter().position(|(cached, _)| *cached == number) {
            let entry = self.entries.remove(found);
            let block = Arc::clone(&entry.1);
            self.entries.push(entry);
            return Some(block);
        }
        let budget = LogLimits::cache_bytes(file.len() as u64);
        let held = |entries: &[(usize, Arc<DecodedBlock>)]| -> u64 {
            entries.iter().map(|(_, block)| block.records.len() as u64).sum()
        };
        let is_full = |entries: &[(usize, Arc<DecodedBlock>)]| {
            let bytes = held(entries);
            entries.len() == self.capacity || bytes > budget || (entries.len() > 1 && bytes > self.capacity_bytes)
        };
        while !self.entries.is_empty() && is_full(&self.entries) {
            self.entries.remove(0);
        }
        let decoded = Arc::new(DecodedBlock::decode(file, blocks.get(number)?));
        self.entries.push((number, Arc::clone(&decoded)));
        Some(decoded)
    }
}

/// Parses a chunk's schema or channel record as an MCAP record.
pub(crate) fn parse_definition(opcode: u8, body: &[u8]) -> Option<Record<'_>> {
    mcap::parse_record(opcode, body).ok()
}
