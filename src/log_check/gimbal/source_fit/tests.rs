//! Flight with recorded gimbal attitudes and image rotations of the camera, checked against rigs with right and wrong
//! interpretations of the attitude.

use std::path::Path;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use tempfile::TempDir;

use crate::files::RigFile as _;
use crate::flight_log::{FlightLog, LogWriter, LogWriterOptions, MessageTimes, MessageType};
use crate::geometry::{RigidTransform, ns_from_seconds, seconds_from_ns, so3};
use crate::log_check::check;
use crate::log_check::report::{ImageRotation, Severity};
use crate::log_check::tests::Noise;
use crate::sensors::{BodyAxes, NamedAxes, Rig};

const EPOCH_NS: i64 = 1_700_000_000_000_000_000;
const MS: i64 = 1_000_000;
const DURATION_MS: i64 = 12_000;
/// Noise of a recorded attitude about each axis: 0.1°.
const NOISE_RAD: f64 = 0.0017;
/// Noise of an image rotation about each axis: 0.03°.
const IMAGE_NOISE_RAD: f64 = 5e-4;

fn rig_with(source: &str) -> Rig {
    let text = format!(
        "rig_version: 1
gravity: 9.81
imu0: {{rostopic: /imu, update_rate: 200.0, accelerometer_noise_density: 0.004, accelerometer_random_walk: 0.006,
       gyroscope_noise_density: 3.4e-4, gyroscope_random_walk: 3.9e-5}}
cam0:
  mount: gimbal
  rostopic: /camera
  update_rate: 20.0
  camera_model: pinhole
  intrinsics: [80.0, 80.0, 79.5, 59.5]
  distortion_model: none
  resolution: [160, 120]
gimbal:
  source: {source}
  update_rate: 50.0
  encoder_sigma: 0.0087
  prior: {{translation_bound: 0.003, rotation_bound: 0.0087}}
  T_I_B: [[1, 0, 0, 0.1], [0, -1, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]]
  links:
  - {{joint: yaw, theta_offset: -1.5708, d: 0.04, a: 0.02, alpha: -1.5708, limits: [-3.14159, 3.14159]}}
  - {{joint: roll, theta_offset: 1.5708, d: -0.03, a: 0.03, alpha: -1.5708, limits: [-0.4363, 0.4363]}}
  - {{joint: pitch, theta_offset: -1.5708, d: 0.03, a: 0.01, alpha: -1.5708, limits: [-2.0944, 0.5236]}}
  T_E_C: [[0, 0, 1, 0.03], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]]
"
    );
    Rig::from_yaml(&text, Path::new("test.rig.yaml")).unwrap()
}

/// Angular velocity of the vehicle in FLU.
fn rate_at(time_s: f64) -> Vector3<f64> {
    Vector3::new(0.5 * (1.1 * time_s).cos(), 0.4 * (1.7 * time_s).sin(), 0.3 + 0.4 * (0.7 * time_s).sin())
}

/// Joint angles that compensate a part of the vehicle's rotation.
fn angles_at(time_s: f64) -> [f64; 3] {
    [0.4 + 0.5 * (0.8 * time_s).sin(), 0.25 * (1.3 * time_s).sin(), -0.7 + 0.4 * (0.9 * time_s).cos()]
}

/// Writes a gimbal attitude, from `flu_from_gimbal` and the vehicle's attitude in ENU.
type Recorded = fn(&mut LogWriter, MessageTimes, UnitQuaternion<f64>, UnitQuaternion<f64>);

/// Writes the log to a folder; returns it with the rotations of the camera.
fn recorded(folder: &Path, delay_ms: i64, write: Recorded) -> (FlightLog, Vec<ImageRotation>) {
    let path = folder.join("flight.mcap");
    let mut writer = LogWriter::create(&path, &LogWriterOptions::default()).unwrap();
    let mut noise = Noise(3);
    let chain = rig_with("{topic: /g, type: quaternion, frame: body, axes: flu}").gimbal.unwrap().chain;
    let mut attitude = so3::exp(&Vector3::new(0.1, -0.05, 2.1));
    // Attitude of the vehicle and imu_from_camera, per millisecond.
    let mut history: Vec<(UnitQuaternion<f64>, UnitQuaternion<f64>)> = Vec::new();
    for millisecond in 0..DURATION_MS {
        let time_s = seconds_from_ns(millisecond * MS);
        let times =
            MessageTimes { stamp_ns: EPOCH_NS + millisecond * MS, log_time_ns: EPOCH_NS + (millisecond + 1) * MS };
        let imu_from_camera = chain.imu_from_camera(&angles_at(time_s)).rotation;
        history.push((attitude, imu_from_camera));
        if millisecond % 5 == 0 {
            let rate = rate_at(time_s) + noise.vector() * 0.005;
            let force = attitude.inverse() * Vector3::new(0.0, 0.0, 9.81) + noise.vector() * 0.05;
            writer.write_imu("/imu", "imu", times, &rate, &force).unwrap();
        }
        if millisecond % 10 == 3 {
            let pose = RigidTransform::new(attitude, Vector3::zeros());
            writer.write_pose("/vehicle", "enu", times, &pose).unwrap();
        }
        if millisecond % 20 == 7 && millisecond > delay_ms {
            let (attitude, imu_from_camera) = history[(millisecond - delay_ms) as usize];
            let gimbal = imu_from_camera * NamedAxes::RDF.flu_from_axes().inverse();
            write(&mut writer, times, gimbal * so3::exp(&(noise.vector() * NOISE_RAD)), attitude);
        }
        attitude *= so3::exp(&(rate_at(time_s + 5e-4) * 1e-3));
    }
    writer.finish().unwrap();
    let rotation = |from: usize| {
        let ((from_attitude, from_camera), (to_attitude, to_camera)) = (history[from], history[from + 50]);
        let second_from_first = (to_attitude * to_camera).inverse() * (from_attitude * from_camera);
        let (from_ns, to_ns) = (from as i64 * MS, (from as i64 + 50) * MS);
        let second_from_first = second_from_first * so3::exp(&(noise.vector() * IMAGE_NOISE_RAD));
        ImageRotation { camera_key: "cam0".into(), from_ns, to_ns, second_from_first, tracks: Vec::new() }
    };
    let rotations = (1000..11_000).step_by(50).map(rotation).collect();
    (FlightLog::open(&path).unwrap(), rotations)
}

/// Checks that the finding about the source has a severity and contains the words.
fn expect(write: Recorded, delay_ms: i64, source: &str, severity: Severity, words: &[&str]) {
    let folder = TempDir::new().unwrap();
    let (log, rotations) = recorded(folder.path(), delay_ms, write);
    let report = check(&log, Ok(&rig_with(source)), &rotations);
    let texts: Vec<String> = report
        .findings
        .iter()
        .filter(|finding| finding.severity == severity)
        .map(|finding| format!("{} ({}): {}", finding.title, finding.evidence, finding.remedy))
        .collect();
    let found = texts.iter().any(|text| words.iter().all(|word| text.contains(word)));
    assert!(found, "{source}: {words:?} in\n{}", texts.join("\n"));
}

fn in_frd(rotation: UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    let flu_from_frd = BodyAxes::Frd.flu_from_axes();
    flu_from_frd.inverse() * rotation * flu_from_frd
}

fn write_body_frd(writer: &mut LogWriter, times: MessageTimes, gimbal: UnitQuaternion<f64>, _: UnitQuaternion<f64>) {
    writer.write_rotation("/gimbal", "body", times, &in_frd(gimbal)).unwrap();
}

fn write_earth_ned(
    writer: &mut LogWriter,
    times: MessageTimes,
    gimbal: UnitQuaternion<f64>,
    attitude: UnitQuaternion<f64>,
) {
    let ned_from_enu = BodyAxes::Frd.enu_from_earth().inverse();
    let rotation = ned_from_enu * attitude * gimbal * BodyAxes::Frd.flu_from_axes();
    writer.write_rotation("/gimbal", "earth", times, &rotation).unwrap();
}

/// Writes the Euler angles about z, y and x in FRD, in degrees and in the order pitch, roll, yaw.
fn write_euler(writer: &mut LogWriter, times: MessageTimes, gimbal: UnitQuaternion<f64>, _: UnitQuaternion<f64>) {
    let (roll, pitch, yaw) = in_frd(gimbal).euler_angles();
    // A header with an empty frame, filled up to a multiple of eight bytes, and three numbers.
    let mut message = vec![0, 1, 0, 0];
    message.extend(((times.stamp_ns / 1_000_000_000) as i32).to_le_bytes());
    message.extend(((times.stamp_ns % 1_000_000_000) as u32).to_le_bytes());
    message.extend([1, 0, 0, 0, 0, 0, 0, 0]);
    message.extend([pitch, roll, yaw].into_iter().flat_map(|angle| angle.to_degrees().to_le_bytes()));
    let message_type = MessageType::ros2("geometry_msgs/msg/Vector3Stamped", "");
    writer.write_typed("/gimbal", &message_type, times, &message).unwrap();
}

const GOOD: &str = "gimbal.source predicts the rotations in the images";
const WRONG: &str = "gimbal.source is wrong; correct values: ";

#[test]
fn frame_and_axes_of_quaternions_are_found() {
    let body = |frame: &str, axes: &str| {
        format!(
            "{{topic: /gimbal, type: quaternion, frame: {frame}, axes: {axes}, vehicle: /vehicle, vehicle_axes: flu}}"
        )
    };
    expect(write_body_frd, 0, &body("body", "frd"), Severity::Good, &[GOOD]);
    expect(write_body_frd, 0, &body("body", "flu"), Severity::Error, &[WRONG, "set axes: frd in gimbal.source"]);
    expect(write_body_frd, 0, &body("earth", "frd"), Severity::Error, &[WRONG, "set frame: body in gimbal.source"]);
    expect(write_body_frd, 0, &body("vehicle", "flu"), Severity::Error, &[WRONG, "frame: body", "axes: frd"]);
    expect(write_earth_ned, 0, &body("earth", "frd"), Severity::Good, &[GOOD, "with frame: vehicle 2."]);
    expect(write_earth_ned, 0, &body("body", "frd"), Severity::Error, &[WRONG, "set frame: earth in gimbal.source"]);
    expect(write_earth_ned, 0, &body("vehicle", "frd"), Severity::Error, &[WRONG, "set frame: earth in"]);
    let misread = body("earth", "frd").replace("vehicle_axes: flu", "vehicle_axes: frd");
    expect(write_earth_ned, 0, &misread, Severity::Error, &[WRONG, "set vehicle_axes: flu in gimbal.source"]);
}

#[test]
fn order_sign_and_unit_of_euler_angles_are_found() {
    let source = |order: &str, unit: &str| {
        format!("{{topic: /gimbal, type: euler, frame: body, axes: frd, order: {order}, unit: {unit}}}")
    };
    let right = "yaw=z pitch=x roll=y";
    let check = |order: &str, unit: &str, words: &str| {
        expect(write_euler, 0, &source(order, unit), Severity::Error, &[WRONG, words]);
    };
    expect(write_euler, 0, &source(right, "deg"), Severity::Good, &[GOOD]);
    check(right, "rad", "set unit: deg in gimbal.source");
    check("yaw=z pitch=-x roll=y", "deg", "set order: yaw=z pitch=x roll=y in gimbal.source");
    check("yaw=z pitch=y roll=x", "deg", "set order: yaw=z pitch=x roll=y in gimbal.source");
    check("roll=y pitch=x yaw=z", "deg", "set order: yaw=z pitch=x roll=y in gimbal.source");
    check("yaw=-z pitch=y roll=x", "deg", "order: yaw=z pitch=x roll=y");
}

#[test]
fn delays_and_offsets_of_the_attitude_are_measured() {
    let earth = "{topic: /gimbal, type: quaternion, frame: earth, axes: frd, vehicle: /vehicle, vehicle_axes: flu}";
    let delayed = "set gimbal.timeshift_gimbal_imu to -0.";
    for delay_ms in [40, 100, 180] {
        let folder = TempDir::new().unwrap();
        let (log, rotations) = recorded(folder.path(), delay_ms, write_earth_ned);
        let report = check(&log, Ok(&rig_with(earth)), &rotations);
        let remedy = report
            .findings
            .iter()
            .find_map(|finding| finding.remedy.strip_prefix("set gimbal.timeshift_gimbal_imu to "));
        let shift_ns = ns_from_seconds(remedy.unwrap().parse::<f64>().unwrap());
        assert!((shift_ns + delay_ms * MS).abs() < 5 * MS, "{delay_ms}: {shift_ns}");
    }
    expect(write_earth_ned, 100, earth, Severity::Warning, &["time offset of /gimbal to the IMU: -", delayed]);
    expect(write_earth_ned, 0, earth, Severity::Good, &["/gimbal and the images are synchronized"]);
    // Yaw relative to another direction, by 20°.
    let turned: Recorded = |writer, times, gimbal, attitude| {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 20_f64.to_radians());
        write_body_frd(writer, times, turn * gimbal, attitude);
    };
    let body = "{topic: /gimbal, type: quaternion, frame: body, axes: frd}";
    // The yaw axis of the rig points down, so that a positive rotation about the vertical is a negative one about it.
    let words = ["about the axis of 'yaw'", "rotated by -2", "set first_joint_offset: -0.3"];
    expect(turned, 0, body, Severity::Warning, &words);
    let corrected = body.replace("axes: frd", "axes: frd, first_joint_offset: -0.349");
    expect(turned, 0, &corrected, Severity::Good, &[GOOD, "misfit as in the rig 0.2"]);
}

#[test]
fn an_attitude_of_something_else_fits_in_no_way() {
    let other: Recorded = |writer, times, _, _| {
        let time_s = seconds_from_ns(times.stamp_ns - EPOCH_NS);
        let rotation = so3::exp(&Vector3::new((3.0 * time_s).sin(), (2.0 * time_s).cos(), 0.9 * time_s));
        writer.write_rotation("/gimbal", "body", times, &rotation).unwrap();
    };
    let source = "{topic: /gimbal, type: quaternion, frame: body, axes: frd}";
    expect(
        other,
        0,
        source,
        Severity::Warning,
        &["no interpretation of gimbal.source predicts the rotations in the images"],
    );
}

#[test]
fn quaternions_that_are_filled_in_wrongly_are_named() {
    let inverted: Recorded = |writer, times, gimbal, attitude| {
        let ned_from_enu = BodyAxes::Frd.enu_from_earth().inverse();
        let rotation = ned_from_enu * attitude * gimbal * BodyAxes::Frd.flu_from_axes();
        writer.write_rotation("/gimbal", "earth", times, &rotation.inverse()).unwrap();
    };
    let scalar_first: Recorded = |writer, times, gimbal, attitude| {
        let ned_from_enu = BodyAxes::Frd.enu_from_earth().inverse();
        let rotation = ned_from_enu * attitude * gimbal * BodyAxes::Frd.flu_from_axes();
        let fields = Quaternion::new(rotation.k, rotation.w, rotation.i, rotation.j);
        writer.write_rotation("/gimbal", "earth", times, &UnitQuaternion::new_unchecked(fields)).unwrap();
    };
    let source = "{topic: /gimbal, type: quaternion, frame: earth, axes: frd, vehicle: /vehicle, vehicle_axes: flu}";
    expect(inverted, 0, source, Severity::Error, &["the quaternions of /gimbal are inverted", "correct the driver"]);
    expect(scalar_first, 0, source, Severity::Error, &["the quaternions of /gimbal are in the order w, x, y, z"]);
    // Yaw, roll and pitch of a gimbal put together as yaw, pitch and roll.
    let other_order: Recorded = |writer, times, gimbal, _| {
        let [x, y, z] = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()];
        let matrix = in_frd(gimbal).to_rotation_matrix();
        // Of Rz(yaw) Rx(roll) Ry(pitch).
        let roll = matrix[(2, 1)].asin();
        let (yaw, pitch) = ((-matrix[(0, 1)]).atan2(matrix[(1, 1)]), (-matrix[(2, 0)]).atan2(matrix[(2, 2)]));
        let about = |axis, angle| UnitQuaternion::from_axis_angle(&axis, angle);
        let rotation = about(z, yaw) * about(y, pitch) * about(x, roll);
        writer.write_rotation("/gimbal", "body", times, &rotation).unwrap();
    };
    let source = "{topic: /gimbal, type: quaternion, frame: body, axes: frd}";
    let words = ["the quaternions of /gimbal are made of angles of the order yaw, roll, pitch"];
    expect(other_order, 0, source, Severity::Error, &words);
}
