//! Seed corpus: valid inputs of every fuzz target.

#[path = "../../tests/it/convert/ros1.rs"]
mod ros1;

use std::fs;
use std::path::{Path, PathBuf};

use dcvins::camera::{CameraModel, Distortion, Projection};
use dcvins::files::RigFile as _;
use dcvins::flight_log::{
    LogCompression, LogWriter, LogWriterOptions, MessageKind, MessageTimes, MessageType, Odometry,
};
use dcvins::geometry::RigidTransform;
use dcvins::sensors::Rig;
use dcvins::text::Named as _;
use nalgebra::Vector3;
use ros1::{Compression, Message, bag, f64_sequence, f64s, header, text};
use rusqlite::Connection;

use super::{EUROC_FILES, RIG, SOURCES, recordings, rig_with_source, topic_of};

type Failed = Box<dyn std::error::Error>;

/// H.264 stream, with the size of its first message and the end of its second.
const VIDEO: &[u8] = include_bytes!("../../tests/data/video/h264.bin");
const VIDEO_LISTING: &str = include_str!("../../tests/data/video/streams.json");
const KEYFRAME_BYTES: usize = 859;
const PICTURE_END: usize = 979;
/// Header stamp of the first message.
const EPOCH_NS: i64 = 1_700_000_000_250_000_000;
/// Stills of one joint: six points in each of two cameras.
const STILLS: &str = r#"{"format": "acdcc-stills 1", "joints": ["yaw"], "static_cameras": ["front"],
  "cameras": {"front": {"resolution": [64, 48], "intrinsics": [50, 50, 32, 24]},
    "gimbal": {"resolution": [64, 48], "intrinsics": [50, 50, 32, 24], "distortion_model": "none"}},
  "initial_chain": {"T_I_B": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]],
    "links": [{"joint": "yaw", "theta_offset": 0, "d": 0.1, "a": 0, "alpha": 0}],
    "T_E_C": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]},
  "sets": [{"id": 1, "station": 1, "joint_angles_rad": [0.1], "views": {
    "front": {"points": [[0, 0, 2, 32, 24], [1, 0, 2, 57, 24], [0, 1, 2, 32, 49], [1, 1, 4, 44, 36], [1, 0, 4, 44, 24],
      [0, 1, 4, 32, 36]]},
    "gimbal": {"T_camera_world": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]],
      "points": [[0, 0, 2, 32, 24], [1, 0, 2, 57, 24], [0, 1, 2, 32, 49], [1, 1, 4, 44, 36], [1, 0, 4, 44, 24],
        [0, 1, 4, 32, 36]]}}}]}"#;
/// Robot descriptions.
const DESCRIPTIONS: [(&str, &str); 3] = [
    ("arm-camera", include_str!("../../tests/data/urdf/arm_camera.urdf")),
    ("pan-tilt", include_str!("../../tests/data/urdf/pan_tilt.urdf")),
    ("three-axis-gimbal", include_str!("../../tests/data/urdf/three_axis_gimbal.urdf")),
];
/// Width and height of the images.
const RESOLUTION_PX: [usize; 2] = [16, 12];
/// PNG image of 16 × 12 gray pixels, all 0.
const PNG: &[u8] = include_bytes!("gray.png");

fn times(index: i64) -> MessageTimes {
    let stamp_ns = EPOCH_NS + 5_000_000 * index;
    MessageTimes { stamp_ns, log_time_ns: stamp_ns + 1_000_000 }
}

/// Writes a log with messages of every type over 0.5 s.
fn write_log(path: &Path, options: &LogWriterOptions) -> Result<(), Failed> {
    let mut log = LogWriter::create(path, options)?;
    let camera = CameraModel {
        projection: Projection::Pinhole,
        intrinsics_px: [10.0, 10.0, 8.0, 6.0],
        distortion: Distortion::None,
        resolution_px: RESOLUTION_PX,
    };
    let pose = RigidTransform::identity();
    let (rate, force) = (Vector3::new(0.1, -0.2, 0.3), Vector3::new(0.0, 0.1, 9.8));
    let odometry =
        Odometry { linear_m_per_s: force, angular_rad_per_s: rate, ..Odometry::at_rest("world", "imu", pose) };
    let joints = ["yaw".to_owned(), "pitch".to_owned()];
    log.write_camera_info("/gimbal_camera/camera_info", "gimbal_camera", times(0), &camera)?;
    for index in 0..100 {
        log.write_imu(topic_of(MessageKind::Imu), "imu", times(index), &rate, &force)?;
        log.write_joints(topic_of(MessageKind::JointState), times(index), &joints, &[0.01 * index as f64, 0.2])?;
        if index % 10 == 0 {
            let pixels: Vec<u8> = (0..16 * 12).map(|pixel| (pixel * index % 251) as u8).collect();
            log.write_compressed_image(
                topic_of(MessageKind::CompressedImage),
                "gimbal_camera",
                times(index),
                "png",
                PNG,
            )?;
            log.write_raw_image(
                topic_of(MessageKind::Image),
                "static_camera",
                times(index),
                RESOLUTION_PX,
                "mono8",
                &pixels,
            )?;
            // A keyframe and a frame that depends on it.
            let picture = if index % 20 == 0 { &VIDEO[..KEYFRAME_BYTES] } else { &VIDEO[KEYFRAME_BYTES..PICTURE_END] };
            log.write_compressed_video(topic_of(MessageKind::CompressedVideo), "video", times(index), "h264", picture)?;
            log.write_odometry(topic_of(MessageKind::Odometry), times(index), &odometry)?;
            log.write_pose(topic_of(MessageKind::PoseStamped), "world", times(index), &pose)?;
            log.write_transform(topic_of(MessageKind::TransformStamped), "world", "imu", times(index), &pose)?;
            write_attitudes(&mut log, times(index))?;
        }
    }
    log.attach("seed.rig.yaml", "application/yaml", RIG, EPOCH_NS)?;
    log.finish()?;
    Ok(())
}

/// Message in CDR, little-endian.
struct Cdr(Vec<u8>);

impl Cdr {
    fn put<const N: usize>(mut self, values: &[[u8; N]]) -> Self {
        for value in values {
            self.0.resize((self.0.len() - 4).next_multiple_of(N) + 4, 0);
            self.0.extend_from_slice(value);
        }
        self
    }

    fn text(self, text: &str) -> Self {
        let mut out = self.put(&[(text.len() as u32 + 1).to_le_bytes()]);
        out.0.extend_from_slice(text.as_bytes());
        out.0.push(0);
        out
    }

    fn header(self, stamp_ns: i64, frame: &str) -> Self {
        let (seconds, rest) = ((stamp_ns / 1_000_000_000) as i32, (stamp_ns % 1_000_000_000) as u32);
        self.put(&[seconds.to_le_bytes()]).put(&[rest.to_le_bytes()]).text(frame)
    }

    fn f64s(self, values: &[f64]) -> Self {
        values.iter().fold(self, |out, value| out.put(&[value.to_le_bytes()]))
    }

    fn f32s(self, values: &[f32]) -> Self {
        values.iter().fold(self, |out, value| out.put(&[value.to_le_bytes()]))
    }
}

/// Writes the attitude of gimbal and vehicle in every supported message type.
fn write_attitudes(log: &mut LogWriter, times: MessageTimes) -> Result<(), Failed> {
    let start = || Cdr(vec![0, 1, 0, 0]);
    let stamp_ns = times.stamp_ns;
    let boot = (stamp_ns as u64 / 1000).to_le_bytes();
    let rotation = [0.1, -0.2, 0.3, 0.927];
    let px4_rotation = [0.927_f32, 0.1, -0.2, 0.3];
    let transforms = start()
        .put(&[2_u32.to_le_bytes()])
        .header(stamp_ns, "base")
        .text("yaw")
        .f64s(&[0.0; 3])
        .f64s(&rotation)
        .header(stamp_ns, "/yaw")
        .text("gimbal")
        .f64s(&[0.0; 3])
        .f64s(&rotation);
    let flags = 12_u16.to_le_bytes();
    let device = start().header(stamp_ns, "").put(&[[1], [154]]).put(&[flags]).f64s(&rotation).f32s(&[0.0; 3]);
    let status = start().put(&[boot]).put(&[[1], [154]]).put(&[flags]).f32s(&px4_rotation).f32s(&[0.0; 6]);
    let messages = [
        (MessageKind::QuaternionStamped, start().header(stamp_ns, "earth").f64s(&rotation)),
        (MessageKind::Vector3Stamped, start().header(stamp_ns, "").f64s(&[-20.0, 1.0, 90.0])),
        (MessageKind::Transforms, transforms),
        (MessageKind::MavrosGimbalAttitude, device.put(&[[0; 4]])),
        (MessageKind::Px4GimbalAttitude, status),
        (MessageKind::Px4VehicleAttitude, start().put(&[boot, boot]).f32s(&px4_rotation).f32s(&[0.0; 4])),
    ];
    for (kind, message) in messages {
        log.write_typed(topic_of(kind), &MessageType::ros2(kind.schema_name(), ""), times, &message.0)?;
    }
    Ok(())
}

/// Folder of a target's seeds.
fn target(corpus: &Path, name: &str) -> Result<PathBuf, Failed> {
    let folder = corpus.join(name);
    fs::create_dir_all(&folder)?;
    Ok(folder)
}

fn logs(corpus: &Path) -> Result<PathBuf, Failed> {
    let folder = target(corpus, "log")?;
    for compression in [LogCompression::None, LogCompression::Lz4, LogCompression::Zstd] {
        for indexed in [true, false] {
            for chunk_bytes in [Some(2048), None] {
                let name = format!("{compression:?}-{indexed}-{}", chunk_bytes.is_some()).to_lowercase();
                let options = LogWriterOptions { compression, indexed, chunk_bytes };
                write_log(&folder.join(name), &options)?;
            }
        }
    }
    Ok(folder.join("none-true-true"))
}

/// Writes one message of each type of a log as an input of the target `message`.
fn messages(corpus: &Path, log: &Path) -> Result<(), Failed> {
    let folder = target(corpus, "message")?;
    let file = fs::read(log)?;
    for message in mcap::MessageStream::new(&file)? {
        let message = message?;
        let name = message.channel.schema.as_ref().map_or("", |schema| schema.name.as_str());
        if let Some(kind) = MessageKind::NAMES.iter().position(|(_, known)| *known == name) {
            let input = [&[kind as u8], message.data.as_ref()].concat();
            fs::write(folder.join(name.replace('/', "-")), input)?;
        }
    }
    Ok(())
}

/// Writes the streams of the tests as inputs of the target `video`.
fn videos(corpus: &Path) -> Result<(), Failed> {
    let folder = target(corpus, "video")?;
    let streams: [(&str, u8, &[u8]); 4] = [
        ("h264", 0, VIDEO),
        ("h264_10_bit", 0, include_bytes!("../../tests/data/video/h264_10_bit.bin")),
        ("h264_b_frames", 0, include_bytes!("../../tests/data/video/h264_b_frames.bin")),
        ("h265", 1, include_bytes!("../../tests/data/video/h265.bin")),
    ];
    for (name, codec, mut rest) in streams {
        // The sizes of the messages are the first list of numbers after the name.
        let listing = VIDEO_LISTING.split_once(&format!("\"{name}\":")).ok_or("no such stream")?.1;
        let sizes = listing.split_once('[').and_then(|(_, numbers)| numbers.split_once(']')).ok_or("no sizes")?.0;
        let mut input = vec![codec];
        for size in sizes.split(',') {
            let (message, behind) = rest.split_at(size.trim().parse()?);
            input.extend(u16::try_from(message.len())?.to_le_bytes());
            input.extend(message);
            rest = behind;
        }
        fs::write(folder.join(name), input)?;
    }
    Ok(())
}

fn bags(corpus: &Path) -> Result<(), Failed> {
    let folder = target(corpus, "bag")?;
    let covariance = f64s(&[0.0; 9]);
    let mut messages = Vec::new();
    for index in 0..4_i64 {
        let stamp_ns = times(index).stamp_ns;
        let imu = [
            header(stamp_ns, "imu"),
            f64s(&[0.0, 0.0, 0.0, 1.0]),
            covariance.clone(),
            f64s(&[0.1, -0.2, 0.3]),
            covariance.clone(),
            f64s(&[0.0, 0.1, 9.8]),
            covariance.clone(),
        ];
        messages.push(Message {
            topic: "/imu",
            message_type: "sensor_msgs/Imu",
            time_ns: stamp_ns,
            data: imu.concat(),
        });
        let joints = [
            header(stamp_ns, ""),
            2_u32.to_le_bytes().to_vec(),
            text("yaw"),
            text("pitch"),
            f64_sequence(&[0.1, 0.2]),
            f64_sequence(&[]),
            f64_sequence(&[]),
        ];
        let joint_state = "sensor_msgs/JointState";
        messages.push(Message {
            topic: "/joints",
            message_type: joint_state,
            time_ns: stamp_ns,
            data: joints.concat(),
        });
        let image = [header(stamp_ns, "camera"), text("png"), (PNG.len() as u32).to_le_bytes().to_vec(), PNG.to_vec()];
        let compressed = "sensor_msgs/CompressedImage";
        messages.push(Message { topic: "/camera", message_type: compressed, time_ns: stamp_ns, data: image.concat() });
    }
    for compression in [Compression::None, Compression::Bz2, Compression::Lz4] {
        let name = format!("{compression:?}").to_lowercase();
        fs::write(folder.join(name), bag(&messages, 3, compression, ""))?;
    }
    Ok(())
}

fn databases(corpus: &Path, log: &Path) -> Result<(), Failed> {
    let path = target(corpus, "database")?.join("two-topics");
    if path.exists() {
        fs::remove_file(&path)?;
    }
    let database = Connection::open(&path)?;
    database.execute_batch(
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,
             serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);
         CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL,
             data BLOB NOT NULL);",
    )?;
    let file = fs::read(log)?;
    for message in mcap::MessageStream::new(&file)?.take(60) {
        let message = message?;
        let name = message.channel.schema.as_ref().map_or("", |schema| schema.name.as_str());
        let topic = (i64::from(message.channel.id), &message.channel.topic, name);
        database.execute("INSERT OR IGNORE INTO topics VALUES (?1, ?2, ?3, 'cdr', '')", topic)?;
        let row = (i64::from(message.channel.id), message.log_time as i64, message.data.as_ref());
        database.execute("INSERT INTO messages (topic_id, timestamp, data) VALUES (?1, ?2, ?3)", row)?;
    }
    Ok(())
}

/// Writes the seeds of the targets that read text.
fn texts(corpus: &Path) -> Result<(), Failed> {
    let descriptions = target(corpus, "urdf")?;
    for (name, description) in DESCRIPTIONS {
        fs::write(descriptions.join(name), description)?;
    }
    let rigs = target(corpus, "rig")?;
    fs::write(rigs.join("commented"), RIG)?;
    for (number, source) in SOURCES.iter().enumerate() {
        fs::write(rigs.join(format!("source-{number}")), rig_with_source(source))?;
    }
    fs::write(rigs.join("written"), Rig::from_yaml(RIG, Path::new("rig.yaml"))?.to_yaml())?;
    fs::write(
        rigs.join("kalibr"),
        "cam0:\n  T_cam_imu:\n  - [0.0, -1.0, 0.0, 0.0]\n  - [0.0, 0.0, -1.0, 0.05]\n  - [1.0, 0.0, 0.0, -0.09]\n  \
         - [0.0, 0.0, 0.0, 1.0]\n  cam_overlaps: []\n  camera_model: pinhole\n  \
         distortion_coeffs: [-0.28, 0.07, 0.0002, 0.00002]\n  distortion_model: radtan\n  \
         intrinsics: [458.6, 457.2, 367.2, 248.3]\n  resolution: [752, 480]\n  rostopic: /cam0/image_raw\n  \
         timeshift_cam_imu: 0.001\n",
    )?;
    let session = "{\"session_version\": 1, \"log\": {\"path\": \"a.mcap\", \"size_bytes\": 1, \"checksum\": 2}, \
                   \"rig\": null, \"truth\": null, \"start_s\": 0.0, \"duration_s\": null, \"runs\": [], \"forks\": [], \
                   \"breakpoints\": [{\"condition\": \"rank drops and sigma(yaw.alpha) > 0.1 deg\", \"enabled\": true}]}";
    fs::write(target(corpus, "session")?.join("session"), session)?;
    let conditions = target(corpus, "condition")?;
    let valid = [
        "rank drops",
        "sigma(yaw.alpha) > 0.1 and not keyframe",
        "(features < 20 or chi2 >= 3.5) and event(restart)",
        "auto:encoder=off,calibrate=off,window=12,name=a",
        "minimal-swapped:timeshift=on",
    ];
    for (index, text) in valid.iter().enumerate() {
        fs::write(conditions.join(index.to_string()), text)?;
    }
    let tum = "# stamp x y z qx qy qz qw\n1.0 0 0 0 0 0 0 1\n2.0 1 0 0.5 0 0 0.7071068 0.7071068\n3.0 2 0 1 0 0 1 0\n";
    fs::write(target(corpus, "trajectory")?.join("two-poses"), tum)?;
    fs::write(target(corpus, "stills")?.join("one-set"), STILLS)?;
    let folder = target(corpus, "euroc")?;
    for (index, (name, content)) in EUROC_FILES.iter().enumerate() {
        fs::write(folder.join(name.replace('/', "-")), [&[index as u8], content.as_bytes()].concat())?;
    }
    fs::write(folder.join("image"), [&[5_u8], PNG].concat())?;
    Ok(())
}

/// Writes the seeds of every target as `CORPUS/TARGET/NAME`.
///
/// # Errors
///
/// A file that cannot be written.
pub fn write(corpus: &Path) -> Result<(), Failed> {
    let log = logs(corpus)?;
    messages(corpus, &log)?;
    videos(corpus)?;
    bags(corpus)?;
    databases(corpus, &log)?;
    for (name, seed, bytes) in recordings() {
        fs::write(target(corpus, name)?.join(seed), bytes)?;
    }
    texts(corpus)
}
