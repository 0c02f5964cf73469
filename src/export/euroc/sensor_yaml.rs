//! Descriptions of sensors with EuRoC's names.

use std::fmt::Write as _;

use crate::camera::Distortion;
use crate::files::yaml::{number, numbers, text};
use crate::geometry::RigidTransform;
use crate::sensors::{CameraMount, CameraRig, ImuRig};

/// Description of the body of a folder made from a log with this name.
pub(super) fn body_yaml(log: &str) -> String {
    format!("# Written by `dcvins convert --to euroc`.\ncomment: {}\n", text(log))
}

pub(super) fn imu_yaml(imu: &ImuRig) -> String {
    let mut out = head("imu", &imu.topic);
    // The body frame is the IMU frame.
    transform(&mut out, &RigidTransform::identity());
    entry(&mut out, "rate_hz", &number(imu.rate_hz));
    entry(&mut out, "gyroscope_noise_density", &number(imu.noise.gyroscope_noise_density));
    entry(&mut out, "gyroscope_random_walk", &number(imu.noise.gyroscope_random_walk));
    entry(&mut out, "accelerometer_noise_density", &number(imu.noise.accelerometer_noise_density));
    entry(&mut out, "accelerometer_random_walk", &number(imu.noise.accelerometer_random_walk));
    out
}

/// Description of a camera; `body_from_camera` is its pose, for a camera on a gimbal the pose at one time: the time of
/// the first image if its angles were `measured`.
pub(super) fn camera_yaml(camera: &CameraRig, body_from_camera: Option<&RigidTransform>, measured: bool) -> String {
    let mut out = head("camera", &camera.topic);
    if camera.mount == CameraMount::Gimbal {
        let angles = if measured { "measured at its first image" } else { "0, or the limits nearest to it" };
        comment(
            &mut out,
            &format!(
                "The camera is on a gimbal: T_BS holds at the joint angles {angles}; extrinsics.csv has it for each image."
            ),
        );
    }
    if let Some(pose) = body_from_camera {
        transform(&mut out, pose);
    }
    entry(&mut out, "rate_hz", &number(camera.rate_hz));
    let [width, height] = camera.model.resolution_px;
    entry(&mut out, "resolution", &format!("[{width}, {height}]"));
    entry(&mut out, "camera_model", camera.model.projection.name());
    entry(&mut out, "intrinsics", &numbers(&camera.model.kalibr_intrinsics()));
    let distortion = match &camera.model.distortion {
        Distortion::Radtan(_) => "radial-tangential",
        other => other.name(),
    };
    entry(&mut out, "distortion_model", distortion);
    entry(&mut out, "distortion_coefficients", &numbers(&camera.model.kalibr_distortion_coeffs()));
    if camera.timeshift_cam_imu_s != 0.0 {
        comment(&mut out, "The stamps are those of the log: t_imu = t_cam + timeshift_cam_imu, in seconds.");
        entry(&mut out, "timeshift_cam_imu", &number(camera.timeshift_cam_imu_s));
    }
    if camera.readout_s != 0.0 {
        comment(
            &mut out,
            "Rolling shutter: seconds from the exposure of the first row to that of a row after the last.",
        );
        entry(&mut out, "readout", &number(camera.readout_s));
    }
    out
}

pub(super) fn ground_truth_yaml() -> String {
    let mut out = String::from("# Poses of the body, which is the IMU, in the world.\nsensor_type: visual-inertial\n");
    transform(&mut out, &RigidTransform::identity());
    out
}

fn head(kind: &str, topic: &str) -> String {
    format!("sensor_type: {kind}\ncomment: {}\n", text(topic))
}

fn entry(out: &mut String, key: &str, value: &str) {
    // Writing to a string cannot fail.
    let _infallible = writeln!(out, "{key}: {value}");
}

fn comment(out: &mut String, sentence: &str) {
    let _infallible = writeln!(out, "# {sentence}");
}

/// Writes `T_BS`, which maps points from the sensor to the body, row by row.
fn transform(out: &mut String, body_from_sensor: &RigidTransform) {
    let rows: Vec<f64> = body_from_sensor.to_matrix().transpose().iter().copied().collect();
    let _infallible = writeln!(out, "T_BS:\n  cols: 4\n  rows: 4\n  data: {}", numbers(&rows));
}
