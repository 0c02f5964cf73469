use std::cell::Cell;

use super::super::video::missing_frames;
use super::super::video::tests::{Stream, stream};
use super::*;
use crate::flight_log::writer::testing as encode;
use crate::flight_log::{ImageReader, MessageKind, MessageType};

/// Message type of the video.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Storage {
    /// `foxglove_msgs/msg/CompressedVideo`.
    Ros,
    /// `foxglove.CompressedVideo`, by the writer of this program.
    Written,
    /// The same of another writer.
    Protobuf,
    /// `ffmpeg_image_transport_msgs/msg/FFMPEGPacket`.
    Packet,
}

const STORAGES: [Storage; 4] = [Storage::Ros, Storage::Written, Storage::Protobuf, Storage::Packet];

fn rig_text() -> String {
    let gimbal = RIG.split_at(RIG.find("gimbal:\n").unwrap()).0;
    let rig = gimbal.replace(
        "mount: gimbal",
        "mount: static\n  T_cam_imu: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]",
    );
    rig.replace("resolution: [64, 48]", "resolution: [96, 64]")
}

fn varint(mut number: u64, out: &mut Vec<u8>) {
    while number >= 0x80 {
        out.push(number as u8 | 0x80);
        number >>= 7;
    }
    out.push(number as u8);
}

/// `foxglove.CompressedVideo` in protobuf.
fn protobuf(stamp_ns: i64, format: &str, data: &[u8]) -> Vec<u8> {
    let mut stamp = vec![0x08];
    varint((stamp_ns / 1_000_000_000) as u64, &mut stamp);
    stamp.push(0x10);
    varint((stamp_ns % 1_000_000_000) as u64, &mut stamp);
    let mut out = Vec::new();
    for (field, bytes) in [(1_u8, stamp.as_slice()), (2, b"camera"), (3, data), (4, format.as_bytes())] {
        out.push(field << 3 | 2);
        varint(bytes.len() as u64, &mut out);
        out.extend_from_slice(bytes);
    }
    out
}

/// `ffmpeg_image_transport_msgs/msg/FFMPEGPacket` in CDR.
fn packet(stamp_ns: i64, format: &str, data: &[u8]) -> Vec<u8> {
    let mut out = encode::compressed_video(stamp_ns, "camera", "", &[]);
    // After the same header follow size, encoding, time, flags and data.
    out.truncate(4 + 8 + 4 + "camera".len() + 1);
    let mut field = |bytes: &[u8], align: usize| {
        out.resize(4 + (out.len() - 4).next_multiple_of(align), 0);
        out.extend_from_slice(bytes);
    };
    field(&96_u32.to_le_bytes(), 4);
    field(&64_u32.to_le_bytes(), 4);
    field(&(format.len() as u32 + 1).to_le_bytes(), 4);
    field(format.as_bytes(), 1);
    field(&[0], 1);
    field(&7_u64.to_le_bytes(), 8);
    field(&[1, 0], 1);
    field(&(data.len() as u32).to_le_bytes(), 4);
    field(data, 1);
    out
}

/// Writes a flight whose camera is a video of 20 Hz, without the messages of these numbers.
fn write(folder: &Path, name: &str, storage: Storage, left_out: &[usize]) -> (PathBuf, Stream) {
    let stream = stream(name);
    let path = folder.join("flight.mcap");
    let options = LogWriterOptions { chunk_bytes: Some(4_000), ..LogWriterOptions::default() };
    let mut writer = LogWriter::create(&path, &options).unwrap();
    let format = if name.contains("265") { "h265" } else { "h264" };
    for millisecond in 0..1500 {
        let times = |stamp_ns: i64| MessageTimes { stamp_ns, log_time_ns: EPOCH_NS + millisecond * MS };
        let now_ns = EPOCH_NS + millisecond * MS;
        if millisecond % 5 == 0 {
            writer.write_imu("/imu", "imu", times(now_ns), &Vector3::zeros(), &Vector3::new(0.0, 0.0, 9.81)).unwrap();
        }
        let number = (millisecond / 50) as usize;
        if millisecond % 50 == 27 && number < stream.messages.len() && !left_out.contains(&number) {
            let stamp_ns = EPOCH_NS + (27 + 50 * stream.order[number] as i64) * MS;
            let data = stream.messages[number];
            match storage {
                Storage::Ros => {
                    let message = encode::compressed_video(stamp_ns, "camera", format, data);
                    writer.write("/camera", MessageKind::CompressedVideo, times(stamp_ns), &message).unwrap();
                }
                Storage::Written => {
                    writer.write_compressed_video("/camera", "camera", times(stamp_ns), format, data).unwrap();
                }
                Storage::Protobuf => {
                    let schema = MessageType {
                        name: "foxglove.CompressedVideo",
                        definition_encoding: "protobuf",
                        definition: b"".as_slice().into(),
                        message_encoding: "protobuf",
                    };
                    writer.write_typed("/camera", &schema, times(stamp_ns), &protobuf(stamp_ns, format, data)).unwrap();
                }
                Storage::Packet => {
                    let message = packet(stamp_ns, &format!("lib{}", format.replace('h', "x")), data);
                    writer.write("/camera", MessageKind::FfmpegPacket, times(stamp_ns), &message).unwrap();
                }
            }
        }
    }
    writer.finish().unwrap();
    (path, stream)
}

/// Log whose `cam0` is an H.264 video of 24 frames with a keyframe in every eighth, its rig, and the CRC-32 of each
/// frame.
pub(crate) fn sample_video(folder: &Path) -> (Arc<FlightLog>, Rig, Vec<u32>) {
    let (path, stream) = write(folder, "h264", Storage::Ros, &[]);
    (Arc::new(FlightLog::open(&path).unwrap()), rig_from(&rig_text()), stream.luma_crc32)
}

pub(crate) fn crc32(image: &GrayImage) -> u32 {
    crc32fast::hash(&image.pixels)
}

#[test]
fn a_video_plays_like_images() {
    for (name, storage) in STORAGES.map(|storage| ("h264", storage)).into_iter().chain([
        ("h265", Storage::Ros),
        ("h265", Storage::Packet),
        ("h264_b_frames", Storage::Packet),
    ]) {
        let folder = TempDir::new().unwrap();
        let (path, stream) = write(folder.path(), name, storage, &[]);
        let (frames, warnings) = play_file(&path, &rig_text(), 0.0);
        assert_eq!(warnings, [], "{name} {storage:?}");
        assert_eq!(frames.len(), 24, "{name} {storage:?}");
        for (place, frame) in frames.iter().enumerate() {
            assert_eq!(frame.stamp_ns, (27 + 50 * place as i64) * MS);
            assert_eq!(stream.order[frame.index], place);
            assert_eq!(crc32(&frame.image), stream.luma_crc32[frame.index], "{name} {storage:?} {place}");
        }
        // A start within a group of pictures decodes from its keyframe.
        let (later, warnings) = play_file(&path, &rig_text(), 0.6);
        assert_eq!((later.len(), warnings), (12, vec![]), "{name} {storage:?}");
        for (frame, expected) in later.iter().zip(&frames[12..]) {
            assert_eq!((frame.index, &frame.image), (expected.index, &expected.image));
        }
    }
}

#[test]
fn frames_are_read_in_any_order() {
    for name in ["h264", "h265", "h264_b_frames"] {
        let folder = TempDir::new().unwrap();
        let (path, stream) = write(folder.path(), name, Storage::Ros, &[]);
        let log = Arc::new(FlightLog::open(&path).unwrap());
        let reader = ImageReader::new(log, &rig_from(&rig_text()));
        assert_eq!(reader.count("cam0"), 24);
        for index in [5, 6, 4, 23, 0, 12, 11, 13, 22, 7, 8] {
            assert_eq!(crc32(&reader.image("cam0", index).unwrap()), stream.luma_crc32[index], "{name} {index}");
        }
        assert!(reader.image("cam0", 24).is_err());
    }
}

#[test]
fn decoding_that_is_ended_goes_on_where_it_stands() {
    let folder = TempDir::new().unwrap();
    let (log, rig, expected) = sample_video(folder.path());
    let reader = ImageReader::new(log, &rig);
    assert!(reader.has_video());
    let remaining = Cell::new(3);
    let go_on = || remaining.replace(remaining.get() - 1) > 0;
    assert!(!reader.decode_before("cam0", 7, &go_on));
    assert_eq!(remaining.replace(5), -1);
    // Frames 3 to 7 remain: five calls of `go_on`, all with the answer true.
    assert!(reader.decode_before("cam0", 7, &go_on));
    assert_eq!(remaining.get(), 0);
    assert!(reader.decode_before("cam0", 2, &go_on), "a decoded frame asks nothing");
    for index in [7, 2] {
        assert_eq!(crc32(&reader.image("cam0", index).unwrap()), expected[index]);
    }
}

/// An unreadable message ends the stream both for the images of the window and for the frames of a run.
#[test]
fn frames_behind_an_unreadable_message_are_missing() {
    for name in ["h264", "h265"] {
        let folder = TempDir::new().unwrap();
        let stream = stream(name);
        let damaged = folder.path().join("damaged.mcap");
        let mut writer = LogWriter::create(&damaged, &LogWriterOptions::default()).unwrap();
        for (number, data) in stream.messages.iter().enumerate() {
            let stamp_ns = EPOCH_NS + 50 * number as i64 * MS;
            let times = MessageTimes { stamp_ns, log_time_ns: stamp_ns };
            let mut message = encode::compressed_video(stamp_ns, "camera", name, data);
            if number == 3 {
                message.truncate(20);
            }
            writer.write("/camera", MessageKind::CompressedVideo, times, &message).unwrap();
        }
        writer.finish().unwrap();
        let reader = ImageReader::new(Arc::new(FlightLog::open(&damaged).unwrap()), &rig_from(&rig_text()));
        let readable: Vec<usize> = (0..24).filter(|index| reader.image("cam0", *index).is_ok()).collect();
        assert_eq!(readable, (0..3).chain(8..24).collect::<Vec<_>>(), "{name}");
    }
}

#[test]
fn frames_behind_a_lost_one_are_left_out_up_to_the_next_keyframe() {
    let folder = TempDir::new().unwrap();
    let (path, stream) = write(folder.path(), "h264", Storage::Ros, &[11]);
    let (frames, warnings) = play_file(&path, &rig_text(), 0.0);
    let stamps: Vec<i64> = frames.iter().map(|frame| (frame.stamp_ns / MS - 27) / 50).collect();
    assert_eq!(stamps, (0..11).chain(16..24).collect::<Vec<_>>());
    for frame in &frames {
        let place = ((frame.stamp_ns / MS - 27) / 50) as usize;
        assert_eq!(crc32(&frame.image), stream.luma_crc32[place]);
    }
    let warning = warning_with(&warnings, &["/camera: 4 messages from 0.627 s to 0.777 s dropped"]);
    assert!(warning.message.contains("the frame cannot be decoded"), "{}", warning.message);
    let log = FlightLog::open(&path).unwrap();
    let (read, missing) = missing_frames(&log, "/camera", MessageKind::CompressedVideo, 100);
    // Message 11 is the first one after the lost frame; the keyframe is message 15.
    assert_eq!((read, missing.len()), (23, 1));
    assert_eq!((missing[0].first, missing[0].count), (11, 4));
    assert!(missing[0].problem.contains("missing"), "{}", missing[0].problem);
    assert_eq!(missing_frames(&log, "/camera", MessageKind::CompressedVideo, 11), (11, Vec::new()));
    let reader = ImageReader::new(Arc::new(FlightLog::open(&path).unwrap()), &rig_from(&rig_text()));
    let error = reader.image("cam0", 13).unwrap_err().to_string();
    assert!(error.contains("damaged or missing"), "{error}");
    assert!(reader.image("cam0", 15).is_ok());
}

#[test]
fn a_video_without_a_keyframe_or_of_another_compression_is_named() {
    let folder = TempDir::new().unwrap();
    let (path, _) = write(folder.path(), "h264", Storage::Ros, &[0, 8, 16]);
    let (frames, warnings) = play_file(&path, &rig_text(), 0.0);
    assert!(frames.is_empty());
    warning_with(&warnings, &["/camera: 21 messages", "it depends on a damaged or missing frame"]);
    let path = folder.path().join("other.mcap");
    let mut writer = LogWriter::create(&path, &LogWriterOptions::default()).unwrap();
    for number in 0..10 {
        let times = MessageTimes { stamp_ns: EPOCH_NS + number * MS, log_time_ns: EPOCH_NS + number * MS };
        writer.write_imu("/imu", "imu", times, &Vector3::zeros(), &Vector3::zeros()).unwrap();
        writer.write_compressed_video("/camera", "camera", times, "vp9", &[1, 2, 3]).unwrap();
    }
    writer.finish().unwrap();
    let (_, warnings) = play_file(&path, &rig_text(), 0.0);
    warning_with(&warnings, &["video of format \"vp9\" is not read, expected h264 or h265"]);
}
