//! Recordings of autopilots and cameras, made by `recorders.rs`: every number is converted, and losses are counted.

use std::collections::BTreeMap;
use std::fs;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use dcvins::files::RigFile as _;
use dcvins::flight_log::FlightLog;
use dcvins::flight_log::convert::{
    AutopilotLog, AutopilotLogKind, ConversionReport, ConvertError, ConvertOptions, VideoClock, convert_with,
};
use dcvins::sensors::Rig;
use dcvins::text::Named as _;

use super::recorders::{
    GIMBAL_DEG, PERIOD_US, POSITION_M, START_US, START_UTC_S, Track, VEHICLE_DEG, dataflash, force, movie, quaternion,
    rate, telemetry, telemetry_log, telemetry_track, ulog, video_track,
};
use super::topic;

/// Number of samples of the recordings.
const SAMPLES: usize = 200;
const MS: i64 = 1_000_000;

/// Messages of a log by topic: header stamp, log time, and the numbers after the header.
pub(super) type Messages = BTreeMap<String, Vec<(i64, i64, Vec<f64>)>>;

fn messages(log: &Path) -> Messages {
    let bytes = fs::read(log).expect("the log can be read");
    let mut messages = Messages::new();
    for message in mcap::MessageStream::new(&bytes).expect("the log is valid") {
        let message = message.expect("the message is valid");
        if message.channel.message_encoding == "protobuf" {
            let entry = (protobuf_stamp_ns(&message.data), message.log_time as i64, Vec::new());
            messages.entry(message.channel.topic.clone()).or_default().push(entry);
            continue;
        }
        let word = |at: usize| u32::from_le_bytes(message.data[at..at + 4].try_into().expect("four bytes"));
        let stamp_ns = i64::from(word(4)) * 1_000_000_000 + i64::from(word(8));
        let behind = 12 + 4 + word(12) as usize;
        let first = 4 + (behind - 4).next_multiple_of(8);
        let numbers = message.data[first.min(message.data.len())..].chunks_exact(8);
        let numbers = numbers.map(|number| f64::from_le_bytes(number.try_into().expect("eight bytes"))).collect();
        let entry = (stamp_ns, message.log_time as i64, numbers);
        messages.entry(message.channel.topic.clone()).or_default().push(entry);
    }
    messages
}

/// Stamp of a protobuf message whose first field is a `google.protobuf.Timestamp` of seconds and nanoseconds.
fn protobuf_stamp_ns(data: &[u8]) -> i64 {
    assert_eq!(data[0], 0x0a, "the first field has a length");
    let mut stamp = &data[2..2 + usize::from(data[1])];
    let mut stamp_ns = 0;
    while let [key, rest @ ..] = stamp {
        let length = rest.iter().position(|byte| byte & 0x80 == 0).expect("a number ends") + 1;
        let number = rest[..length].iter().rev().fold(0, |sum, byte| sum << 7 | i64::from(byte & 0x7f));
        stamp_ns += if *key == 0x08 { number * 1_000_000_000 } else { number };
        stamp = &rest[length..];
    }
    stamp_ns
}

pub(super) fn converted(
    folder: &Path,
    name: &str,
    bytes: &[u8],
    options: &ConvertOptions,
) -> Result<ConversionReport, ConvertError> {
    let source = folder.join(name);
    fs::write(&source, bytes).expect("the source can be written");
    convert_with(&source, &folder.join("flight.mcap"), options, &mut |_| ControlFlow::Continue(()))
}

pub(super) fn run(folder: &Path, name: &str, bytes: &[u8]) -> (ConversionReport, Messages) {
    let report = converted(folder, name, bytes, &ConvertOptions::default()).expect("it is converted");
    (report, messages(&folder.join("flight.mcap")))
}

pub(super) fn assert_near(found: &[f64], expected: &[f64], tolerance: f64, what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() <= tolerance, "{what}: {found} and {expected}");
    }
}

/// Rig written with a log.
pub(super) fn rig_of(report: &ConversionReport) -> Rig {
    let path = report.rig.as_deref().expect("there is a rig");
    Rig::from_yaml(&fs::read_to_string(path).expect("the rig is valid"), path).expect("the rig is valid")
}

/// Angular velocity and specific force of an IMU message.
pub(super) fn imu(numbers: &[f64]) -> ([f64; 3], [f64; 3]) {
    (numbers[13..16].try_into().expect("three numbers"), numbers[25..28].try_into().expect("three numbers"))
}

/// Quaternion x, y, z, w of an attitude in degrees.
fn rotation(angles_deg: [f64; 3]) -> [f64; 4] {
    let [w, x, y, z] = quaternion(angles_deg);
    [x, y, z, w]
}

/// Checks the common data of all three autopilots, with the tolerance of their numbers.
fn check_autopilot(messages: &Messages, imu_topic: &str, samples: usize, tolerance: f64) {
    let start_ns = START_UTC_S as i64 * 1_000_000_000;
    let samples_of_imu = &messages[imu_topic];
    assert_eq!(samples_of_imu.len(), samples);
    for (index, (stamp_ns, log_time_ns, numbers)) in samples_of_imu.iter().enumerate() {
        // Resolution: the receiver's milliseconds, and microseconds of a double since the epoch.
        assert!((stamp_ns - start_ns - index as i64 * PERIOD_US as i64 * 1000).abs() < 1000, "{index}: {stamp_ns}");
        assert_eq!(stamp_ns, log_time_ns);
        let (found_rate, found_force) = imu(numbers);
        assert_near(&found_rate, &rate(index), tolerance, "angular velocity");
        assert_near(&found_force, &force(index), tolerance * 10.0, "specific force");
    }
    let count = samples.div_ceil(10);
    for (name, expected) in [("/gimbal/attitude", GIMBAL_DEG), ("/vehicle/attitude", VEHICLE_DEG)] {
        assert_eq!(messages[name].len(), count, "{name}");
        for (_, _, numbers) in &messages[name] {
            assert_near(numbers, &rotation(expected), 1e-6, name);
        }
    }
    // East, north, up; the vehicle heads east and is nearly level: forward is east, right is south, down is down.
    let (_, _, pose) = &messages["/vehicle/pose"][3];
    let [north, east, down] = POSITION_M;
    assert_near(&pose[..3], &[east, north, -down], 1e-6, "position");
    let [x, y, z, w] = [pose[3], pose[4], pose[5], pose[6]];
    let forward = [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w)];
    let pitch = VEHICLE_DEG[1].to_radians();
    assert_near(&forward, &[pitch.cos(), 0.0, pitch.sin()], 1e-6, "forward");
}

#[test]
fn dataflash_logs_are_converted() {
    let folder = tempfile::tempdir().unwrap();
    let (report, messages) = run(folder.path(), "flight.bin", &dataflash(SAMPLES));
    assert_eq!(report.kind, "ArduPilot DataFlash log");
    check_autopilot(&messages, "/imu0", SAMPLES, 1e-6);
    assert_eq!(messages["/imu1"].len(), SAMPLES / 2);
    assert!(topic(&report, "/imu0").reason.as_deref().unwrap().starts_with("IMU[0], 250.0 Hz"));
    let of_filter = report.topics.iter().filter(|topic| topic.topic.starts_with("XKF1"));
    assert_eq!((of_filter.map(|topic| topic.left).sum::<u64>(), topic(&report, "MODE").left), (20, 1));
    // 1e-7° of latitude are 11.1 mm; the latitude grows by ten of them.
    let positions = &messages["/gps/pose"];
    assert_near(&positions[5].2[..3], &[0.0, 0.5559, 0.0], 1e-3, "fix");
}

#[test]
fn ulogs_are_converted() {
    let folder = tempfile::tempdir().unwrap();
    let (report, messages) = run(folder.path(), "flight.ulg", &ulog(SAMPLES));
    assert_eq!(report.kind, "PX4 ULog");
    check_autopilot(&messages, "/imu", SAMPLES, 1e-6);
    assert_eq!(topic(&report, "cpuload").left, 20);
    assert!(report.notes.iter().any(|note| note.contains("0.250 s in total")), "{:?}", report.notes);
    assert_eq!(messages["/gps/pose"].len(), 20);
}

#[test]
fn telemetry_logs_are_converted() {
    let folder = tempfile::tempdir().unwrap();
    let (report, messages) = run(folder.path(), "flight.tlog", &telemetry_log(SAMPLES));
    assert_eq!(report.kind, "MAVLink telemetry log");
    // Thousandths of g and of rad/s.
    check_autopilot(&messages, "/imu", SAMPLES, 0.5e-3);
    assert_eq!(topic(&report, "message 74").left, 20);
    // The gimbal has a separate clock: the fastest of its messages took 30 ms.
    let (stamp_ns, _, _) = messages["/gimbal/attitude"][0];
    assert_eq!(stamp_ns - START_UTC_S as i64 * 1_000_000_000, 30 * MS);
}

#[test]
fn damage_in_logs_of_autopilots_is_counted() {
    let folder = tempfile::tempdir().unwrap();
    type Recorder = (&'static str, fn(usize) -> Vec<u8>, &'static str);
    let recorders: [Recorder; 3] =
        [("flight.bin", dataflash, "/imu0"), ("flight.ulg", ulog, "/imu"), ("flight.tlog", telemetry_log, "/imu")];
    for (name, recorder, imu_topic) in recorders {
        let whole = recorder(SAMPLES);
        let expected = run(folder.path(), name, &whole).1;
        // Cut off within a record.
        let (report, found) = run(folder.path(), name, &whole[..=whole.len() * 2 / 3]);
        assert!(report.notes.iter().any(|note| note.contains("ends within a")), "{name}: {:?}", report.notes);
        let count = found[imu_topic].len();
        assert!((SAMPLES / 2..SAMPLES * 3 / 4).contains(&count), "{name}: {count}");
        assert_eq!(found[imu_topic], expected[imu_topic][..count], "{name}");
        // Bytes overwritten in the middle.
        let mut damaged = whole.clone();
        let middle = damaged.len() / 2;
        damaged[middle..middle + 100].fill(0x77);
        let (report, found) = run(folder.path(), name, &damaged);
        let note = report.notes.iter().find(|note| note.contains("are skipped")).unwrap();
        assert!(note.contains("bytes at 1 place,"), "{name}: {note}");
        let count = found[imu_topic].len();
        assert!((SAMPLES - 6..SAMPLES).contains(&count), "{name}: {count}");
        assert!(found[imu_topic].iter().all(|message| expected[imu_topic].contains(message)), "{name}");
        // One byte changed at many positions: never a panic, never a wrong kind of message.
        for at in (16..whole.len()).step_by(whole.len() / 97) {
            let mut damaged = whole.clone();
            damaged[at] ^= 0x55;
            let _result = converted(folder.path(), name, &damaged, &ConvertOptions::default());
        }
    }
}

/// Messages of a stream of `tests/data/video`, and the indices of its frames in the order of their times.
fn stream(name: &str) -> (Vec<&'static [u8]>, Vec<usize>) {
    let mut data: &'static [u8] = match name {
        "h264" => include_bytes!("../../data/video/h264.bin"),
        _ => include_bytes!("../../data/video/h264_b_frames.bin"),
    };
    let listings: serde_json::Value =
        serde_json::from_str(include_str!("../../data/video/streams.json")).expect("the listing is valid");
    let numbers = |key: &str| -> Vec<usize> {
        listings[name][key]
            .as_array()
            .expect("a list of numbers")
            .iter()
            .map(|number| number.as_u64().expect("a list of numbers") as usize)
            .collect()
    };
    let messages = numbers("bytes").into_iter().map(|bytes| {
        let (message, behind) = data.split_at(bytes);
        data = behind;
        message
    });
    (messages.collect(), numbers("order"))
}

pub(super) fn video(name: &str) -> Track<'static> {
    let (messages, order) = stream(name);
    let mut track = video_track(&messages, [96, 64]);
    if name != "h264" {
        // Two frames are decoded before the first one is presented.
        track.delays = order.iter().enumerate().map(|(number, place)| 50 * (place + 2 - number) as u32).collect();
        track.media_start = 100;
    }
    track
}

#[test]
fn movies_with_telemetry_are_converted() {
    for (name, axes, tables_first) in [("h264", "YxZ", false), ("h264_b_frames", "ZXY", true)] {
        let folder = tempfile::tempdir().unwrap();
        let bytes = movie(&[video(name), telemetry_track(telemetry(6, axes))], tables_first);
        let (report, messages) = run(folder.path(), "flight.mp4", &bytes);
        let start_ns = START_UTC_S as i64 * 1_000_000_000;
        let frames = &messages["/camera/video"];
        let stamps: Vec<i64> = frames.iter().map(|(stamp_ns, _, _)| (stamp_ns - start_ns) / MS).collect();
        let expected: Vec<i64> = stream(name).1.iter().map(|place| 50 * *place as i64).collect();
        assert_eq!(stamps, expected, "{name}");
        assert!(frames.iter().all(|(stamp_ns, log_time_ns, _)| log_time_ns >= stamp_ns));
        let reason = topic(&report, "/camera/video").reason.clone().unwrap();
        assert!(reason.starts_with("h264, 96×64, 20.00 fps"), "{reason}");
        assert_eq!(reason.contains("B-frames"), name != "h264");
        for (topic, count, period_us) in
            [("/camera/imu/gyroscope", 480, 2500), ("/camera/imu/accelerometer", 240, 5000)]
        {
            assert_eq!(messages[topic].len(), count);
            for (index, (stamp_ns, _, numbers)) in messages[topic].iter().enumerate() {
                assert!((stamp_ns - start_ns - index as i64 * period_us * 1000).abs() < 1000, "{topic} {index}");
                let (found_rate, found_force) = imu(numbers);
                if topic.ends_with("gyroscope") {
                    assert_near(&found_rate, &rate(index % 100), 1e-12, topic);
                } else {
                    assert_near(&found_force, &force(index % 100), 1e-12, topic);
                }
            }
        }
        assert_eq!(topic(&report, "SHUT").left, 36);
        // The rig of the log contains both sensors and lists assumed values.
        let written = rig_of(&report);
        assert_eq!(written.imu.topic, "/camera/imu/gyroscope");
        assert_eq!(written.imu.accelerometer_topic.as_deref(), Some("/camera/imu/accelerometer"));
        assert_eq!(written.cameras[0].model.resolution_px, [96, 64]);
        assert!(written.gimbal.is_none() && written.assumed.iter().any(|assumed| assumed.field == "cam0.intrinsics"));
        // Every frame is decoded, together with both sensors of the IMU.
        let log = Arc::new(FlightLog::open(&report.log).unwrap());
        let frames: Vec<_> = dcvins::flight_log::FrameStream::new(log, &written, "cam0", 0.0, None).unwrap().collect();
        assert_eq!(frames.len(), 24, "{name}");
    }
}

#[test]
fn a_video_is_placed_in_the_log_of_the_autopilot() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = movie(&[video("h264")], false);
    let log = folder.path().join("autopilot.ulg");
    fs::write(&log, ulog(SAMPLES)).unwrap();
    let autopilot = Some(AutopilotLog { kind: AutopilotLogKind::Ulog, path: log.clone() });
    let first_ns = |clock: Option<VideoClock>| {
        let options = ConvertOptions { autopilot: autopilot.clone(), video_clock: clock, ..ConvertOptions::default() };
        let report = converted(folder.path(), "flight.mp4", &bytes, &options).unwrap();
        let messages = messages(&folder.path().join("flight.mcap"));
        check_autopilot(&messages, "/imu", SAMPLES, 1e-6);
        let stamps: Vec<i64> = messages["/camera/video"].iter().map(|(stamp_ns, _, _)| *stamp_ns).collect();
        let start_ns = START_UTC_S as i64 * 1_000_000_000;
        (stamps[0] - start_ns, stamps[23] - stamps[0], report)
    };
    // Both clocks were set: the camera's creation time is the autopilot's first sample.
    let (first, length, report) = first_ns(None);
    assert!(first.abs() < 1000 && length == 1150 * MS, "{first} {length}");
    assert!(
        report.notes.iter().any(|note| note.contains("by the times of camera and autopilot")),
        "{:?}",
        report.notes
    );
    let (first, length, report) = first_ns(Some(VideoClock { offset_s: -0.25, drift_ppm: 100.0 }));
    assert!((first + 250 * MS).abs() < 1000 && length == 1_150_115_000, "{first} {length}");
    assert!(!report.notes.iter().any(|note| note.contains("--video-offset")), "{:?}", report.notes);

    let rig = rig_of(&report);
    let gimbal = rig.gimbal.unwrap();
    assert_eq!((rig.imu.topic.as_str(), gimbal.topic.as_deref()), ("/imu", Some("/gimbal/attitude")));
    let source = gimbal.attitude.unwrap();
    assert_eq!((source.frame.name(), source.vehicle_topic.as_deref()), ("vehicle", Some("/vehicle/attitude")));
    assert!(report.notes.iter().any(|note| note.starts_with("the rig assumes ")), "{:?}", report.notes);

    let wrong = Some(AutopilotLog { kind: AutopilotLogKind::DataFlash, path: log });
    let options = ConvertOptions { autopilot: wrong, ..ConvertOptions::default() };
    let error = converted(folder.path(), "flight.mp4", &bytes, &options).unwrap_err().to_string();
    assert!(error.starts_with("no ArduPilot DataFlash log, PX4 ULog: "), "{error}");
    let error = converted(folder.path(), "flight.ulg", &ulog(9), &options).unwrap_err().to_string();
    assert!(error.starts_with("PX4 ULog has no video: --ulog, --dataflash"), "{error}");
}

#[test]
fn damaged_movies_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let tracks = || [video("h264"), telemetry_track(telemetry(6, "XYZ"))];
    let error = |bytes: &[u8]| {
        converted(folder.path(), "flight.mp4", bytes, &ConvertOptions::default()).unwrap_err().to_string()
    };
    // Power lost: the tables at the end are missing.
    let whole = movie(&tracks(), false);
    let problem = error(&whole[..whole.len() * 2 / 3]);
    assert!(problem.starts_with("the MP4 has no moov box") && problem.contains("untrunc"), "{problem}");
    // An incomplete copy of a movie with its tables at the start.
    let whole = movie(&tracks(), true);
    let (report, messages) = run(folder.path(), "flight.mp4", &whole[..whole.len() - 7000]);
    let lost = report.notes.iter().find(|note| note.contains("frames are lost: beyond the end")).cloned();
    let frames = messages["/camera/video"].len();
    assert_eq!(lost.map(|note| note.starts_with(&format!("{} of 24 ", 24 - frames))), Some(true), "{frames}");
    assert!(frames > 0 && !messages.contains_key("/camera/imu/gyroscope"));
    // A movie without a video, and one with another compression.
    assert!(error(&movie(&tracks()[1..], true)).contains("has no video track"));
    let mut other = video("h264");
    other.description[4..8].copy_from_slice(b"av01");
    assert!(error(&movie(&[other], true)).contains("unsupported video type \"av01\""));
    // One byte changed at many positions.
    for at in (0..whole.len()).step_by(whole.len() / 199) {
        let mut damaged = whole.clone();
        damaged[at] ^= 0x81;
        let _result = converted(folder.path(), "flight.mp4", &damaged, &ConvertOptions::default());
    }
    assert_eq!(START_US, 5_000_000);
}
