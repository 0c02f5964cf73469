//! The SQLite files of ROS 2 bags.

use std::collections::BTreeMap;
use std::io::Read as _;
use std::path::Path;

use rusqlite::{Connection, OpenFlags};

use super::ConvertError;
use super::sink::{Payload, Sink, SourceMessage};

/// Compression of single messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BlobCompression {
    /// Uncompressed.
    None,
    /// Zstandard.
    Zstd,
}

/// Largest decompressed message; a larger one is damaged.
const MAX_MESSAGE_BYTES: u64 = 1 << 30;

#[derive(Debug)]
struct Topic {
    name: String,
    message_type: String,
    encoding: String,
    definition: Option<String>,
}

/// Converts one file into a log, in the order of log times.
pub(super) fn convert(path: &Path, compression: BlobCompression, sink: &mut Sink<'_>) -> Result<(), ConvertError> {
    let failed = |error: rusqlite::Error| ConvertError::unreadable(format!("not a readable ROS 2 bag: {error}"), path);
    let database = Connection::open_with_flags(path, OpenFlags::SQLITE_OPEN_READ_ONLY).map_err(failed)?;
    let topics = read_topics(&database).map_err(failed)?;
    for topic in topics.values() {
        sink.announce(&topic.name, &topic.message_type);
    }
    let total: i64 = database.query_row("SELECT COUNT(*) FROM messages", [], |row| row.get(0)).map_err(failed)?;
    let mut query =
        database.prepare("SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp, id").map_err(failed)?;
    let mut rows = query.query([]).map_err(failed)?;
    let mut done = 0_i64;
    loop {
        let row = match rows.next() {
            Ok(Some(row)) => row,
            Ok(None) => break,
            Err(error) => {
                sink.note(format!(
                    "{} is damaged after {done} of {total} messages: {error}; everything before is in the log",
                    path.display()
                ));
                break;
            }
        };
        done += 1;
        let topic_id: i64 = row.get(0).map_err(failed)?;
        let log_time_ns: i64 = row.get(1).map_err(failed)?;
        let data = row.get_ref(2).map_err(failed)?.as_bytes().unwrap_or_default();
        let Some(topic) = topics.get(&topic_id) else {
            sink.leave(&format!("topic number {topic_id}"), "unknown", 1, "the bag does not describe it");
            continue;
        };
        let unpacked;
        let data = match compression {
            BlobCompression::None => data,
            BlobCompression::Zstd => match unpack(data) {
                Ok(bytes) => {
                    unpacked = bytes;
                    &unpacked
                }
                Err(problem) => {
                    sink.leave(&topic.name, &topic.message_type, 1, problem);
                    continue;
                }
            },
        };
        let payload = if topic.encoding == "cdr" { Payload::Cdr(data) } else { Payload::Other(&topic.encoding) };
        sink.take(&SourceMessage {
            topic: &topic.name,
            message_type: &topic.message_type,
            definition: topic.definition.as_deref(),
            log_time_ns,
            payload,
        })?;
        sink.progress(done as f64 / total.max(1) as f64);
    }
    Ok(())
}

fn unpack(data: &[u8]) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    let decoder = zstd::Decoder::with_buffer(data).map_err(|error| error.to_string())?;
    let read = decoder.take(MAX_MESSAGE_BYTES).read_to_end(&mut bytes);
    read.map(|_| bytes).map_err(|error| format!("a message cannot be decompressed: {error}"))
}

/// The topics by number, with their definitions where the recorder wrote them (ROS 2 Iron and later).
fn read_topics(database: &Connection) -> Result<BTreeMap<i64, Topic>, rusqlite::Error> {
    let definitions = read_definitions(database).unwrap_or_default();
    let mut query = database.prepare("SELECT id, name, type, serialization_format FROM topics ORDER BY id")?;
    let rows = query.query_map([], |row| {
        let message_type: String = row.get(2)?;
        let definition = definitions.get(&message_type).cloned();
        Ok((row.get(0)?, Topic { name: row.get(1)?, message_type, encoding: row.get(3)?, definition }))
    })?;
    rows.collect()
}

/// The definitions in `ros2msg` by type; older bags have no such table.
fn read_definitions(database: &Connection) -> Result<BTreeMap<String, String>, rusqlite::Error> {
    let mut query = database
        .prepare("SELECT topic_type, encoded_message_definition FROM message_definitions WHERE encoding = 'ros2msg'")?;
    let rows = query.query_map([], |row| Ok((row.get(0)?, row.get(1)?)))?;
    rows.filter(|row| !matches!(row, Ok((_, text)) if String::is_empty(text))).collect()
}
