//! Reader of ROS 1 bags, format 2.0, from the first chunk to the last without their index, so that an unindexed or
//! truncated bag is converted as well.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{self, Read};
use std::path::Path;

use super::ConvertError;
use super::ros1_record::{BagRecord, record_at, record_in_file, text_field};
use super::sink::{LogSink, Payload, SourceMessage};
use crate::files::LogLimits;
use crate::flight_log::container::file::LogFile;

/// First bytes of a bag of version 2.0.
pub(super) const MAGIC: &[u8] = b"#ROSBAG V2.0\n";

/// Opcodes of the supported records.
mod op {
    pub(super) const MESSAGE: u8 = 0x02;
    pub(super) const BAG_HEADER: u8 = 0x03;
    pub(super) const INDEX: u8 = 0x04;
    pub(super) const CHUNK: u8 = 0x05;
    pub(super) const CHUNK_INFO: u8 = 0x06;
    pub(super) const CONNECTION: u8 = 0x07;
}

/// Topic of one publisher.
#[derive(Clone, Debug)]
struct Connection {
    topic: String,
    message_type: String,
}

type Connections = BTreeMap<u32, Connection>;

/// Number of a chunk's messages by connection, from the index at the end of a bag.
type ChunkContents = BTreeMap<u32, u64>;

/// Connections, chunks and counts of a bag.
#[derive(Debug, Default)]
struct BagState {
    connections: Connections,
    /// Chunks in the index at the end of the bag, by their first byte.
    chunks: BTreeMap<usize, ChunkContents>,
    /// Number of messages without a described connection.
    orphans: u64,
    /// Number of messages read from the present chunk, by connection.
    read: ChunkContents,
}

pub(super) fn open(path: &Path, sink: &LogSink<'_>) -> Result<LogFile, ConvertError> {
    let bag = LogFile::open(path, sink.limits())?;
    if let Ok(record) = record_in_file(&bag, MAGIC.len())
        && let Ok(record) = record.record()
        && let Some(encryptor) = record.text("encryptor").filter(|name| !name.is_empty())
    {
        let problem = format!("the bag is encrypted ({encryptor:?}); decrypt it first, with 'rosbag decrypt'");
        return Err(ConvertError::unreadable(problem, path));
    }
    Ok(bag)
}

/// Converts a bag into a log. After a damaged record, reading continues with the next chunk of the bag's index.
pub(super) fn convert(bag: &LogFile, sink: &mut LogSink<'_>) -> Result<(), ConvertError> {
    let mut state = BagState::default();
    let mut at = MAGIC.len();
    while at < bag.len() {
        let (owned, problem) = match record_in_file(bag, at) {
            Ok(owned) => (Some(owned), None),
            Err(problem) => (None, Some(problem)),
        };
        let record = owned.as_ref().and_then(|owned| Some((owned.record().ok()?, owned.end)));
        let Some((record, mut end)) = record else {
            let problem = problem.unwrap_or_default();
            sink.note(format!("the bag is damaged at byte {at} of {}: {problem}", bag.len()));
            state.read = ChunkContents::new();
            state.report_lost(at, sink);
            let Some((next, _)) = state.chunks.range(at + 1..).next() else {
                sink.note(match sink.count() {
                    0 => "no message before the damage could be read".to_owned(),
                    count => format!("reading ends there: {count} messages before the damage are in the log"),
                });
                break;
            };
            at = *next;
            continue;
        };
        match record.opcode() {
            Some(op::BAG_HEADER) => read_bag_header(bag, &record, &mut state, sink),
            Some(op::CONNECTION) => read_connection(&record, &mut state.connections, sink),
            Some(op::MESSAGE) => take_message(&record, &mut state, sink)?,
            Some(op::CHUNK) => {
                state.read = ChunkContents::new();
                let problem = match decompress(&record, sink.limits()) {
                    Ok(chunk) => take_chunk(&chunk, &mut state, sink)?,
                    Err(problem) => Some(problem),
                };
                if let Some(problem) = problem {
                    sink.note(format!("the chunk at byte {at} is damaged: {problem}"));
                    state.report_lost(at, sink);
                    // The length of the chunk may be damaged, too.
                    end = state.chunks.range(at + 1..end).next().map_or(end, |(next, _)| *next);
                }
            }
            Some(op::INDEX | op::CHUNK_INFO) | None => {}
            Some(other) => {
                sink.note(format!("the record at byte {at} has the unknown kind {other:#04x} and is left out"));
            }
        }
        at = end;
        sink.progress(at as f64 / bag.len() as f64);
    }
    if state.orphans > 0 {
        let orphans = state.orphans;
        sink.note(format!("{orphans} messages belong to no connection that the bag describes, and are left out"));
    }
    Ok(())
}

impl BagState {
    /// Counts the messages of the chunk at a byte that were not read, as far as the bag's index lists them.
    fn report_lost(&self, at: usize, sink: &mut LogSink<'_>) {
        let Some(promised) = self.chunks.get(&at) else {
            if !self.chunks.is_empty() {
                return; // no chunk starts there
            }
            return sink.note(format!("how many messages are lost at byte {at} is unknown: the bag has no index"));
        };
        let mut lost = 0_u64;
        for (id, promised) in promised {
            let count = promised.saturating_sub(self.read.get(id).copied().unwrap_or(0));
            lost = lost.saturating_add(count);
            if let Some(connection) = self.connections.get(id).filter(|_| count > 0) {
                sink.leave(&connection.topic, &connection.message_type, count, "in a damaged chunk");
            }
        }
        sink.note(format!("{lost} messages of the chunk at byte {at} are lost"));
    }
}

/// Stores the connections and chunks of the bag's index, if it has one.
fn read_bag_header(bag: &LogFile, record: &BagRecord<'_>, state: &mut BagState, sink: &mut LogSink<'_>) {
    let mut at = record.large_number("index_pos").and_then(|at| usize::try_from(at).ok()).unwrap_or(0);
    if at == 0 {
        return sink
            .note("the bag has no index (its recording was not closed properly); it was read from start to end");
    }
    while let Ok(owned) = record_in_file(bag, at) {
        let Ok(record) = owned.record() else { return };
        match record.opcode() {
            Some(op::CONNECTION) => read_connection(&record, &mut state.connections, sink),
            Some(op::CHUNK_INFO) => {
                let position = record.large_number("chunk_pos").and_then(|position| usize::try_from(position).ok());
                // Connection and number of its messages, 4 bytes each.
                let pairs = record.data.chunks_exact(8).map(|pair| {
                    let number = |at: usize| u32::from_le_bytes([pair[at], pair[at + 1], pair[at + 2], pair[at + 3]]);
                    (number(0), u64::from(number(4)))
                });
                if let Some(position) = position {
                    state.chunks.insert(position, pairs.collect());
                }
            }
            _ => {}
        }
        at = owned.end;
    }
}

fn read_connection(record: &BagRecord<'_>, connections: &mut Connections, sink: &mut LogSink<'_>) {
    let (Some(id), Some(topic), Some(message_type)) =
        (record.number("conn"), record.text("topic"), text_field(record.data, "type"))
    else {
        sink.note("a connection without number, topic or type is left out");
        return;
    };
    sink.announce(topic, message_type);
    connections.insert(id, Connection { topic: topic.to_owned(), message_type: message_type.to_owned() });
}

/// Converts the messages of a chunk; returns its damage.
fn take_chunk(chunk: &[u8], state: &mut BagState, sink: &mut LogSink<'_>) -> Result<Option<String>, ConvertError> {
    let mut at = 0;
    while at < chunk.len() {
        let record = match record_at(chunk, at) {
            Ok(record) => record,
            Err(problem) => return Ok(Some(format!("byte {at} of it: {problem}"))),
        };
        match record.opcode() {
            Some(op::CONNECTION) => read_connection(&record, &mut state.connections, sink),
            Some(op::MESSAGE) => take_message(&record, state, sink)?,
            _ => {}
        }
        at = record.end;
    }
    Ok(None)
}

fn take_message(record: &BagRecord<'_>, state: &mut BagState, sink: &mut LogSink<'_>) -> Result<(), ConvertError> {
    let id = record.number("conn");
    if let Some(id) = id {
        *state.read.entry(id).or_default() += 1;
    }
    let connection = id.and_then(|id| state.connections.get(&id));
    let (Some(connection), Some(log_time_ns)) = (connection, record.time_ns("time")) else {
        state.orphans += 1;
        return Ok(());
    };
    sink.take(&SourceMessage {
        topic: &connection.topic,
        message_type: &connection.message_type,
        definition: None,
        log_time_ns,
        payload: Payload::Ros1(record.data),
    })
}

fn decompress<'a>(record: &BagRecord<'a>, limits: &LogLimits) -> Result<Cow<'a, [u8]>, String> {
    let size = record.number("size").ok_or_else(|| "its size is missing".to_owned())?;
    let check =
        || limits.check_record("a chunk", u64::from(size), record.data.len() as u64).map_err(|error| error.to_string());
    match record.text("compression") {
        Some("none") => Ok(record.data.into()),
        Some("bz2") => {
            check()?;
            read_all(bzip2::read::MultiBzDecoder::new(record.data), size).map(Into::into)
        }
        Some("lz4") => {
            check()?;
            let decoder = lz4::Decoder::new(record.data).map_err(|error| error.to_string())?;
            read_all(decoder, size).map(Into::into)
        }
        other => Err(format!("compressed with {:?}, expected none, bz2 or lz4", other.unwrap_or("nothing readable"))),
    }
}

/// Decompressed bytes; an error unless they have the expected size.
fn read_all(decoder: impl Read, size: u32) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(size as usize).map_err(|error| format!("{size} bytes do not fit into memory: {error}"))?;
    let limit = u64::from(size) + 1;
    let read: io::Result<usize> = decoder.take(limit).read_to_end(&mut bytes);
    read.map_err(|error| format!("it cannot be decompressed: {error}"))?;
    if bytes.len() != size as usize {
        return Err(format!("it decompresses to {} bytes, expected {size}", bytes.len()));
    }
    Ok(bytes)
}
