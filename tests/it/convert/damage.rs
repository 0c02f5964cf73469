//! Damaged and hostile sources: readable parts are converted and losses are counted, or nothing is written.

use std::fs;
use std::ops::Range;
use std::path::Path;

use dcvins::files::LogLimits;
use dcvins::flight_log::convert::{ConvertOptions, convert_with};
use rusqlite::Connection;

use super::ros1::{Compression, Message, bag};
use super::{EPOCH_NS, ros1_messages, run, times, topic, write_database, write_directly, write_metadata};
use dcvins::flight_log::{LogCompression, LogWriter, LogWriterOptions};
use nalgebra::Vector3;

const MESSAGES: i64 = 2000;

/// Writes a log of IMU samples alone, in chunks of about 30 messages.
fn write_imu_log(path: &Path, compression: LogCompression, indexed: bool) {
    let options = LogWriterOptions { compression, chunk_bytes: Some(10_000), indexed };
    let mut log = LogWriter::create(path, &options).expect("the log can be created");
    for index in 0..MESSAGES {
        let rate = Vector3::new(index as f64, 0.5, -0.5);
        log.write_imu("/imu", "imu", times(index), &rate, &rate).expect("the message can be written");
    }
    log.finish().expect("the log can be completed");
}

/// Ranges of the chunk records, after operation code and length.
fn chunks(bytes: &[u8]) -> Vec<Range<usize>> {
    const CHUNK: u8 = 6;
    let mut chunks = Vec::new();
    let mut at = mcap::MAGIC.len();
    while at + 9 < bytes.len() - mcap::MAGIC.len() {
        let length: [u8; 8] = bytes[at + 1..at + 9].try_into().expect("a length has eight bytes");
        let end = at + 9 + u64::from_le_bytes(length) as usize;
        if bytes[at] == CHUNK {
            chunks.push(at + 9..end);
        }
        at = end;
    }
    chunks
}

/// Numbers of messages in the log and of lost messages, from the report.
fn counts(source: &Path, log: &Path) -> (u64, u64) {
    let report = run(source, log).expect("it is converted");
    let imu = topic(&report, "/imu");
    (imu.taken, imu.left)
}

#[test]
fn a_damaged_chunk_of_an_mcap_is_left_out_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let (source, log) = (folder.path().join("damaged.mcap"), folder.path().join("flight.mcap"));
    for compression in [LogCompression::None, LogCompression::Lz4, LogCompression::Zstd] {
        for indexed in [true, false] {
            write_imu_log(&source, compression, indexed);
            let mut bytes = fs::read(&source).unwrap();
            let chunks = chunks(&bytes);
            let chunk = chunks[chunks.len() / 2].clone();
            let damaged = chunk.start + chunk.len() * 3 / 4;
            bytes[damaged..damaged + 16].fill(0xFF);
            fs::write(&source, &bytes).unwrap();
            let report = run(&source, &log).unwrap();
            let imu = topic(&report, "/imu");
            let about_half = MESSAGES as u64 * 4 / 10;
            assert!(imu.taken > about_half, "{compression:?}, indexed {indexed}:\n{report}");
            assert!(report.notes.iter().any(|note| note.contains("damaged") && note.contains("lost")), "{report}");
            if indexed {
                assert_eq!(imu.taken + imu.left, MESSAGES as u64, "{compression:?}:\n{report}");
            }
        }
    }
}

#[test]
fn a_truncated_mcap_converts_to_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let (source, log) = (folder.path().join("damaged.mcap"), folder.path().join("flight.mcap"));
    write_imu_log(&source, LogCompression::Zstd, true);
    let bytes = fs::read(&source).unwrap();
    fs::write(&source, &bytes[..bytes.len() / 2]).unwrap();
    let report = run(&source, &log).unwrap();
    assert!(topic(&report, "/imu").taken > 700, "{report}");
    assert!(report.notes.iter().any(|note| note.contains("is damaged at byte")), "{report}");
}

#[test]
fn nothing_readable_leaves_no_log() {
    let folder = tempfile::tempdir().unwrap();
    let (source, log) = (folder.path().join("tiny.mcap"), folder.path().join("flight.mcap"));
    let mut bytes = mcap::MAGIC.to_vec();
    // A chunk that claims 4 TiB.
    let body = [
        &[0_u8; 16][..],
        &(4_u64 << 40).to_le_bytes(),
        &[0; 4],
        &4_u32.to_le_bytes(),
        b"zstd",
        &3_u64.to_le_bytes(),
        b"abc",
    ]
    .concat();
    bytes.push(6);
    bytes.extend((body.len() as u64).to_le_bytes());
    bytes.extend(body);
    fs::write(&source, &bytes).unwrap();
    let problem = run(&source, &log).unwrap_err().to_string();
    assert!(problem.contains("4398046511104 bytes, more than the limit of 33554432"), "{problem}");
    assert!(problem.contains("--limit record-bytes=4398046511104"), "{problem}");
    assert!(!log.exists() && fs::read_dir(folder.path()).unwrap().count() == 1, "no output is left");
}

#[test]
fn compressed_sources_are_unpacked_within_the_limit() {
    let folder = tempfile::tempdir().unwrap();
    let (plain, log) = (folder.path().join("plain.mcap"), folder.path().join("flight.mcap"));
    write_directly(&plain);
    let source = folder.path().join("flight_0.mcap.zstd");
    fs::write(&source, zstd::encode_all(&fs::read(&plain).unwrap()[..], 1).unwrap()).unwrap();
    run(&source, &log).unwrap();
    assert!(fs::read(&log).unwrap() == fs::read(&plain).unwrap());
    let opened = dcvins::flight_log::FlightLog::open(&source).unwrap();
    assert_eq!(opened.topics(), dcvins::flight_log::FlightLog::open(&plain).unwrap().topics());
    let limits = LogLimits { settings: vec!["unpacked-bytes=100".parse().unwrap()] };
    let options = ConvertOptions { limits, ..ConvertOptions::default() };
    let problem =
        convert_with(&source, &log, &options, &mut |_| std::ops::ControlFlow::Continue(())).unwrap_err().to_string();
    assert!(problem.contains("--limit unpacked-bytes="), "{problem}");

    // A compressed ROS 1 bag, and individually compressed messages.
    let source = folder.path().join("flight.bag.zstd");
    let packed = bag(&ros1_messages(), 4, Compression::None, "");
    fs::write(&source, zstd::encode_all(&packed[..], 1).unwrap()).unwrap();
    run(&source, &log).unwrap();
    assert!(fs::read(&log).unwrap() == fs::read(&plain).unwrap());
    let database = folder.path().join("alone.db3");
    write_database(&plain, &database, |data| zstd::encode_all(data, 1).unwrap());
    run(&database, &log).unwrap();
    assert!(fs::read(&log).unwrap() == fs::read(&plain).unwrap());
}

#[test]
fn a_missing_file_of_a_bag_is_left_out_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let (source, log) = (folder.path().join("bag"), folder.path().join("flight.mcap"));
    fs::create_dir(&source).unwrap();
    write_directly(&source.join("bag_0.mcap"));
    write_metadata(&source, "bag_0.mcap\n    - bag_1.mcap\n    - ../../etc/bag_2.mcap", "", "");
    let text = fs::read_to_string(source.join("metadata.yaml")).unwrap();
    let text = format!("{text}  message_count: 12\n  files:\n    - path: bag_1.mcap\n      message_count: 3\n");
    fs::write(source.join("metadata.yaml"), text).unwrap();
    let report = run(&source, &log).unwrap();
    assert_eq!(topic(&report, "/imu").taken, 2);
    let noted = |words: &[&str]| report.notes.iter().any(|note| words.iter().all(|word| note.contains(word)));
    assert!(noted(&["its 3 messages are lost", "bag_1.mcap"]), "{report}");
    assert!(noted(&["metadata.yaml counts 12 messages, 9 were found"]), "{report}");
    assert!(noted(&["left out", "bag/bag_2.mcap"]), "names stay in the bag's folder:\n{report}");
}

#[test]
fn a_truncated_database_gives_the_rows_that_are_left() {
    let folder = tempfile::tempdir().unwrap();
    let (plain, log) = (folder.path().join("plain.mcap"), folder.path().join("flight.mcap"));
    write_imu_log(&plain, LogCompression::None, true);
    let source = folder.path().join("bag_0.db3");
    // Compressed or not, the rows are written in reverse order; the last ones are lost.
    write_database(&plain, &source, <[u8]>::to_vec);
    let bytes = fs::read(&source).unwrap();
    fs::write(&source, &bytes[..bytes.len() * 8 / 10]).unwrap();
    let (taken, _) = counts(&source, &log);
    assert!(taken > MESSAGES as u64 / 2 && taken < MESSAGES as u64, "{taken} of {MESSAGES}");
    let report = run(&source, &log).unwrap();
    assert!(report.notes.iter().any(|note| note.contains("is truncated")), "{report}");
    // Rows of an overwritten page in the middle are lost.
    let mut damaged = bytes.clone();
    let middle = (bytes.len() / 2).next_multiple_of(4096);
    damaged[middle..middle + 4096].fill(0xFF);
    fs::write(&source, damaged).unwrap();
    let report = run(&source, &log).unwrap();
    let taken = topic(&report, "/imu").taken;
    assert!(taken > MESSAGES as u64 * 8 / 10, "{report}");
}

#[test]
fn databases_that_compute_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (source, log) = (folder.path().join("bag_0.db3"), folder.path().join("flight.mcap"));
    let refused = |messages: &str, expected: &str| {
        fs::remove_file(&source).ok();
        let database = Connection::open(&source).unwrap();
        let topics = "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT);";
        database.execute_batch(topics).unwrap();
        database.execute_batch(messages).unwrap();
        drop(database);
        let problem = run(&source, &log).unwrap_err().to_string();
        assert!(problem.contains(expected), "{problem}");
        assert!(!log.exists());
    };
    let endless = "CREATE VIEW messages AS WITH RECURSIVE r(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM r)
                   SELECT n AS id, 1 AS topic_id, n AS timestamp, zeroblob(9) AS data FROM r;";
    refused(endless, "'messages' is a view, and only plain tables are read");
    let computed = "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER,
                    data BLOB GENERATED ALWAYS AS (zeroblob(900000000)) VIRTUAL);";
    refused(computed, "a table with computed columns");
    refused("SELECT 1;", "it has no table 'messages'");
    let disguised = format!(
        "CREATE TABLE messages(id); PRAGMA writable_schema = ON;
                    UPDATE sqlite_master SET sql = '{}', rootpage = 0 WHERE name = 'messages';",
        endless.trim_end_matches(';')
    );
    refused(&disguised, "ROS 2 bag");
}

#[test]
fn names_beyond_reason_are_shortened_and_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let (source, log) = (folder.path().join("flight.bag"), folder.path().join("flight.mcap"));
    let long: &'static str = Box::leak("/x".repeat(40_000).into_boxed_str());
    let mut messages = ros1_messages();
    let data = messages[0].data.clone();
    messages.push(Message { topic: long, message_type: "sensor_msgs/Imu", time_ns: EPOCH_NS, data });
    fs::write(&source, bag(&messages, 4, Compression::None, "")).unwrap();
    let report = run(&source, &log).unwrap();
    assert_eq!(topic(&report, "/imu").taken, 2);
    let left = report.topics.iter().find(|topic| topic.topic.ends_with("… (80000 bytes)")).unwrap();
    assert!(left.left == 1 && left.reason.as_ref().unwrap().contains("--limit name-bytes=80000"), "{report}");
    assert!(report.to_string().lines().take(20).all(|line| line.chars().count() < 400), "{report}");
}
