//! A camera with an IMU of its own beside the log of an autopilot: both IMUs reach the rig, on a gimbal without recorded
//! angles as `imu1`.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use dcvins::files::RigFile as _;
use dcvins::flight_log::{FlightLog, FrameStream};
use dcvins::geometry::so3;
use dcvins::sensors::{CameraMount, Rig};
use nalgebra::{UnitQuaternion, Vector3};

use super::recorders::{floats, item, movie, nested, telemetry_track};
use super::recordings::video;

/// Length of the autopilot's log, and start of the video in it, in seconds.
const LENGTH_S: f64 = 30.0;
const VIDEO_START_S: f64 = 6.137;
/// Rate of both IMUs, and samples of a payload of 200 ms.
const RATE_HZ: f64 = 200.0;
const SAMPLES_PER_PAYLOAD: usize = 40;
/// Position of the camera in the vehicle, in metres.
const ARM_M: [f64; 3] = [0.15, 0.02, -0.08];

/// Rotation of the vehicle (forward, left, up) in the world.
fn vehicle(time_s: f64) -> UnitQuaternion<f64> {
    let roll = 0.2 * (1.3 * time_s).sin() + 0.05 * (4.1 * time_s).sin();
    let pitch = 0.15 * (0.9 * time_s + 0.4).sin();
    UnitQuaternion::from_euler_angles(roll, pitch, 0.5 * (0.31 * time_s).sin() + 0.1 * (2.3 * time_s).sin())
}

/// Rotation of the camera in the vehicle, which a gimbal changes.
fn gimbal(time_s: f64, moves: bool) -> UnitQuaternion<f64> {
    if !moves {
        return UnitQuaternion::from_euler_angles(0.0, 0.3, 0.1);
    }
    UnitQuaternion::from_euler_angles(
        0.1 * (1.1 * time_s).cos(),
        0.4 * (0.7 * time_s).sin(),
        0.6 * (0.5 * time_s).sin(),
    )
}

/// Position of the vehicle in metres: it starts and stops along irregular curves.
fn position(time_s: f64) -> Vector3<f64> {
    let t = time_s;
    Vector3::new(
        1.5 * (0.8 * t).sin() + 0.2 * (2.9 * t + 1.0).sin(),
        1.0 * (0.55 * t + 0.3).sin() + 0.15 * (3.7 * t).sin(),
        0.6 * (1.7 * t + 0.5).sin() + 0.1 * (0.13 * t * t).sin(),
    )
}

/// Angular rate in rad/s and specific force in m/s² of a body with this orientation and position.
fn imu(
    orientation: impl Fn(f64) -> UnitQuaternion<f64>,
    place: impl Fn(f64) -> Vector3<f64>,
    time_s: f64,
) -> [Vector3<f64>; 2] {
    const STEP_S: f64 = 1e-3;
    let turned = orientation(time_s - STEP_S).inverse() * orientation(time_s + STEP_S);
    let acceleration = (place(time_s + STEP_S) - 2.0 * place(time_s) + place(time_s - STEP_S)) / (STEP_S * STEP_S);
    let force = acceleration + Vector3::new(0.0, 0.0, 9.81);
    [so3::log(&turned) / (2.0 * STEP_S), orientation(time_s).inverse() * force]
}

/// `ULog` of the vehicle's IMU, forward, right, down.
fn autopilot() -> Vec<u8> {
    let mut out = vec![0x55, 0x4C, 0x6F, 0x67, 0x01, 0x12, 0x35, 1];
    out.extend(0_u64.to_le_bytes());
    let mut put = |kind: u8, parts: &[&[u8]]| {
        let content = parts.concat();
        out.extend((content.len() as u16).to_le_bytes());
        out.push(kind);
        out.extend(content);
    };
    put(b'B', &[&[0; 40]]);
    let format =
        "sensor_combined:uint64_t timestamp;float[3] gyro_rad;uint32_t gyro_integral_dt;float[3] accelerometer_m_s2;";
    put(b'F', &[format.as_bytes()]);
    put(b'A', &[&[0, 0, 0], b"sensor_combined"]);
    for sample in 0..(LENGTH_S * RATE_HZ) as u64 {
        let time_s = sample as f64 / RATE_HZ;
        let down = |vector: Vector3<f64>| floats(&[vector.x, -vector.y, -vector.z]);
        let [rate, force] = imu(vehicle, position, time_s).map(down);
        let time_us = (1_000_000 + (1e6 * time_s).round() as u64).to_le_bytes();
        put(b'D', &[&[0, 0], &time_us, &rate, &5000_u32.to_le_bytes(), &force]);
    }
    out
}

/// MP4 with 24 frames and the camera's IMU until 20 s after its start.
fn camera(moves: bool) -> Vec<u8> {
    let orientation = |time_s: f64| vehicle(time_s) * gimbal(time_s, moves);
    let place = |time_s: f64| position(time_s) + vehicle(time_s) * Vector3::from(ARM_M);
    let sample = |index: usize| imu(orientation, place, VIDEO_START_S + index as f64 / RATE_HZ);
    // GoPro's X points to the left of the camera, Y back and Z up.
    let stored = |vector: Vector3<f64>, scale: f64| -> Vec<u8> {
        let axes = [vector.y, -vector.x, vector.z];
        axes.iter().flat_map(|value| ((value * scale).round() as i16).to_be_bytes()).collect()
    };
    let payload = |number: usize| {
        let stream = |key: &[u8; 4], which: usize, scale: i16| {
            let range = number * SAMPLES_PER_PAYLOAD..(number + 1) * SAMPLES_PER_PAYLOAD;
            let samples: Vec<u8> = range.flat_map(|index| stored(sample(index)[which], f64::from(scale))).collect();
            let properties = [item(b"SCAL", b's', 2, &scale.to_be_bytes()), item(b"ORIN", b'c', 1, b"XYZ")];
            nested(b"STRM", &[&properties[..], &[item(key, b's', 6, &samples)]].concat())
        };
        nested(b"DEVC", &[item(b"DVNM", b'c', 1, b"Camera"), stream(b"GYRO", 0, 2000), stream(b"ACCL", 1, 1000)])
    };
    movie(&[video("h264"), telemetry_track((0..100).map(payload).collect())], false)
}

/// Runs the program in a folder and returns what it prints, with its exit code in front.
fn dcvins(folder: &Path, arguments: &[&str]) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_dcvins"));
    let output = command.current_dir(folder).args(arguments).output().expect("the program starts");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    format!("{}\n{}{}", output.status.code().unwrap_or(-1), text(&output.stdout), text(&output.stderr))
}

fn rig(path: &Path) -> Rig {
    Rig::from_yaml(&fs::read_to_string(path).expect("there is a rig"), path).expect("the rig is valid")
}

/// Seconds by which the video starts after the first sample of the autopilot's log, as printed.
fn printed_offset_s(text: &str) -> f64 {
    let number = text.split("the video starts ").nth(1).and_then(|rest| rest.split(' ').next());
    number.and_then(|number| number.parse().ok()).unwrap_or_else(|| panic!("no offset in {text}"))
}

#[test]
fn both_imus_of_a_camera_on_a_gimbal_and_of_the_autopilot_reach_the_rig() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(folder.join("flight.mp4"), camera(true)).unwrap();
    fs::write(folder.join("flight.ulg"), autopilot()).unwrap();
    let text = dcvins(folder, &["convert", "flight.mp4", "--ulog", "flight.ulg", "-o", "flight.mcap"]);
    assert!(text.starts_with('0') && text.contains("the specific forces of both IMUs have a correlation of"), "{text}");
    assert!(text.contains("the rig has a gimbal without joint angles, and the camera's IMU as imu1"), "{text}");
    assert!((printed_offset_s(&text) - VIDEO_START_S).abs() < 0.004, "{text}");

    let written = rig(&folder.join("flight.rig.yaml"));
    assert_eq!(written.imu.topic, "/imu");
    let second = written.gimbal_imu.as_ref().expect("the camera's IMU is imu1");
    assert_eq!(second.sensor.topic, "/camera/imu/gyroscope");
    assert_eq!(second.sensor.accelerometer_topic.as_deref(), Some("/camera/imu/accelerometer"));
    assert_eq!(
        (written.cameras[0].mount.clone(), written.gimbal.as_ref().unwrap().joints.len()),
        (CameraMount::Gimbal, 3)
    );
    assert!(written.gimbal.as_ref().unwrap().topic.is_none());
    let log = Arc::new(FlightLog::open(&folder.join("flight.mcap")).unwrap());
    let frames: Vec<_> = FrameStream::new(log, &written, "cam0", 0.0, None).unwrap().collect();
    assert_eq!(frames.len(), 24);
    for frame in frames.iter().skip(1) {
        // Both bounds and the samples between them, 50 ms apart.
        assert!((10..=12).contains(&frame.gimbal_imu.len()), "{}", frame.gimbal_imu.len());
        let time_s = frame.stamp_ns as f64 * 1e-9;
        let orientation = |time_s: f64| vehicle(time_s) * gimbal(time_s, true);
        let [rate, _] = imu(orientation, position, time_s);
        let last = frame.gimbal_imu.last().expect("there are samples");
        assert!((last.angular_velocity_rad_per_s - rate).norm() < 0.05, "{} {rate}", last.angular_velocity_rad_per_s);
    }

    let text = dcvins(folder, &["check", "flight.mcap"]);
    assert!(text.contains("the IMU on the gimbal measures gravity") && text.contains("imu1 accelerometer"), "{text}");
    assert!(text.contains("run with gimbal-imu-axes=on; then remove assumed.imu1.T_cam_imu"), "{text}");
    let arguments = ["rig", "new", "flight.mcap", "--mechanism", "pitch", "--camera", "fov:80", "-o", "new.rig.yaml"];
    let text = dcvins(folder, &arguments);
    assert!(text.starts_with('0'), "{text}");
    let new = rig(&folder.join("new.rig.yaml"));
    assert_eq!(
        (new.imu.topic, new.gimbal_imu.map(|imu| imu.sensor.topic)),
        (written.imu.topic, Some(second.sensor.topic.clone()))
    );
}

#[test]
fn a_camera_on_the_vehicle_gets_a_rigid_rig() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(folder.join("flight.mp4"), camera(false)).unwrap();
    fs::write(folder.join("flight.ulg"), autopilot()).unwrap();
    let text = dcvins(folder, &["convert", "flight.mp4", "--ulog", "flight.ulg", "-o", "flight.mcap"]);
    assert!(text.starts_with('0') && !text.contains("a gimbal without joint angles"), "{text}");
    assert!((printed_offset_s(&text) - VIDEO_START_S).abs() < 0.004, "{text}");
    let written = rig(&folder.join("flight.rig.yaml"));
    assert!(written.gimbal.is_none() && written.gimbal_imu.is_none() && written.imu.topic == "/imu");
}
