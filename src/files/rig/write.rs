use std::fmt::Write as _;

use nalgebra::SMatrix;

use super::attitude;
use crate::files::yaml::{number, numbers, text};
use crate::geometry::RigidTransform;
use crate::gimbal::DhLink;
use crate::sensors::{
    AssumedField, CameraMount, CameraRig, ChainPrior, GimbalImuRig, GimbalRig, ImuIntrinsics, ImuRig, LeverArm,
    RequiredAccuracy, Rig,
};

/// A rig as the text of [`RigFile::to_yaml`](super::RigFile::to_yaml).
pub(super) fn yaml(rig: &Rig) -> String {
    let mut out = String::from("# T_a_b maps points from b to a; metres, radians, seconds.\n");
    line(&mut out, 0, "rig_version", "1");
    line(&mut out, 0, "name", &text(&rig.name));
    line(&mut out, 0, "gravity", &number(rig.gravity_m_per_s2));
    line(&mut out, 0, "imu0", "");
    write_imu(&mut out, &rig.imu);
    if let Some(GimbalImuRig { sensor, camera_from_imu, timeshift_s }) = &rig.gimbal_imu {
        line(&mut out, 0, "imu1", "");
        line(&mut out, 1, "mount", "gimbal");
        write_imu(&mut out, sensor);
        if *timeshift_s != 0.0 {
            line(&mut out, 1, "timeshift_imu1_imu", &number(*timeshift_s));
        }
        write_transform(&mut out, 1, "T_cam_imu", camera_from_imu);
    }
    for camera in &rig.cameras {
        write_camera(&mut out, rig, camera);
    }
    if let Some(gimbal) = &rig.gimbal {
        write_gimbal(&mut out, gimbal);
    }
    if rig.ground_truth_topic.is_some() || rig.ground_truth_lever_arm.is_some() {
        line(&mut out, 0, "ground_truth", "");
    }
    if let Some(topic) = &rig.ground_truth_topic {
        line(&mut out, 1, "rostopic", &text(topic));
        log_time(&mut out, rig.ground_truth_use_log_time);
    }
    match &rig.ground_truth_lever_arm {
        Some(LeverArm::Known(position_m)) => line(&mut out, 1, "lever_arm", &numbers(position_m.as_slice())),
        Some(LeverArm::Estimated) => line(&mut out, 1, "lever_arm", "estimate"),
        None => {}
    }
    if rig.required_accuracy != RequiredAccuracy::default() {
        let RequiredAccuracy { translation_m, rotation_rad, parameters } = &rig.required_accuracy;
        let names = rig.parameter_names();
        line(&mut out, 0, "required_accuracy", "");
        line(&mut out, 1, "translation", &number(*translation_m));
        line(&mut out, 1, "rotation", &number(*rotation_rad));
        for (parameter, sigma) in parameters {
            line(&mut out, 1, &text(&names.name(*parameter)), &number(*sigma));
        }
    }
    if !rig.assumed.is_empty() {
        line(&mut out, 0, "assumed", "");
    }
    for AssumedField { field, reason } in &rig.assumed {
        line(&mut out, 1, &text(field), &text(reason));
    }
    out
}

/// Writes topic, rate, noise and intrinsics of an IMU.
fn write_imu(out: &mut String, imu: &ImuRig) {
    line(out, 1, "rostopic", &text(&imu.topic));
    if let Some(topic) = &imu.accelerometer_topic {
        line(out, 1, "accelerometer_rostopic", &text(topic));
    }
    log_time(out, imu.use_log_time);
    line(out, 1, "frame_id", &text(&imu.frame_id));
    line(out, 1, "update_rate", &number(imu.rate_hz));
    line(out, 1, "accelerometer_noise_density", &number(imu.noise.accelerometer_noise_density));
    line(out, 1, "accelerometer_random_walk", &number(imu.noise.accelerometer_random_walk));
    line(out, 1, "gyroscope_noise_density", &number(imu.noise.gyroscope_noise_density));
    line(out, 1, "gyroscope_random_walk", &number(imu.noise.gyroscope_random_walk));
    write_imu_intrinsics(out, &imu.intrinsics);
}

/// Writes that log times replace the header stamps.
fn log_time(out: &mut String, used: bool) {
    if used {
        line(out, 1, "use_log_time", "true");
    }
}

/// Writes Kalibr's matrices, unless they are the identity.
fn write_imu_intrinsics(out: &mut String, intrinsics: &ImuIntrinsics) {
    // A rig that was read has invertible corrections; a singular estimate is not a calibration.
    let Some(kalibr) = intrinsics.to_kalibr().filter(|_| !intrinsics.is_identity()) else { return };
    line(out, 1, "gyroscopes", "");
    write_matrix(out, 2, "M", &kalibr.gyroscope_m);
    write_matrix(out, 2, "C_gyro_i", &kalibr.gyroscope_from_imu);
    line(out, 1, "accelerometers", "");
    write_matrix(out, 2, "M", &kalibr.accelerometer_m);
}

fn write_camera(out: &mut String, rig: &Rig, camera: &CameraRig) {
    line(out, 0, &camera.key, "");
    let mount = if camera.mount == CameraMount::Gimbal { "gimbal" } else { "static" };
    line(out, 1, "mount", mount);
    line(out, 1, "rostopic", &text(&camera.topic));
    log_time(out, camera.use_log_time);
    line(out, 1, "frame_id", &text(&camera.frame_id));
    line(out, 1, "update_rate", &number(camera.rate_hz));
    line(out, 1, "camera_model", camera.model.projection.name());
    line(out, 1, "intrinsics", &numbers(&camera.model.kalibr_intrinsics()));
    line(out, 1, "distortion_model", camera.model.distortion.name());
    line(out, 1, "distortion_coeffs", &numbers(&camera.model.kalibr_distortion_coeffs()));
    let [width, height] = camera.model.resolution_px;
    line(out, 1, "resolution", &format!("[{width}, {height}]"));
    line(out, 1, "timeshift_cam_imu", &number(camera.timeshift_cam_imu_s));
    if camera.readout_s != 0.0 {
        line(out, 1, "readout", &number(camera.readout_s));
    }
    if let Some(sigma_s) = camera.readout_sigma_s {
        line(out, 1, "readout_sigma", &number(sigma_s));
    }
    if let Some(sigma) = &camera.intrinsics_sigma {
        let [focal, centre, distortion] = [sigma.focal_ratio, sigma.centre_px, sigma.distortion].map(number);
        line(out, 1, "intrinsics_sigma", &format!("{{focal: {focal}, centre: {centre}, distortion: {distortion}}}"));
    }
    if let Some(mask) = &camera.mask {
        line(out, 1, "mask", &text(&mask.file));
    }
    if let CameraMount::Static { imu_from_camera } = &camera.mount {
        write_transform(out, 1, "T_cam_imu", &imu_from_camera.inverse());
    }
    if let Some(prior) = &camera.relative_prior
        && let Some(before) = rig.camera_before(camera)
        && let Some(before_from_camera) = rig.base_from_camera(Some(&before.key), &camera.key)
    {
        write_transform(out, 1, "T_cn_cnm1", &before_from_camera.inverse());
        if *prior != ChainPrior::RELATIVE {
            let [translation, rotation] = [prior.translation_bound_m, prior.rotation_bound_rad].map(number);
            let bounds = format!("{{translation_bound: {translation}, rotation_bound: {rotation}}}");
            line(out, 1, "T_cn_cnm1_prior", &bounds);
        }
    }
}

fn write_gimbal(out: &mut String, gimbal: &GimbalRig) {
    line(out, 0, "gimbal", "");
    if let (Some(topic), Some(source)) = (&gimbal.topic, &gimbal.attitude) {
        line(out, 1, "source", "");
        for (key, value) in attitude::entries(topic, source) {
            let value = if key == "first_joint_offset" { number(source.first_joint_offset_rad) } else { text(&value) };
            line(out, 2, key, &value);
        }
        if let Some(chain) = &source.chain {
            line(out, 2, "chain", "");
            write_transform(out, 3, "T_I_B", &chain.imu_from_base);
            line(out, 3, "links", "");
            for link in &chain.links {
                line(out, 3, "- theta_offset", &number(link.theta_offset_rad));
                write_lengths(out, 4, link);
            }
            write_transform(out, 3, "T_E_C", &chain.effector_from_camera);
        }
    } else {
        line(out, 1, "rostopic", &gimbal.topic.as_deref().map_or_else(|| "null".into(), text));
    }
    log_time(out, gimbal.use_log_time);
    if gimbal.timeshift_gimbal_imu_s != 0.0 {
        line(out, 1, "timeshift_gimbal_imu", &number(gimbal.timeshift_gimbal_imu_s));
    }
    if gimbal.rate_hz > 0.0 {
        line(out, 1, "update_rate", &number(gimbal.rate_hz));
    }
    line(out, 1, "encoder_sigma", &gimbal.encoder_sigma_rad.map_or_else(|| "null".into(), number));
    line(out, 1, "prior", "");
    line(out, 2, "translation_bound", &number(gimbal.prior.translation_bound_m));
    line(out, 2, "rotation_bound", &number(gimbal.prior.rotation_bound_rad));
    if gimbal.switches_parameterization {
        line(out, 1, "parameterization", "auto");
    }
    write_transform(out, 1, "T_I_B", &gimbal.chain.imu_from_base);
    line(out, 1, "links", if gimbal.joints.is_empty() { "[]" } else { "" });
    for (joint, link) in gimbal.joints.iter().zip(&gimbal.chain.links) {
        line(out, 1, "- joint", &text(&joint.name));
        line(out, 2, "theta_offset", &number(link.theta_offset_rad));
        write_lengths(out, 2, link);
        line(out, 2, "limits", &numbers(&[joint.limits_rad.0, joint.limits_rad.1]));
    }
    write_transform(out, 1, "T_E_C", &gimbal.chain.effector_from_camera);
}

/// Writes the numbers after `theta_offset` of a link.
fn write_lengths(out: &mut String, depth: usize, link: &DhLink) {
    line(out, depth, "d", &number(link.d_m));
    line(out, depth, "a", &number(link.a_m));
    line(out, depth, "alpha", &number(link.alpha_rad));
}

fn write_transform(out: &mut String, depth: usize, key: &str, transform: &RigidTransform) {
    write_matrix(out, depth, key, &transform.to_matrix());
}

fn write_matrix<const N: usize>(out: &mut String, depth: usize, key: &str, matrix: &SMatrix<f64, N, N>) {
    line(out, depth, key, "");
    for row in matrix.row_iter() {
        let row: Vec<f64> = row.iter().copied().collect();
        let _infallible = write!(out, "{:width$}- ", "", width = 2 * depth);
        out.push_str(&numbers(&row));
        out.push('\n');
    }
}

fn line(out: &mut String, depth: usize, key: &str, value: &str) {
    let space = if value.is_empty() { "" } else { " " };
    // Writing to a string cannot fail.
    let _infallible = writeln!(out, "{:width$}{key}:{space}{value}", "", width = 2 * depth);
}
