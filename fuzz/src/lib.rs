//! Functions that fuzz the readers of external data, each called by the fuzz target of the same name.
//!
//! Each takes the bytes of one input, passes them to the reader as a file or as text, and drops the result: an input is
//! a finding if the reader panics, aborts, runs for seconds, or takes more memory than the fuzzer allows.
//! [`seeds`] writes valid inputs to start from. The integration tests include this file, and call the functions with changed
//! seeds.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};

use dcvins::export::{self, EvaluationOptions};
use dcvins::files::RigFile as _;
use dcvins::files::stills::{read_stills, read_stills_chain};
use dcvins::files::urdf::{CameraAxes, RobotModel};
use dcvins::flight_log::convert::convert;
use dcvins::flight_log::{
    FlightLog, FrameStream, ImageReader, LogWriter, LogWriterOptions, MessageKind, MessageTimes, MessageType,
    RigOfLog as _,
};
use dcvins::log_check;
use dcvins::sensors::Rig;
use dcvins::session::breakpoints::Condition;
use dcvins::session::{RunSpec, SavedSession};
use dcvins::text::Named as _;
use tempfile::TempDir;

pub mod seeds;

/// Rig of the seed logs: a gimballed and a rigid camera of 16 × 12 pixels.
const RIG: &str = include_str!("rig.yaml");

/// Gimbal attitude sources that replace its joint angles, each from the topic of [`topic_of`].
const SOURCES: [&str; 6] = [
    "{topic: /gimbal/quaternion, type: quaternion, frame: earth, axes: frd, vehicle: /vehicle/attitude}",
    "{topic: /pose, type: pose, frame: body, axes: flu, gimbal_axes: rdf}",
    "{topic: /gimbal/angles, type: euler, frame: vehicle, axes: frd, order: yaw=z pitch=x, unit: deg, vehicle: /vehicle/attitude}",
    "{topic: /tf, type: tf, frame: body, axes: flu, parent: base, child: gimbal}",
    "{topic: /gimbal/device, type: mavros, vehicle: /pose}",
    "{topic: /gimbal/status, type: px4, vehicle: /vehicle/attitude}",
];

/// Rig of the seeds with an attitude in place of joint angles.
fn rig_with_source(source: &str) -> String {
    RIG.replace("rostopic: /gimbal/joint_states", &format!("source: {source}"))
}

/// Videos of gimbal cameras.
#[path = "../../tests/it/convert/gimbal_recorders.rs"]
mod gimbal_recorders;
/// Recordings of autopilots and cameras.
#[path = "../../tests/it/convert/recorders.rs"]
mod recorders;

/// First message of an H.264 stream of 96 × 64 pixels.
const KEYFRAME: &[u8] = include_bytes!("../../tests/data/video/h264.bin").as_slice().split_at(859).0;

/// Largest number of images and frames that are read per input.
const MAX_READ: usize = 40;

/// Empty folder that is removed when the value is dropped.
fn folder() -> TempDir {
    tempfile::tempdir().expect("a temporary folder can be made")
}

fn write(path: &Path, bytes: &[u8]) -> PathBuf {
    if let Some(parent) = path.parent() {
        fs::create_dir_all(parent).expect("the folder can be made");
    }
    fs::write(path, bytes).expect("the input can be written");
    path.to_owned()
}

/// Fuzzes a flight log in MCAP: opens and checks it, reads frames and images.
pub fn log(bytes: &[u8]) {
    let folder = folder();
    read_log(&write(&folder.path().join("input.mcap"), bytes));
}

/// Rig of the seeds, and the same rig with each of [`SOURCES`]: parsed once, since that takes longer than most inputs.
static RIGS: LazyLock<(Rig, Vec<Rig>)> = LazyLock::new(|| {
    let parsed = |text: &str| Rig::from_yaml(text, Path::new("rig.yaml")).expect("the rigs of the seeds are valid");
    (parsed(RIG), SOURCES.iter().map(|source| parsed(&rig_with_source(source))).collect())
});

fn read_log(path: &Path) {
    let Ok(log) = FlightLog::open(path).map(Arc::new) else { return };
    let own = Rig::for_log(&log, None);
    drop(log_check::check(&log, own.as_ref(), &[]));
    let (rig, with_sources) = &*RIGS;
    for camera in &rig.cameras {
        if let Ok(frames) = FrameStream::new(Arc::clone(&log), rig, &camera.key, 0.0, None) {
            frames.take(MAX_READ).for_each(drop);
        }
    }
    for rig in with_sources {
        let topic = rig.gimbal.as_ref().and_then(|gimbal| gimbal.topic.as_deref());
        if topic.is_some_and(|topic| log.topic(topic).is_none()) {
            continue;
        }
        drop(log_check::check(&log, Ok(rig), &[]));
        if let Ok(frames) = FrameStream::new(Arc::clone(&log), rig, "cam0", 0.0, None) {
            frames.take(MAX_READ).for_each(drop);
        }
    }
    let images = ImageReader::new(Arc::clone(&log), rig);
    for camera in &rig.cameras {
        for index in 0..images.count(&camera.key).min(MAX_READ) {
            drop(images.image(&camera.key, index));
        }
    }
}

/// Fuzzes a video: the first byte selects H.264 or H.265, followed by its messages (Annex B), each after its length in
/// two bytes.
pub fn video(bytes: &[u8]) {
    let Some((codec, mut rest)) = bytes.split_first() else { return };
    let format = if codec % 2 == 0 { "h264" } else { "h265" };
    let folder = folder();
    let path = folder.path().join("input.mcap");
    let mut writer = LogWriter::create(&path, &LogWriterOptions::default()).expect("the log can be created");
    for index in 0..MAX_READ as i64 {
        let Some(([low, high], behind)) = rest.split_first_chunk() else { break };
        let (message, behind) = behind.split_at(behind.len().min(usize::from(u16::from_le_bytes([*low, *high]))));
        rest = behind;
        let times = MessageTimes { stamp_ns: index, log_time_ns: index };
        let topic = topic_of(MessageKind::CompressedVideo);
        writer.write_compressed_video(topic, "video", times, format, message).expect("the message can be written");
    }
    writer.finish().expect("the log can be finished");
    read_log(&path);
}

/// Fuzzes a message in CDR, wrapped into a log: the first byte selects the type, the rest is the message.
pub fn message(bytes: &[u8]) {
    let Some((kind, message)) = bytes.split_first() else { return };
    let kind = MessageKind::NAMES[usize::from(*kind) % MessageKind::NAMES.len()].0;
    let folder = folder();
    let path = folder.path().join("input.mcap");
    let mut writer = LogWriter::create(&path, &LogWriterOptions::default()).expect("the log can be created");
    let message_type = MessageType { message_encoding: kind.encoding(), ..MessageType::ros2(kind.schema_name(), "") };
    for index in 0..2 {
        let times = MessageTimes { stamp_ns: index, log_time_ns: index };
        writer.write_typed(topic_of(kind), &message_type, times, message).expect("the message can be written");
    }
    writer.finish().expect("the log can be finished");
    read_log(&path);
}

/// Topic of the seed rig that carries messages of a kind.
fn topic_of(kind: MessageKind) -> &'static str {
    match kind {
        MessageKind::Imu => "/imu",
        MessageKind::Image => "/static_camera",
        MessageKind::CompressedImage => "/gimbal_camera",
        MessageKind::CompressedVideo | MessageKind::CompressedVideoProtobuf | MessageKind::FfmpegPacket => "/video",
        MessageKind::CameraInfo => "/gimbal_camera/camera_info",
        MessageKind::JointState => "/gimbal/joint_states",
        MessageKind::Odometry => "/ground_truth/odometry",
        MessageKind::PoseStamped => "/pose",
        MessageKind::TransformStamped => "/transform",
        MessageKind::QuaternionStamped => "/gimbal/quaternion",
        MessageKind::Vector3Stamped => "/gimbal/angles",
        MessageKind::Transforms => "/tf",
        MessageKind::MavrosGimbalAttitude => "/gimbal/device",
        MessageKind::Px4GimbalAttitude => "/gimbal/status",
        MessageKind::Px4VehicleAttitude => "/vehicle/attitude",
    }
}

/// Converts a source under a file name that its reader recognizes.
fn converted(name: &str, bytes: &[u8]) {
    let folder = folder();
    let source = write(&folder.path().join(name), bytes);
    let output = folder.path().join("output.mcap");
    drop(convert(&source, &output, &mut |_| {}));
}

pub fn bag(bytes: &[u8]) {
    converted("input.bag", bytes);
}

pub fn dataflash(bytes: &[u8]) {
    converted("input.bin", bytes);
}

pub fn ulog(bytes: &[u8]) {
    converted("input.ulg", bytes);
}

/// Fuzzes a telemetry log of a ground station.
pub fn tlog(bytes: &[u8]) {
    converted("input.tlog", bytes);
}

/// Fuzzes an MP4 video.
pub fn movie(bytes: &[u8]) {
    converted("input.mp4", bytes);
}

/// Valid inputs of the five targets of recordings: target, name, bytes.
fn recordings() -> Vec<(&'static str, &'static str, Vec<u8>)> {
    let track = |axes: &str| recorders::telemetry_track(recorders::telemetry(6, axes));
    let video = || recorders::video_track(&[KEYFRAME], [96, 64]);
    let payload = recorders::telemetry(1, "YxZ").concat();
    vec![
        ("dataflash", "flight", recorders::dataflash(30)),
        ("ulog", "flight", recorders::ulog(30)),
        ("tlog", "flight", recorders::telemetry_log(30)),
        ("movie", "tables-first", recorders::movie(&[video(), track("ZXY")], true)),
        ("movie", "tables-last", recorders::movie(&[track("YxZ"), video()], false)),
        ("movie", "fragments", gimbal_recorders::fragmented(&video())),
        ("movie", "gimbal", gimbal_video()),
        ("dataflash", "gimbal", gimbal_recorders::camera_log(5, [0.5, -30.0, 12.5])),
        ("gpmf", "camera", payload),
        ("gpmf", "receiver", receiver()),
    ]
}

/// MP4 video with every telemetry of a gimbal camera: a message in its frame, a subtitle and packets of its motion.
fn gimbal_video() -> Vec<u8> {
    let mut video = recorders::video_track(&[KEYFRAME], [96, 64]);
    let message = r#"{"schema":"apcg.telemetry.v1","utc_us":1717977600000000,"hfov_deg":71.5,
        "position":{"lat_e7":470000000,"lon_e7":80000000,"alt_amsl_m":500.0,"age_ms":5},
        "vehicle_attitude":{"roll_rad":0.02,"pitch_rad":-0.05,"yaw_rad":1.5,"age_ms":12},
        "gimbal_attitude":{"roll_rad":0.0,"pitch_rad":-0.5,"yaw_rad":0.1,"age_ms":30}}"#;
    gimbal_recorders::with_message(&mut video.samples[0], message);
    let subtitle = "2026-05-01_10-11-12 stream->FrameCnt:0 \nlatitude:N47°0′0″, longitude:E8°0′0″\nabs_alt:500\n\
                    gb_yaw:1, gb_pitch:-30, gb_roll:0\nmix_ratio:1";
    let packets: Vec<(u16, Vec<u8>)> = (0..8).map(|kind| (kind, vec![0x40; 56])).collect();
    let tracks =
        [video, gimbal_recorders::subtitle_track(&[subtitle.to_owned()]), gimbal_recorders::motion_track(&packets)];
    recorders::movie(&tracks, true)
}

/// GPMF payload of a camera with a satellite receiver and of a Karma drone.
fn receiver() -> Vec<u8> {
    use recorders::{item, nested};
    let words = |values: &[i32]| values.iter().flat_map(|value| value.to_be_bytes()).collect::<Vec<u8>>();
    let floats = |values: &[f32]| values.iter().flat_map(|value| value.to_be_bytes()).collect::<Vec<u8>>();
    let fix = [
        item(b"GPSF", b'L', 4, &words(&[3])),
        item(b"GPSU", b'U', 16, b"240610000000.000"),
        item(b"SCAL", b'l', 4, &words(&[10_000_000, 10_000_000, 1000, 1000, 100])),
        item(b"GPS5", b'l', 20, &words(&[470_000_000, 80_000_000, 500_000, 0, 0])),
    ];
    let attitude = [
        item(b"TYPE", b'c', 1, b"Lfff"),
        item(b"SCAL", b'l', 4, &words(&[1000, 1, 1, 1])),
        item(b"ATTD", b'?', 16, &[words(&[5000]), floats(&[0.1, -0.2, 1.5])].concat()),
    ];
    nested(b"DEVC", &[nested(b"STRM", &fix), nested(b"STRM", &attitude)])
}

/// Fuzzes the second and last telemetry payload of an MP4 video.
pub fn gpmf(bytes: &[u8]) {
    let video = recorders::video_track(&[KEYFRAME], [96, 64]);
    let mut payloads = recorders::telemetry(1, "ZXY");
    payloads.push(bytes.to_vec());
    converted("input.mp4", &recorders::movie(&[video, recorders::telemetry_track(payloads)], true));
}

/// Fuzzes an SQLite file of a ROS 2 bag.
pub fn database(bytes: &[u8]) {
    converted("input.db3", bytes);
}

/// Files of an `EuRoC` folder, each with valid content, in the order of the first byte of an input of [`euroc`].
const EUROC_FILES: [(&str, &str); 6] = [
    (
        "imu0/data.csv",
        "#timestamp [ns],w_x,w_y,w_z,a_x,a_y,a_z\n1000,0.1,0.2,0.3,9.8,0.1,0.2\n6000,0.1,0.2,0.3,9.8,0.1,0.2\n",
    ),
    (
        "imu0/sensor.yaml",
        "sensor_type: imu\nT_BS:\n  cols: 4\n  rows: 4\n  data: [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]\n\
         rate_hz: 200\ngyroscope_noise_density: 1.6968e-04\ngyroscope_random_walk: 1.9393e-05\n\
         accelerometer_noise_density: 2.0000e-3\naccelerometer_random_walk: 3.0000e-3\n",
    ),
    ("cam0/data.csv", "#timestamp [ns],filename\n1000,1000.png\n6000,6000.png\n"),
    (
        "cam0/sensor.yaml",
        "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [0.0, -1.0, 0.0, -0.02, 1.0, 0.0, 0.0, -0.06, 0.0, 0.0, 1.0, 0.01, 0.0, 0.0, 0.0, 1.0]\n\
         rate_hz: 20\nresolution: [16, 12]\ncamera_model: pinhole\nintrinsics: [10.0, 10.0, 8.0, 6.0]\n\
         distortion_model: radial-tangential\ndistortion_coefficients: [-0.28, 0.07, 0.0002, 1.8e-05]\n",
    ),
    (
        "state_groundtruth_estimate0/data.csv",
        "#timestamp,p_x,p_y,p_z,q_w,q_x,q_y,q_z\n1000,1,2,3,1,0,0,0,0,0,0,0,0,0,0,0,0\n",
    ),
    ("cam0/data/1000.png", "no image"),
];

/// Fuzzes an `EuRoC` folder with one file replaced: the first byte selects the file, the rest is its content.
pub fn euroc(bytes: &[u8]) {
    let Some((picked, content)) = bytes.split_first() else { return };
    let picked = usize::from(*picked) % EUROC_FILES.len();
    let folder = folder();
    for (index, (name, valid)) in EUROC_FILES.iter().enumerate() {
        let content = if index == picked { content } else { valid.as_bytes() };
        write(&folder.path().join("mav0").join(name), content);
    }
    drop(convert(folder.path(), &folder.path().join("output.mcap"), &mut |_| {}));
}

/// Fuzzes a rig in the program's format or in Kalibr's; a rig that was read and written must be readable again.
pub fn rig(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(rig) = Rig::from_yaml(text, Path::new("rig.yaml")) else { return };
    Rig::from_yaml(&rig.to_yaml(), Path::new("rig.yaml")).expect("a rig that was written can be read");
}

/// Fuzzes a file of stills, and of a chain for it.
pub fn stills(bytes: &[u8]) {
    let folder = folder();
    let path = write(&folder.path().join("input.json"), bytes);
    if let Ok(stills) = read_stills(&path) {
        drop(read_stills_chain(&path, &stills));
    }
}

/// Fuzzes a robot description: the chain between its first and its last link, and the same chain written back.
pub fn urdf(bytes: &[u8]) {
    let Ok(text) = String::from_utf8(bytes.to_vec()) else { return };
    let Ok(model) = RobotModel::parse(text, Path::new("robot.urdf")) else { return };
    let (Some(first), Some(last)) = (model.links.first(), model.links.last()) else { return };
    let Ok(path) = model.path(first, last, CameraAxes::Optical) else { return };
    let names: Vec<String> = path.joints().map(|joint| joint.name.clone()).collect();
    if let Ok((written, _)) = path.with_calibration(&names, &path.chain()) {
        RobotModel::parse(written, Path::new("robot.urdf")).expect("a description that was written can be read");
    }
}

pub fn session(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    if let Ok(session) = SavedSession::from_text(text) {
        drop(session.request());
        for breakpoint in &session.breakpoints {
            drop(breakpoint.condition.parse::<Condition>());
        }
    }
}

/// Fuzzes texts of the command line: the condition of a breakpoint, and the specification of a run.
pub fn condition(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    drop(text.parse::<Condition>());
    drop(text.parse::<RunSpec>());
}

/// Fuzzes a TUM trajectory that is evaluated against a reference of five poses.
pub fn trajectory(bytes: &[u8]) {
    let folder = folder();
    let estimate = write(&folder.path().join("input.tum"), bytes);
    let poses = [1, 2, 3, 4, 5].map(|stamp_s| format!("{stamp_s}.0 {} 0 0 0 0 0 1\n", stamp_s - 1));
    let reference = write(&folder.path().join("reference.tum"), poses.concat().as_bytes());
    drop(export::evaluate(&estimate, &reference, &EvaluationOptions::default()));
}
