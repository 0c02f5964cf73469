use std::fs;

use super::*;
use crate::flight_log::RigOfLog as _;
use crate::flight_log::{LogError, MessageKind, MessageType};

fn open_error(content: &[u8]) -> String {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("bad.mcap");
    fs::write(&path, content).unwrap();
    let message = FlightLog::open(&path).unwrap_err().to_string();
    assert!(message.ends_with("bad.mcap"), "the path comes last: {message}");
    message
}

#[test]
fn files_that_are_not_logs_are_identified() {
    let cases: [(&[u8], &str); 6] = [
        (b"", "the file is empty (0 bytes)"),
        (b"time,x,y\n0.1,2,3\n", "a text file that begins with \"time,x,y"),
        (b"#ROSBAG V2.0\n", "a ROS 1 bag; convert it with `dcvins convert`"),
        (b"SQLite format 3\0\0\0", "a ROS 2 bag in SQLite"),
        (b"\x89PNG\r\n\x1a\n\0\0\0", "begins with 89 50 4e 47"),
        (b"\x89MCAP0\r\n", "at byte 8: the file does not end with the MCAP magic"),
    ];
    for (content, expected) in cases {
        let message = open_error(content);
        assert!(message.contains(expected), "{message}");
    }
    let pointer = b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 55196154\n";
    let message = open_error(pointer);
    assert!(
        message.contains("a Git LFS pointer in place of the file (55196154 bytes); fetch the log with"),
        "{message}"
    );
    let missing = FlightLog::open(Path::new("/nowhere/at/all.mcap")).unwrap_err().to_string();
    assert!(missing.contains("cannot open the log"), "{missing}");
    let folder = TempDir::new().unwrap();
    assert!(FlightLog::open(folder.path()).unwrap_err().to_string().contains("a folder"));
}

#[test]
fn a_log_cut_off_anywhere_plays_to_the_damage() {
    for compression in [LogCompression::None, LogCompression::Lz4, LogCompression::Zstd] {
        for chunk_bytes in [Some(40_000), None] {
            let folder = TempDir::new().unwrap();
            let options = LogWriterOptions { compression, chunk_bytes, indexed: true };
            let path = Flight { options, ..Flight::default() }.write(folder.path());
            let whole = fs::read(&path).unwrap();
            let mut previous = usize::MAX;
            for percent in [97, 80, 50, 20] {
                let kept = whole.len() * percent / 100;
                fs::write(&path, &whole[..kept]).unwrap();
                let (frames, warnings) = play_file(&path, RIG, 0.0);
                assert!(frames.len() < previous || percent == 97, "{percent} %");
                // The log grows evenly, so the number of frames is proportional to the bytes, less one chunk.
                assert!(
                    frames.len() + 6 >= 60 * percent / 100,
                    "{} frames of {percent} % in {compression:?}",
                    frames.len()
                );
                assert!(frames.iter().enumerate().all(|(number, frame)| frame.index == number));
                let warning = warning_with(&warnings, &["damaged after second", "at byte"]);
                assert!(warning.stamp_ns <= 3_100 * MS && warning.stamp_ns > 0, "{warning:?}");
                previous = frames.len();
            }
        }
    }
}

#[test]
fn a_log_cut_at_every_kind_of_byte_never_panics() {
    let folder = TempDir::new().unwrap();
    let path = Flight { duration_ms: 200, ..Flight::default() }.write(folder.path());
    let whole = fs::read(&path).unwrap();
    for kept in (0..whole.len()).step_by(97) {
        fs::write(&path, &whole[..kept]).unwrap();
        if let Ok(log) = FlightLog::open(&path)
            && log.topic("/camera").is_some()
            && log.topic("/imu").is_some()
            && log.topic("/joints").is_some()
        {
            play_file(&path, RIG, 0.0);
        }
    }
}

fn flip(path: &Path, at: usize) {
    let mut bytes = fs::read(path).unwrap();
    for byte in &mut bytes[at..at + 64] {
        *byte ^= 0x5A;
    }
    fs::write(path, &bytes).unwrap();
}

#[test]
fn flipped_bytes_in_a_message_index_cost_nothing() {
    let folder = TempDir::new().unwrap();
    let path = Flight::default().write(folder.path());
    let blocks = FlightLog::open(&path).unwrap().index().blocks.clone();
    // A chunk is followed by one message index per channel.
    for after in [9, 40, 100, 200, 500, 1000] {
        flip(&path, blocks[2].bytes.end + after);
        let (frames, warnings) = play_file(&path, RIG, 0.0);
        assert_eq!((frames.len(), warnings), (60, Vec::new()), "{after} bytes after the chunk");
        flip(&path, blocks[2].bytes.end + after);
    }
}

#[test]
fn flipped_bytes_cost_one_chunk_and_are_reported() {
    for compression in [LogCompression::None, LogCompression::Lz4, LogCompression::Zstd] {
        for indexed in [true, false] {
            let folder = TempDir::new().unwrap();
            let options = LogWriterOptions { compression, chunk_bytes: Some(40_000), indexed };
            let path = Flight { options, ..Flight::default() }.write(folder.path());
            let blocks = FlightLog::open(&path).unwrap().index().blocks.clone();
            let chunk = &blocks[blocks.len() / 2].bytes;
            flip(&path, chunk.start + chunk.len() / 2);
            let (frames, warnings) = play_file(&path, RIG, 0.0);
            let reported = warnings.iter().any(|warning| {
                (warning.message.contains("damaged chunk at byte") || warning.message.contains("the log is damaged"))
                    && warning.stamp_ns > 500 * MS
                    && warning.stamp_ns < 2_500 * MS
            });
            assert!(reported, "{compression:?} indexed {indexed}: {warnings:?}");
            assert!(frames.len() < 60 && frames.len() > 30, "{} frames", frames.len());
            assert!(frames.last().unwrap().stamp_ns > 2_900 * MS, "reading continues after the damage");
            // Without an index the number of images in the damaged chunk is unknown.
            assert!(frames.last().unwrap().index == 59 || !indexed);
        }
    }
}

#[test]
fn random_damage_never_panics() {
    let folder = TempDir::new().unwrap();
    let path = Flight { duration_ms: 300, ..Flight::default() }.write(folder.path());
    let whole = fs::read(&path).unwrap();
    let mut state = 12345_u64;
    for _ in 0..150 {
        let mut bytes = whole.clone();
        for _ in 0..4 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let at = 8 + (state >> 33) as usize % (bytes.len() - 8);
            bytes[at] = (state >> 20) as u8;
        }
        fs::write(&path, &bytes).unwrap();
        if let Ok(log) = FlightLog::open(&path)
            && let Ok(stream) = FrameStream::new(Arc::new(log), &rig_from(RIG), "cam0", 0.0, None)
        {
            assert!(stream.count() <= 6);
        }
    }
}

#[test]
fn numbers_that_are_not_finite_never_pass() {
    let flight = Flight {
        imu: |stamp_ns, rate, force| {
            if (700..720).contains(&(*stamp_ns / MS)) {
                rate.x = f64::NAN;
            }
            if *stamp_ns == 1500 * MS {
                force.z = f64::INFINITY;
            }
            true
        },
        ..Flight::default()
    };
    let (frames, warnings) = play(&flight, RIG, 0.0);
    assert_eq!(frames.len(), 60);
    let run = warning_with(&warnings, &["/imu: 4 messages from 0.701 s to 0.716 s dropped", "not finite", "NaN"]);
    assert_eq!(run.stamp_ns, 701 * MS);
    warning_with(&warnings, &["/imu: message at 1.501 s dropped", "not finite", "inf"]);
    let numbers = frames.iter().flat_map(|frame| &frame.imu);
    assert!(
        numbers
            .map(|sample| sample.angular_velocity_rad_per_s.sum() + sample.specific_force_m_per_s2.sum())
            .all(f64::is_finite)
    );
}

#[test]
fn images_of_another_size_are_skipped_with_both_sizes() {
    let flight = Flight {
        image: |stamp_ns, size| {
            if *stamp_ns == 527 * MS {
                *size = [32, 24];
            }
            true
        },
        ..Flight::default()
    };
    let (frames, warnings) = play(&flight, RIG, 0.0);
    warning_with(&warnings, &["/camera: image 10 at 0.527 s skipped", "32×24 pixels", "64×48 in the rig for cam0"]);
    let numbers: Vec<usize> = frames.iter().map(|frame| frame.index).collect();
    assert_eq!(numbers, (0..60).filter(|number| *number != 10).collect::<Vec<_>>());
    assert_eq!(frames[10].imu[0].stamp_ns, 477 * MS, "the IMU samples of the skipped image are kept");
}

#[test]
fn stamps_that_run_backwards_or_repeat_are_dropped() {
    let flight = Flight {
        imu: |stamp_ns, _, _| {
            if *stamp_ns == 1000 * MS {
                *stamp_ns = 300 * MS; // far back
            } else if *stamp_ns == 2000 * MS {
                *stamp_ns = 1995 * MS; // again
            }
            true
        },
        image: |stamp_ns, _| {
            if *stamp_ns == 1527 * MS {
                *stamp_ns = 27 * MS;
            }
            true
        },
        ..Flight::default()
    };
    let (frames, warnings) = play(&flight, RIG, 0.0);
    assert_eq!(frames.len(), 59);
    warning_with(&warnings, &["/imu: message at 1.001 s dropped: the header stamps run backwards", "0.300000 s"]);
    warning_with(&warnings, &["/imu: message at 2.001 s dropped: the header stamp repeats", "1.995000 s"]);
    warning_with(&warnings, &["/camera: message at 1.545 s dropped", "the header stamp"]);
    let stamps: Vec<i64> =
        frames.iter().flat_map(|frame| frame.imu.iter().skip(1)).map(|sample| sample.stamp_ns).collect();
    assert!(stamps.windows(2).all(|pair| pair[0] < pair[1]));
}

#[test]
fn small_disorder_is_sorted() {
    let flight = Flight {
        // Each second sample is written 30 ms late, so that neighbours change places.
        imu: |stamp_ns, rate, force| {
            *stamp_ns += if *stamp_ns / (5 * MS) % 2 == 1 { -30 * MS } else { 0 };
            *rate = Vector3::new(*stamp_ns as f64 * 1e-9, 0.0, 0.4);
            *force = Vector3::new(0.0, *stamp_ns as f64 * 1e-10, 9.81);
            *stamp_ns >= 0
        },
        ..Flight::default()
    };
    let (frames, warnings) = play(&flight, RIG, 0.0);
    assert_eq!(warnings, []);
    for frame in &frames[1..frames.len() - 1] {
        assert_eq!(frame.imu.len(), 12);
        assert!(frame.imu.windows(2).all(|pair| pair[0].stamp_ns < pair[1].stamp_ns));
    }
}

#[test]
fn gaps_are_reported() {
    let flight = Flight {
        imu: |stamp_ns, _, _| !(2000 * MS..2040 * MS).contains(stamp_ns),
        image: |stamp_ns, _| !(500 * MS..2500 * MS).contains(stamp_ns),
        ..Flight::default()
    };
    let (frames, warnings) = play(&flight, RIG, 0.0);
    assert_eq!(frames.len(), 20);
    warning_with(&warnings, &["/camera: no image for 2.050 s from 0.477 s on"]);
    warning_with(&warnings, &["/imu: no samples for 0.045 s from 1.995 s on"]);
    assert_eq!(frames[10].imu.len(), 2 + 410 - 8);
}

#[test]
fn images_without_imu_are_not_used_and_reported() {
    let flight = Flight { imu: |stamp_ns, _, _| (500 * MS..2500 * MS).contains(stamp_ns), ..Flight::default() };
    let (frames, warnings) = play(&flight, RIG, 0.0);
    assert_eq!((frames[0].index, frames.last().unwrap().index), (10, 49));
    warning_with(&warnings, &["10 images before the first IMU sample at"]);
    warning_with(&warnings, &["the IMU ends at", "the last 10 images of cam0 are not used"]);
}

fn stream_error(rig: &str) -> String {
    let folder = TempDir::new().unwrap();
    let log = Arc::new(FlightLog::open(&Flight::default().write(folder.path())).unwrap());
    FrameStream::new(log, &rig_from(rig), "cam0", 0.0, None).unwrap_err().to_string()
}

#[test]
fn a_rig_that_does_not_match_the_log_is_refused() {
    let message = stream_error(&RIG.replace("rostopic: /camera", "rostopic: /front"));
    assert!(message.contains("cam0.rostopic names the topic '/front', which is not in the log"), "{message}");
    assert!(
        message.contains("of type sensor_msgs/msg/Image or sensor_msgs/msg/CompressedImage or")
            && message.contains("FFMPEGPacket are '/camera'"),
        "{message}"
    );
    let message = stream_error(&RIG.replace("rostopic: /imu", "rostopic: /camera"));
    assert!(message.contains("imu0.rostopic names the topic '/camera'") && message.contains("are '/imu'"), "{message}");
    let message = stream_error(&RIG.replace("joint: yaw", "joint: pan"));
    assert!(message.contains("gimbal.links[0].joint is 'pan'") && message.contains("name 'roll', 'yaw'"), "{message}");
    let (frames, warnings) = play(&Flight::default(), &RIG.replace("rostopic: /truth", "rostopic: /vicon"), 0.0);
    assert!(frames.iter().all(|frame| frame.ground_truth.is_none()));
    warning_with(&warnings, &["no ground truth", "/vicon", "'/truth'"]);
}

#[test]
fn a_log_without_a_rig_names_the_files_looked_for() {
    let folder = TempDir::new().unwrap();
    let log = FlightLog::open(&Flight::default().write(folder.path())).unwrap();
    let error = Rig::for_log(&log, None).unwrap_err();
    assert!(matches!(error, LogError::NoRig { .. }) && error.to_string().contains("flight.rig.yaml"), "{error}");
}

/// Error of a rig's IMU topic whose only messages are of a type and encoding.
fn error_of_imu_topic(name: &str, message_encoding: &'static str) -> (LogError, FlightLog, TempDir) {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("other.mcap");
    let mut writer = LogWriter::create(&path, &LogWriterOptions::default()).unwrap();
    let message_type =
        MessageType { name, definition_encoding: "", definition: b"".as_slice().into(), message_encoding };
    for number in 0..3 {
        let times = MessageTimes { stamp_ns: EPOCH_NS, log_time_ns: EPOCH_NS + number * 5 * MS };
        writer.write_typed("/imu", &message_type, times, &[0; 4]).unwrap();
    }
    writer.finish().unwrap();
    let log = FlightLog::open(&path).unwrap();
    let error = log.require_topic("imu0.rostopic", "/imu", &[MessageKind::Imu]).unwrap_err();
    (error, log, folder)
}

#[test]
fn topics_that_cannot_be_read_are_named_with_type_encoding_and_remedy() {
    let check = |name: &str, encoding, words: &[&str]| {
        let (error, log, _folder) = error_of_imu_topic(name, encoding);
        let texts = [error.to_string(), log.warnings()[0].message.clone()];
        assert!(words.iter().all(|word| texts[0].contains(word)), "{words:?} in {texts:?}");
        assert!(texts.iter().all(|text| !text.contains("not in the log")), "{texts:?}");
        texts
    };
    let [_, warning] = check("sensor_msgs/Imu", "ros1", &["'/imu'", "sensor_msgs/Imu in ROS 1", "`dcvins convert LOG"]);
    assert!(warning.contains("1 topic are in ROS 1 encoding") && warning.contains("`dcvins convert LOG"), "{warning}");
    // `convert` does not read JSON.
    let [error, _] = check("sensor_msgs/msg/Imu", "json", &["sensor_msgs/msg/Imu in JSON", "record ROS 2 messages"]);
    assert!(!error.contains("convert LOG"), "{error}");
    check("sensor_msgs/msg/PointCloud2", "cdr", &["another type: sensor_msgs/msg/PointCloud2 in CDR"]);
}
