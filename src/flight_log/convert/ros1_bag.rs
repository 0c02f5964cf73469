//! ROS 1 bags, format 2.0, read from the first chunk to the last without their index, so that an unindexed or truncated
//! bag is converted as well.

use std::collections::BTreeMap;
use std::io::{self, Read};
use std::path::Path;

use super::super::file::LogFile;
use super::ConvertError;
use super::ros1_record::{BagRecord, record_at, text_field};
use super::sink::{Payload, Sink, SourceMessage};

/// First bytes of a bag of version 2.0.
pub(super) const MAGIC: &[u8] = b"#ROSBAG V2.0\n";
/// Initial capacity for a decompressed chunk, in bytes.
const CHUNK_CAPACITY: u32 = 64 << 20;

/// Opcodes of the records that are read.
mod op {
    pub(super) const MESSAGE: u8 = 0x02;
    pub(super) const BAG_HEADER: u8 = 0x03;
    pub(super) const INDEX: u8 = 0x04;
    pub(super) const CHUNK: u8 = 0x05;
    pub(super) const CHUNK_INFO: u8 = 0x06;
    pub(super) const CONNECTION: u8 = 0x07;
}

/// A topic of one publisher.
#[derive(Clone, Debug)]
struct Connection {
    topic: String,
    message_type: String,
}

type Connections = BTreeMap<u32, Connection>;

/// Converts a bag into a log.
pub(super) fn convert(path: &Path, sink: &mut Sink<'_>) -> Result<(), ConvertError> {
    let bag = LogFile::open(path)?;
    let mut connections = Connections::new();
    let mut at = MAGIC.len();
    let mut orphans = 0_u64;
    while at < bag.len() {
        let record = match record_at(&bag, at) {
            Ok(record) => record,
            Err(problem) => {
                sink.note(format!(
                    "the bag is damaged at byte {at} of {}: {problem}; everything before is in the log",
                    bag.len()
                ));
                break;
            }
        };
        match record.opcode() {
            Some(op::BAG_HEADER) => read_bag_header(&bag, path, &record, &mut connections, sink)?,
            Some(op::CONNECTION) => read_connection(&record, &mut connections, sink),
            Some(op::MESSAGE) => take_message(&record, &connections, sink, &mut orphans)?,
            Some(op::CHUNK) => match decompress(&record) {
                Ok(chunk) => {
                    if let Err(problem) = take_chunk(&chunk, &mut connections, sink, &mut orphans)? {
                        sink.note(format!("the chunk at byte {at} is damaged: {problem}; the rest of it is left out"));
                    }
                }
                Err(problem) => sink.note(format!("the chunk at byte {at} is left out: {problem}")),
            },
            Some(op::INDEX | op::CHUNK_INFO) | None => {}
            Some(other) => {
                sink.note(format!("the record at byte {at} has the unknown kind {other:#04x} and is left out"));
            }
        }
        bag.release(&(at..record.end));
        at = record.end;
        sink.progress(at as f64 / bag.len() as f64);
    }
    if orphans > 0 {
        sink.note(format!("{orphans} messages belong to no connection that the bag describes, and are left out"));
    }
    Ok(())
}

/// Reads the connections of the bag's index, if it has one.
fn read_bag_header(
    bag: &[u8],
    path: &Path,
    record: &BagRecord<'_>,
    connections: &mut Connections,
    sink: &mut Sink<'_>,
) -> Result<(), ConvertError> {
    if let Some(encryptor) = record.text("encryptor").filter(|name| !name.is_empty()) {
        let problem = format!("the bag is encrypted ('{encryptor}'); decrypt it first, with 'rosbag decrypt'");
        return Err(ConvertError::unreadable(problem, path));
    }
    let mut at = record.large_number("index_pos").and_then(|at| usize::try_from(at).ok()).unwrap_or(0);
    if at == 0 {
        sink.note("the bag has no index (its recording was not closed properly); it was read from start to end");
        return Ok(());
    }
    while let Ok(record) = record_at(bag, at) {
        if record.opcode() == Some(op::CONNECTION) {
            read_connection(&record, connections, sink);
        }
        at = record.end;
    }
    Ok(())
}

fn read_connection(record: &BagRecord<'_>, connections: &mut Connections, sink: &mut Sink<'_>) {
    let (Some(id), Some(topic), Some(message_type)) =
        (record.number("conn"), record.text("topic"), text_field(record.data, "type"))
    else {
        sink.note("a connection without number, topic or type is left out");
        return;
    };
    sink.announce(topic, message_type);
    connections.insert(id, Connection { topic: topic.to_owned(), message_type: message_type.to_owned() });
}

/// Reads the messages of a chunk; the inner error is its damage.
fn take_chunk(
    chunk: &[u8],
    connections: &mut Connections,
    sink: &mut Sink<'_>,
    orphans: &mut u64,
) -> Result<Result<(), String>, ConvertError> {
    let mut at = 0;
    while at < chunk.len() {
        let record = match record_at(chunk, at) {
            Ok(record) => record,
            Err(problem) => return Ok(Err(format!("byte {at} of it: {problem}"))),
        };
        match record.opcode() {
            Some(op::CONNECTION) => read_connection(&record, connections, sink),
            Some(op::MESSAGE) => take_message(&record, connections, sink, orphans)?,
            _ => {}
        }
        at = record.end;
    }
    Ok(Ok(()))
}

fn take_message(
    record: &BagRecord<'_>,
    connections: &Connections,
    sink: &mut Sink<'_>,
    orphans: &mut u64,
) -> Result<(), ConvertError> {
    let connection = record.number("conn").and_then(|id| connections.get(&id));
    let (Some(connection), Some(log_time_ns)) = (connection, record.time_ns("time")) else {
        *orphans += 1;
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

/// The records of a chunk.
fn decompress<'a>(record: &BagRecord<'a>) -> Result<std::borrow::Cow<'a, [u8]>, String> {
    let size = record.number("size").ok_or_else(|| "its size is missing".to_owned())?;
    match record.text("compression") {
        Some("none") => Ok(record.data.into()),
        Some("bz2") => read_all(bzip2::read::MultiBzDecoder::new(record.data), size).map(Into::into),
        Some("lz4") => {
            let decoder = lz4::Decoder::new(record.data).map_err(|error| error.to_string())?;
            read_all(decoder, size).map(Into::into)
        }
        other => Err(format!("compressed with '{}', expected none, bz2 or lz4", other.unwrap_or("nothing readable"))),
    }
}

/// The decompressed bytes, when they have the expected size.
fn read_all(decoder: impl Read, size: u32) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::with_capacity(size.min(CHUNK_CAPACITY) as usize);
    let limit = u64::from(size) + 1;
    let read: io::Result<usize> = decoder.take(limit).read_to_end(&mut bytes);
    read.map_err(|error| format!("it cannot be decompressed: {error}"))?;
    if bytes.len() != size as usize {
        return Err(format!("it decompresses to {} bytes, expected {size}", bytes.len()));
    }
    Ok(bytes)
}
