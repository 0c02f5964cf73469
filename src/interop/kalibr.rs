//! Kalibr's camera chain and IMU, with the keys that `kalibr_calibrate_imu_camera` reads and writes.

use super::text;
use super::{OtherEstimator, text::imu_from_camera};
use crate::files::yaml::{number, numbers, text as scalar};
use crate::sensors::{CameraRig, ImuRig, Rig};

/// Files `camchain-imucam.yaml` and `imu.yaml` of a rig, with names and contents.
pub(super) fn files(rig: &Rig, head: &[String]) -> Vec<(String, Vec<u8>)> {
    let mut chain = text::comments(head);
    chain.push_str("# T_cam_imu maps points from the IMU to the camera; t_imu = t_cam + timeshift_cam_imu.\n");
    chain.push_str("# update_rate and mask are read by dcvins; Kalibr does not look at them.\n");
    for number in 0..rig.cameras.len() {
        chain.push_str(&camera(rig, number));
    }
    let mut imu = text::comments(head);
    imu.push_str("# Continuous-time densities; measured = M · C_gyro_i · true + bias.\n");
    imu.push_str(&imu_lines(&rig.imu));
    vec![("camchain-imucam.yaml".to_owned(), chain.into_bytes()), ("imu.yaml".to_owned(), imu.into_bytes())]
}

fn camera(rig: &Rig, index: usize) -> String {
    let camera: &CameraRig = &rig.cameras[index];
    let [width, height] = camera.model.resolution_px;
    let mut out = format!("cam{index}:\n");
    let camera_from_imu = imu_from_camera(camera).inverse();
    out.push_str(&text::rows(1, "T_cam_imu", &camera_from_imu.to_matrix()));
    if let Some(before) = index.checked_sub(1) {
        let camera_from_before = camera_from_imu * imu_from_camera(&rig.cameras[before]);
        out.push_str(&text::rows(1, "T_cn_cnm1", &camera_from_before.to_matrix()));
    }
    let mut entries = vec![
        ("  cam_overlaps", text::overlaps(rig, index)),
        ("  camera_model", camera.model.projection.name().to_owned()),
        ("  distortion_coeffs", numbers(&camera.model.kalibr_distortion_coeffs())),
        ("  distortion_model", camera.model.distortion.name().to_owned()),
        ("  intrinsics", numbers(&camera.model.kalibr_intrinsics())),
    ];
    if camera.readout_s != 0.0 {
        entries.push(("  line_delay", format!("{}  # s per row", number(camera.readout_s / height as f64))));
    }
    if camera.mask.is_some() {
        entries.push(("  mask", text::mask_name(OtherEstimator::Kalibr, index)));
    }
    entries.extend([
        ("  resolution", format!("[{width}, {height}]")),
        ("  rostopic", scalar(&camera.topic)),
        ("  timeshift_cam_imu", number(camera.timeshift_cam_imu_s)),
        ("  update_rate", number(camera.rate_hz)),
    ]);
    out.push_str(&text::entries(&entries));
    out
}

fn imu_lines(imu: &ImuRig) -> String {
    let noise = &imu.noise;
    let model = if imu.intrinsics.is_identity() { "calibrated" } else { "scale-misalignment" };
    let mut out = text::rows(0, "T_i_b", &nalgebra::Matrix4::identity());
    out.push_str(&text::entries(&[
        ("accelerometer_noise_density", format!("{}  # m/s²/√Hz", number(noise.accelerometer_noise_density))),
        ("accelerometer_random_walk", format!("{}  # m/s³/√Hz", number(noise.accelerometer_random_walk))),
        ("gyroscope_noise_density", format!("{}  # rad/s/√Hz", number(noise.gyroscope_noise_density))),
        ("gyroscope_random_walk", format!("{}  # rad/s²/√Hz", number(noise.gyroscope_random_walk))),
        ("model", model.to_owned()),
        ("rostopic", scalar(&imu.topic)),
        ("time_offset", "0.0".to_owned()),
        ("update_rate", number(imu.rate_hz)),
    ]));
    if let Some(kalibr) = imu.intrinsics.to_kalibr().filter(|_| !imu.intrinsics.is_identity()) {
        out.push_str("gyroscopes:\n");
        out.push_str(&text::rows(1, "M", &kalibr.gyroscope_m));
        out.push_str(&text::rows(1, "C_gyro_i", &kalibr.gyroscope_from_imu));
        out.push_str(&text::rows(1, "A", &nalgebra::Matrix3::zeros()));
        out.push_str("accelerometers:\n");
        out.push_str(&text::rows(1, "M", &text::lower_triangle(&kalibr.accelerometer_m)));
    }
    out
}
