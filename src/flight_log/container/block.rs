use std::ops::Range;
use std::sync::Arc;

use mcap::records::{ChunkHeader, Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::super::file::LogFile;
use super::{RECORD_HEADER, record_at};

/// A range of the file with messages: one chunk record, or message records outside of chunks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Block {
    /// Its bytes in the file; the end lies beyond the file's when the log was cut inside it.
    pub(crate) bytes: Range<usize>,
    /// Whether it is a chunk record.
    pub(crate) is_chunk: bool,
    /// Smallest and largest log time of its messages.
    pub(crate) log_time_ns: (u64, u64),
}

/// One message in a decoded block.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct MessageSpan {
    pub(crate) channel_id: u16,
    pub(crate) log_time_ns: u64,
    /// Start of its record in the block's records.
    pub(crate) offset: usize,
    /// Range of its data in the block's records.
    pub(crate) data: Range<usize>,
}

/// The records of a block, decompressed and checked.
#[derive(Debug)]
pub(crate) struct DecodedBlock {
    records: BlockBytes,
    /// In the order of the file.
    pub(crate) messages: Vec<MessageSpan>,
    /// Schema and channel records, as opcode and body.
    pub(crate) definitions: Vec<(u8, Range<usize>)>,
    /// Damage of the block; its readable messages, if any, are those before it.
    pub(crate) damage: Option<String>,
}

#[derive(Debug)]
enum BlockBytes {
    /// Uncompressed, in the file.
    Mapped(Range<usize>),
    /// Decompressed.
    Owned(Vec<u8>),
}

impl DecodedBlock {
    /// Decodes one block of a file. A chunk whose checksum fails has no message; one truncated by the file's end has
    /// those before the end.
    pub(crate) fn decode(file: &[u8], block: &Block) -> Self {
        if !block.is_chunk {
            let bytes = block.bytes.start..block.bytes.end.min(file.len());
            return Self::from_records(file, BlockBytes::Mapped(bytes), None);
        }
        match unpack_chunk(file, block) {
            Ok((records, damage)) => Self::from_records(file, records, damage),
            Err(damage) => Self {
                records: BlockBytes::Mapped(0..0),
                messages: Vec::new(),
                definitions: Vec::new(),
                damage: Some(damage),
            },
        }
    }

    fn from_records(file: &[u8], records: BlockBytes, mut damage: Option<String>) -> Self {
        let bytes = records.of(file);
        let mut messages = Vec::new();
        let mut definitions = Vec::new();
        let mut offset = 0;
        while offset < bytes.len() {
            let record = match record_at(bytes, offset) {
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

    /// The bytes at a range of a [`MessageSpan`] or a definition.
    pub(crate) fn bytes<'a>(&'a self, file: &'a [u8], range: &Range<usize>) -> &'a [u8] {
        &self.records.of(file)[range.clone()]
    }

    /// The message whose record starts at an offset of the message index.
    pub(crate) fn message_at(&self, offset: u64) -> Option<&MessageSpan> {
        let index = self.messages.binary_search_by_key(&offset, |message| message.offset as u64).ok()?;
        self.messages.get(index)
    }
}

impl BlockBytes {
    fn of<'a>(&'a self, file: &'a [u8]) -> &'a [u8] {
        match self {
            Self::Mapped(range) => &file[range.clone()],
            Self::Owned(bytes) => bytes,
        }
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

/// The header of the chunk record at a block, with the range of its data in the file (cut at the file's end).
pub(crate) fn chunk_header(file: &[u8], block: &Block) -> Result<(ChunkHeader, Range<usize>), String> {
    let body_start = block.bytes.start + RECORD_HEADER;
    let body = file.get(body_start..block.bytes.end.min(file.len())).ok_or("the file ends inside a chunk's header")?;
    if file[block.bytes.start] != op::CHUNK {
        return Err(format!("opcode {:#04x} where the index promises a chunk", file[block.bytes.start]));
    }
    // start, end, size (8 bytes each), checksum (4), then the compression's name and the compressed size (8).
    const NAME_AT: usize = 28;
    let name_length = body.get(NAME_AT..NAME_AT + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    let header_length = name_length.filter(|length| *length < 64).map(|length| NAME_AT + 4 + length + 8);
    let header = header_length.and_then(|length| body.get(..length)).ok_or("a damaged chunk header")?;
    // An empty chunk's record with this header is a chunk header that `parse_record` accepts only with its data, so the
    // fields are read one by one.
    let number = |at: usize| {
        let mut bytes = [0; 8];
        bytes.copy_from_slice(&header[at..at + 8]);
        u64::from_le_bytes(bytes)
    };
    let compression = std::str::from_utf8(&header[NAME_AT + 4..header.len() - 8])
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

/// Decompresses a chunk and checks it: its records, and the damage when it is truncated.
fn unpack_chunk(file: &[u8], block: &Block) -> Result<(BlockBytes, Option<String>), String> {
    let (header, data) = chunk_header(file, block)?;
    let cut = (data.len() as u64) < header.compressed_size;
    let records = if header.compression.is_empty() {
        BlockBytes::Mapped(data.clone())
    } else {
        let (records, problem) = decompress(file, &header, &data);
        if let Some(problem) = problem.filter(|_| !cut) {
            return Err(format!("the chunk cannot be decompressed ({problem})"));
        }
        BlockBytes::Owned(records)
    };
    if cut {
        return Ok((records, Some("the file ends inside this chunk".into())));
    }
    let bytes = records.of(file);
    if bytes.len() as u64 != header.uncompressed_size {
        return Err(format!("the chunk holds {} bytes instead of {}", bytes.len(), header.uncompressed_size));
    }
    let checksum = crc32fast::hash(bytes);
    if header.uncompressed_crc != 0 && checksum != header.uncompressed_crc {
        return Err(format!("checksum {checksum:08x} instead of {:08x}", header.uncompressed_crc));
    }
    Ok((records, None))
}

/// Decompresses as far as possible; the second value is the error that ended it.
fn decompress(file: &[u8], header: &ChunkHeader, data: &Range<usize>) -> (Vec<u8>, Option<String>) {
    let mut reader = LinearReader::new_with_options(
        LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_skip_end_magic(true)
            .with_record_length_limit(usize::try_from(header.uncompressed_size).unwrap_or(usize::MAX)),
    );
    let name = header.compression.as_bytes();
    let body_length = 8 + 8 + 8 + 4 + 4 + name.len() as u64 + 8 + header.compressed_size;
    let mut input = Vec::with_capacity(64 + data.len());
    input.push(op::CHUNK);
    input.extend_from_slice(&body_length.to_le_bytes());
    input.extend_from_slice(&header.message_start_time.to_le_bytes());
    input.extend_from_slice(&header.message_end_time.to_le_bytes());
    input.extend_from_slice(&header.uncompressed_size.to_le_bytes());
    input.extend_from_slice(&header.uncompressed_crc.to_le_bytes());
    input.extend_from_slice(&(name.len() as u32).to_le_bytes());
    input.extend_from_slice(name);
    input.extend_from_slice(&header.compressed_size.to_le_bytes());
    let prefix = input;
    let compressed = &file[data.clone()];
    let total = prefix.len() + compressed.len();

    // Sizes in the header may be damaged: the capacity is limited by a usual compression ratio.
    let expected = usize::try_from(header.uncompressed_size).unwrap_or(usize::MAX);
    let mut records = Vec::with_capacity(expected.min(compressed.len().saturating_mul(8)));
    let mut fed = 0;
    while let Some(event) = reader.next_event() {
        match event {
            Ok(LinearReadEvent::ReadRequest(wanted)) => {
                let count = wanted.min(total - fed);
                let target = reader.insert(count);
                for_each_part(&prefix, compressed, fed, count, |at, part| {
                    target[at..at + part.len()].copy_from_slice(part);
                });
                reader.notify_read(count);
                fed += count;
            }
            Ok(LinearReadEvent::Record { data, opcode }) => {
                records.push(opcode);
                records.extend_from_slice(&(data.len() as u64).to_le_bytes());
                records.extend_from_slice(data);
            }
            Err(error) => return (records, Some(error.to_string())),
        }
    }
    (records, None)
}

/// Calls `copy(at, bytes)` for the sections of `first ++ second` between `start` and `start + count`.
fn for_each_part(first: &[u8], second: &[u8], start: usize, count: usize, mut copy: impl FnMut(usize, &[u8])) {
    let end = start + count;
    if start < first.len() {
        copy(0, &first[start..end.min(first.len())]);
    }
    if end > first.len() {
        let from = start.max(first.len());
        copy(from - start, &second[from - first.len()..end - first.len()]);
    }
}

/// A cache of the blocks decoded last.
#[derive(Debug)]
pub(crate) struct BlockCache {
    /// The most recently used block is the last.
    entries: Vec<(usize, Arc<DecodedBlock>)>,
    capacity: usize,
}

impl BlockCache {
    /// A cache of `capacity` blocks.
    pub(crate) fn new(capacity: usize) -> Self {
        Self { entries: Vec::with_capacity(capacity + 1), capacity }
    }

    /// The block with a number, from the cache or decoded. The file's pages of an evicted block are released.
    pub(crate) fn get(&mut self, file: &LogFile, blocks: &[Block], number: usize) -> Option<Arc<DecodedBlock>> {
        if let Some(found) = self.entries.iter().position(|(cached, _)| *cached == number) {
            let entry = self.entries.remove(found);
            let block = Arc::clone(&entry.1);
            self.entries.push(entry);
            return Some(block);
        }
        let decoded = Arc::new(DecodedBlock::decode(file, blocks.get(number)?));
        if self.entries.len() == self.capacity {
            let (oldest, _) = self.entries.remove(0);
            if let Some(block) = blocks.get(oldest) {
                file.release(&block.bytes);
            }
        }
        self.entries.push((number, Arc::clone(&decoded)));
        Some(decoded)
    }
}

/// Reads a chunk's schema and channel records by parsing them as MCAP records.
pub(crate) fn parse_definition(opcode: u8, body: &[u8]) -> Option<Record<'_>> {
    mcap::parse_record(opcode, body).ok()
}
