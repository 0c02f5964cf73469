//! SQLite files of ROS 2 bags.
//!
//! A database can contain code: only plain tables are read, values are limited, and a query that takes longer than its
//! rows explain is interrupted.

use std::collections::BTreeMap;
use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use rusqlite::limits::Limit;
use rusqlite::types::ValueRef;
use rusqlite::{Connection, OpenFlags, Row};

use super::ConvertError;
use super::sink::{LogSink, Payload, SourceMessage};
use crate::files::{LimitExceeded, LimitKind, LogLimits};
use crate::flight_log::container::file::kind_of;

/// Steps of SQLite's virtual machine between two checks of the number of steps.
const STEPS_PER_LOOK: i32 = 100_000;
/// Largest number of steps to read and sort one message.
const STEPS_PER_MESSAGE: u64 = 200;
/// Largest number of consecutive unreadable rows in the search for the next readable one.
const LARGEST_HOLE: i64 = 1 << 32;
/// Largest number of damaged places in a database.
const MOST_HOLES: u32 = 10_000;

/// Row of the report for damaged rows of the database.
const DAMAGED_ROWS: &str = "(damaged rows)";

#[derive(Debug)]
struct Topic {
    name: String,
    message_type: String,
    encoding: String,
    definition: Option<String>,
}

pub(super) struct BagDatabase {
    connection: Connection,
    path: PathBuf,
    topics: BTreeMap<i64, Topic>,
    /// Size of the file, and the size in its header if that is larger.
    bytes: u64,
    promised_bytes: Option<u64>,
    most_messages: u64,
}

/// Progress of reading a database's messages.
#[derive(Debug, Default)]
struct ReadState {
    /// Number of rows read.
    rows: u64,
    /// Log time and row of the last message in the order of log times.
    last: Option<(i64, i64)>,
    /// Largest row number, for the progress.
    last_row: i64,
    problem: Option<String>,
}

pub(super) fn open(path: &Path, limits: &LogLimits) -> Result<BagDatabase, ConvertError> {
    let failed = |error: rusqlite::Error| ConvertError::unreadable(format!("not a readable ROS 2 bag: {error}"), path);
    let metadata = fs::metadata(path).map_err(ConvertError::io("open the bag", path))?;
    if !metadata.is_file() {
        let problem = format!("{} where the bag should be", kind_of(&metadata));
        return Err(ConvertError::unreadable(problem, path));
    }
    let bytes = metadata.len();
    let promised_bytes = promised_bytes(path).filter(|promised| *promised > bytes);
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let mut connection = Connection::open_with_flags(path, flags).map_err(failed)?;
    let most_messages = limits.messages(bytes);
    guard(&mut connection, limits.record_bytes(bytes), most_messages, promised_bytes.is_some()).map_err(failed)?;
    for table in ["topics", "messages"] {
        require_table(&connection, table, path)?;
    }
    // Older bags have no definitions.
    let definitions = match require_table(&connection, "message_definitions", path) {
        Ok(()) => read_definitions(&connection).unwrap_or_default(),
        Err(_) => BTreeMap::new(),
    };
    let topics = read_topics(&connection, &definitions, limits.topics()).map_err(failed)?;
    connection.prepare(ORDERED).map_err(failed)?;
    Ok(BagDatabase { connection, path: path.to_owned(), topics, bytes, promised_bytes, most_messages })
}

/// Size in the header of a database, `None` if it is not valid.
fn promised_bytes(path: &Path) -> Option<u64> {
    // Size of a page (2 bytes at 16; 1 stands for 65536), change counter (4 at 24), number of pages (4 at 28), and the
    // change counter for which that number is valid (4 at 92).
    let mut header = [0; 100];
    fs::File::open(path).and_then(|mut file| file.read_exact(&mut header)).ok()?;
    let number = |at: usize| u32::from_be_bytes([header[at], header[at + 1], header[at + 2], header[at + 3]]);
    let page_bytes = match u16::from_be_bytes([header[16], header[17]]) {
        1 => 65_536,
        other => u64::from(other),
    };
    (number(24) == number(92)).then(|| page_bytes * u64::from(number(28)))
}

/// Limits the work that a hostile database can cause in SQLite, and allows opening a truncated one.
fn guard(
    connection: &mut Connection,
    record_bytes: u64,
    most_messages: u64,
    truncated: bool,
) -> Result<(), rusqlite::Error> {
    let value_bytes = i32::try_from(record_bytes).unwrap_or(i32::MAX);
    connection.set_limit(Limit::SQLITE_LIMIT_LENGTH, value_bytes)?;
    connection.set_limit(Limit::SQLITE_LIMIT_ATTACHED, 0)?;
    connection.execute_batch("PRAGMA trusted_schema = OFF; PRAGMA cell_size_check = ON;")?;
    if truncated {
        // SQLite opens a file that is shorter than its header declares only with this.
        connection.execute_batch("PRAGMA writable_schema = ON;")?;
    }
    let most_looks = most_messages.saturating_mul(STEPS_PER_MESSAGE) / STEPS_PER_LOOK as u64 + 1000;
    let mut looks = 0_u64;
    connection.progress_handler(
        STEPS_PER_LOOK,
        Some(move || {
            looks += 1;
            looks > most_looks
        }),
    )
}

/// Rejects views, virtual tables and computed columns, because reading them runs code of the database.
fn require_table(connection: &Connection, table: &str, path: &Path) -> Result<(), ConvertError> {
    let failed = |error: rusqlite::Error| ConvertError::unreadable(format!("not a readable ROS 2 bag: {error}"), path);
    let mut query =
        connection.prepare("SELECT type, sql FROM sqlite_master WHERE name = ?1 COLLATE NOCASE").map_err(failed)?;
    let rows =
        query.query_map([table], |row| Ok((row.get::<_, String>(0)?, row.get::<_, String>(1)?))).map_err(failed)?;
    let entries: Vec<(String, String)> = rows.collect::<Result<_, _>>().map_err(failed)?;
    let plain =
        |sql: &str| sql.get(.."CREATE TABLE".len()).is_some_and(|start| start.eq_ignore_ascii_case("CREATE TABLE"));
    let refused = |what: &str| {
        let problem = format!("not a ROS 2 bag: '{table}' is {what}, and only plain tables are read");
        Err(ConvertError::unreadable(problem, path))
    };
    match entries.as_slice() {
        [] => Err(ConvertError::unreadable(format!("not a ROS 2 bag: it has no table '{table}'"), path)),
        [(kind, sql)] if kind == "table" && plain(sql) => {
            let computed = "SELECT COUNT(*) FROM pragma_table_xinfo(?1) WHERE hidden > 0";
            let computed: i64 = connection.query_row(computed, [table], |row| row.get(0)).map_err(failed)?;
            if computed > 0 { refused("a table with computed columns") } else { Ok(()) }
        }
        [(kind, _)] if kind == "view" => refused("a view"),
        _ => refused("no plain table"),
    }
}

const ORDERED: &str = "SELECT topic_id, timestamp, data, rowid FROM messages ORDER BY timestamp, rowid";
const FROM_ROW: &str = "SELECT topic_id, timestamp, data, rowid FROM messages WHERE rowid >= ?1 ORDER BY rowid";

/// Converts a file into a log, in the order of log times. Where the database is damaged, the readable rows are
/// converted in the order of their numbers.
pub(super) fn convert(bag: &BagDatabase, sink: &mut LogSink<'_>) -> Result<(), ConvertError> {
    for topic in bag.topics.values() {
        sink.announce(&topic.name, &topic.message_type);
    }
    let last_row = bag.connection.query_row("SELECT max(rowid) FROM messages", [], |row| row.get(0));
    let mut state = ReadState { last_row: last_row.unwrap_or(0), ..ReadState::default() };
    if bag.promised_bytes.is_none() {
        read_ordered(bag, sink, &mut state)?;
    }
    if bag.promised_bytes.is_some() || state.problem.is_some() {
        let holes = salvage(bag, sink, &mut state)?;
        bag.report_damage(&state, holes, sink);
    }
    if state.rows > bag.most_messages {
        let (kind, subject, allowed) = (LimitKind::Messages, "a bag", bag.most_messages);
        sink.note(LimitExceeded { kind, subject, found: state.rows, allowed }.to_string());
    }
    Ok(())
}

impl BagDatabase {
    fn report_damage(&self, state: &ReadState, holes: u32, sink: &mut LogSink<'_>) {
        let path = self.path.display();
        let what = match (self.promised_bytes, &state.problem) {
            (Some(promised), _) => format!("{path} is truncated: {} of {promised} bytes are left", self.bytes),
            (None, problem) => format!("{path} is damaged: {}", problem.as_deref().unwrap_or("unknown")),
        };
        let read = match state.rows {
            0 => "no message could be read".to_owned(),
            rows => format!("{rows} messages could be read, with {holes} gaps between them"),
        };
        let lost = match u64::try_from(state.last_row).ok().and_then(|last_row| last_row.checked_sub(state.rows)) {
            Some(lost) if lost > 0 => format!("about {lost} are lost, by the number of its last row"),
            _ => "how many are lost is unknown".to_owned(),
        };
        sink.note(format!("{what}; {read}; {lost}"));
    }

    /// Converts a row; `false` if no more may be read.
    fn take(&self, row: &Row<'_>, sink: &mut LogSink<'_>, state: &mut ReadState) -> Result<bool, ConvertError> {
        state.rows += 1;
        if state.rows > self.most_messages {
            return Ok(false);
        }
        let (Ok(topic_id), Ok(log_time_ns), Ok(data)) = (row.get::<_, i64>(0), row.get::<_, i64>(1), row.get_ref(2))
        else {
            sink.leave(DAMAGED_ROWS, "", 1, "rows without a topic or a time");
            return Ok(true);
        };
        let data = match data {
            ValueRef::Blob(bytes) | ValueRef::Text(bytes) => bytes,
            ValueRef::Null | ValueRef::Integer(_) | ValueRef::Real(_) => &[],
        };
        let Some(topic) = self.topics.get(&topic_id) else {
            sink.leave("(unknown topics)", "", 1, format!("the bag does not describe topic number {topic_id}"));
            return Ok(true);
        };
        let payload = if topic.encoding == "cdr" { Payload::Cdr(data) } else { Payload::Other(&topic.encoding) };
        sink.take(&SourceMessage {
            topic: &topic.name,
            message_type: &topic.message_type,
            definition: topic.definition.as_deref(),
            log_time_ns,
            payload,
        })?;
        sink.progress((state.rows as f64 / state.last_row.max(1) as f64).min(1.0));
        Ok(true)
    }
}

/// Log time and number of a row.
fn place_of(row: &Row<'_>) -> Option<(i64, i64)> {
    Some((row.get(1).ok()?, row.get(3).ok()?))
}

fn read_ordered(bag: &BagDatabase, sink: &mut LogSink<'_>, state: &mut ReadState) -> Result<(), ConvertError> {
    let failed = |error: rusqlite::Error| ConvertError::unreadable(error.to_string(), &bag.path);
    let mut query = bag.connection.prepare(ORDERED).map_err(failed)?;
    let mut rows = query.query([]).map_err(failed)?;
    loop {
        match rows.next() {
            Ok(Some(row)) => {
                state.last = place_of(row).or(state.last);
                if !bag.take(row, sink, state)? {
                    return Ok(());
                }
            }
            Ok(None) => return Ok(()),
            Err(error) => {
                state.problem = Some(error.to_string());
                return Ok(());
            }
        }
    }
}

/// Converts the rows that were not read in the order of log times; returns the number of damaged places.
fn salvage(bag: &BagDatabase, sink: &mut LogSink<'_>, state: &mut ReadState) -> Result<u32, ConvertError> {
    let failed = |error: rusqlite::Error| ConvertError::unreadable(error.to_string(), &bag.path);
    let already = state.last;
    let mut query = bag.connection.prepare(FROM_ROW).map_err(failed)?;
    let (mut from_row, mut step, mut holes) = (0_i64, 1_i64, 0_u32);
    while step < LARGEST_HOLE && holes < MOST_HOLES {
        let mut rows = query.query([from_row]).map_err(failed)?;
        let problem = loop {
            match rows.next() {
                Ok(Some(row)) => {
                    let place = place_of(row);
                    if let Some((_, number)) = place {
                        // First readable row after a gap.
                        (from_row, step) = (from_row.max(number.saturating_add(1)), 1);
                    }
                    let repeated = place.zip(already).is_some_and(|(place, last)| place <= last);
                    if !repeated && !bag.take(row, sink, state)? {
                        return Ok(holes);
                    }
                }
                Ok(None) => return Ok(holes),
                Err(error) => break error,
            }
        };
        holes += u32::from(step == 1);
        state.problem.get_or_insert_with(|| problem.to_string());
        if matches!(problem.sqlite_error_code(), Some(rusqlite::ErrorCode::OperationInterrupted)) {
            return Ok(holes);
        }
        from_row = from_row.saturating_add(step);
        step *= 2;
    }
    Ok(holes)
}

/// Topics by number, at most `most` of them, with their definitions if the recorder wrote them (ROS 2 Iron and
/// later).
fn read_topics(
    connection: &Connection,
    definitions: &BTreeMap<String, String>,
    most: u64,
) -> Result<BTreeMap<i64, Topic>, rusqlite::Error> {
    let mut query = connection.prepare("SELECT id, name, type, serialization_format FROM topics ORDER BY id")?;
    let rows = query.query_map([], |row| {
        let message_type: String = row.get(2)?;
        let definition = definitions.get(&message_type).cloned();
        Ok((row.get(0)?, Topic { name: row.get(1)?, message_type, encoding: row.get(3)?, definition }))
    })?;
    rows.take(usize::try_from(most).unwrap_or(usize::MAX)).collect()
}

/// Definitions in `ros2msg` by type.
fn read_definitions(connection: &Connection) -> Result<BTreeMap<String, String>, rusqlite::Error> {
    let mut query = connection
        .prepare("SELECT topic_type, encoded_message_definition FROM message_definitions WHERE encoding = 'ros2msg'")?;
    let rows = query.query_map([], |row| Ok((row.get(0)?, row.get(1)?)))?;
    rows.filter(|row| !matches!(row, Ok((_, text)) if String::is_empty(text))).collect()
}
