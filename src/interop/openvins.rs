//! OpenVINS: estimator, camera chain and IMU.

use std::fmt::Write as _;

use nalgebra::Matrix3;

use super::text::{self, imu_from_camera};
use super::{OtherEstimator, text::lower_triangle};
use crate::camera::Distortion;
use crate::files::yaml::{number, numbers};
use crate::sensors::{CameraRig, ImuRig, KalibrImuMatrices, Rig};

/// Settings that do not depend on the rig, with OpenVINS's usual values.
const SETTINGS: &[(&str, &str)] = &[
    ("verbosity", "\"INFO\""),
    ("use_fej", "true"),
    ("use_imuavg", "true"),
    ("use_rk4int", "true"),
    ("calib_cam_extrinsics", "true"),
    ("calib_cam_intrinsics", "true"),
    ("calib_cam_timeoffset", "true"),
    ("calib_imu_intrinsics", "false"),
    ("calib_imu_g_sensitivity", "false"),
    ("max_clones", "11"),
    ("max_slam", "50"),
    ("max_slam_in_update", "25"),
    ("max_msckf_in_update", "40"),
    ("dt_slam_delay", "1"),
    ("feat_rep_msckf", "\"GLOBAL_3D\""),
    ("feat_rep_slam", "\"ANCHORED_MSCKF_INVERSE_DEPTH\""),
    ("feat_rep_aruco", "\"ANCHORED_MSCKF_INVERSE_DEPTH\""),
    ("try_zupt", "false"),
    ("zupt_chi2_multipler", "0"),
    ("zupt_max_velocity", "0.1"),
    ("zupt_noise_multiplier", "10"),
    ("zupt_max_disparity", "0.5"),
    ("zupt_only_at_beginning", "false"),
    ("init_window_time", "2.0"),
    ("init_imu_thresh", "1.5"),
    ("init_max_disparity", "10.0"),
    ("init_max_features", "75"),
    ("init_dyn_use", "false"),
    ("init_dyn_min_movement", "0"),
    ("init_dyn_mle_opt_calib", "false"),
    ("init_dyn_mle_max_iter", "50"),
    ("init_dyn_mle_max_time", "0.05"),
    ("init_dyn_mle_max_threads", "6"),
    ("init_dyn_num_pose", "6"),
    ("init_dyn_min_deg", "10.0"),
    ("init_dyn_inflation_ori", "10"),
    ("init_dyn_inflation_vel", "100"),
    ("init_dyn_inflation_bg", "10"),
    ("init_dyn_inflation_ba", "100"),
    ("init_dyn_min_rec_cond", "1.0e-12"),
    ("init_dyn_bias_g", "[0.0, 0.0, 0.0]"),
    ("init_dyn_bias_a", "[0.0, 0.0, 0.0]"),
    ("record_timing_information", "false"),
    ("record_timing_filepath", "\"/tmp/traj_timing.txt\""),
    ("save_total_state", "false"),
    ("filepath_est", "\"/tmp/ov_estimate.txt\""),
    ("filepath_std", "\"/tmp/ov_estimate_std.txt\""),
    ("filepath_gt", "\"/tmp/ov_groundtruth.txt\""),
    ("use_klt", "true"),
    ("num_pts", "200"),
    ("fast_threshold", "20"),
    ("grid_x", "5"),
    ("grid_y", "5"),
    ("min_px_dist", "10"),
    ("knn_ratio", "0.70"),
    ("downsample_cameras", "false"),
    ("num_opencv_threads", "4"),
    ("histogram_method", "\"HISTOGRAM\""),
    ("use_aruco", "false"),
    ("num_aruco", "1024"),
    ("downsize_aruco", "true"),
    ("up_msckf_sigma_px", "1"),
    ("up_msckf_chi2_multipler", "1"),
    ("up_slam_sigma_px", "1"),
    ("up_slam_chi2_multipler", "1"),
    ("up_aruco_sigma_px", "1"),
    ("up_aruco_chi2_multipler", "1"),
];

/// `estimator_config.yaml`, `kalibr_imucam_chain.yaml` and `kalibr_imu_chain.yaml`.
pub(super) fn files(rig: &Rig, head: &[String]) -> Vec<(String, Vec<u8>)> {
    let mut chain = text::opencv_comments(head);
    chain.push_str("# T_imu_cam maps points from the camera to the IMU; t_imu = t_cam + timeshift_cam_imu.\n");
    for number in 0..rig.cameras.len() {
        chain.push_str(&camera(rig, number));
    }
    let mut imu = text::opencv_comments(head);
    imu.push_str("# Continuous-time densities; measured = Tw · R_IMUtoGYRO · true + bias, and the same with Ta.\n");
    imu.push_str(&imu_lines(&rig.imu));
    [
        ("estimator_config.yaml", estimator(rig, head)),
        ("kalibr_imucam_chain.yaml", chain),
        ("kalibr_imu_chain.yaml", imu),
    ]
    .map(|(name, content)| (name.to_owned(), content.into_bytes()))
    .into()
}

fn estimator(rig: &Rig, head: &[String]) -> String {
    let stereo = matches!(rig.cameras.as_slice(), [one, other] if text::overlap(one, other));
    let rate_hz = rig.cameras.iter().map(|camera| camera.rate_hz).fold(0.0, f64::max);
    let has_masks = rig.cameras.iter().any(|camera| camera.mask.is_some());
    let mut out = text::opencv_comments(head);
    out.push_str("# From the rig.\n");
    out.push_str(&text::entries(&[
        ("use_stereo", stereo.to_string()),
        ("max_cameras", rig.cameras.len().to_string()),
        ("gravity_mag", number(rig.gravity_m_per_s2)),
        // Images at their own rate: a frame is dropped only if it is early by more than 5 %.
        ("track_frequency", number(1.05 * rate_hz)),
        ("use_mask", has_masks.to_string()),
    ]));
    for (number, _) in rig.cameras.iter().enumerate().filter(|_| has_masks) {
        let name = text::mask_name(OtherEstimator::OpenVins, number);
        let _infallible = writeln!(out, "mask{number}: \"{name}\"");
    }
    out.push_str(&text::entries(&[
        ("relative_config_imu", "\"kalibr_imu_chain.yaml\"".to_owned()),
        ("relative_config_imucam", "\"kalibr_imucam_chain.yaml\"".to_owned()),
    ]));
    out.push_str("# OpenVINS's usual values.\n");
    for (key, value) in SETTINGS {
        let _infallible = writeln!(out, "{key}: {value}");
    }
    out
}

fn camera(rig: &Rig, index: usize) -> String {
    let camera: &CameraRig = &rig.cameras[index];
    let [width, height] = camera.model.resolution_px;
    let (name, coefficients) = match &camera.model.distortion {
        Distortion::Equidistant(coefficients) => ("equidistant", *coefficients),
        Distortion::Radtan(coefficients) => ("radtan", *coefficients),
        // OpenVINS has no lens without distortion.
        _ => ("radtan", [0.0; 4]),
    };
    let mut out = format!("cam{index}:\n");
    out.push_str(&text::rows(1, "T_imu_cam", &imu_from_camera(camera).to_matrix()));
    out.push_str(&text::entries(&[
        ("  cam_overlaps", text::overlaps(rig, index)),
        ("  camera_model", "pinhole".to_owned()),
        ("  distortion_coeffs", numbers(&coefficients)),
        ("  distortion_model", name.to_owned()),
        ("  intrinsics", numbers(&camera.model.intrinsics_px)),
        ("  resolution", format!("[{width}, {height}]")),
        ("  rostopic", text::quoted(&camera.topic)),
        ("  timeshift_cam_imu", number(camera.timeshift_cam_imu_s)),
    ]));
    out
}

fn imu_lines(imu: &ImuRig) -> String {
    let noise = &imu.noise;
    let identity = Matrix3::identity();
    let kalibr = imu.intrinsics.to_kalibr().filter(|_| !imu.intrinsics.is_identity());
    let kalibr = kalibr.unwrap_or(KalibrImuMatrices {
        gyroscope_m: identity,
        gyroscope_from_imu: identity,
        accelerometer_m: identity,
    });
    let mut out = "imu0:\n".to_owned();
    out.push_str(&text::rows(1, "T_i_b", &nalgebra::Matrix4::identity()));
    out.push_str(&text::entries(&[
        ("  accelerometer_noise_density", format!("{}  # m/s^2/sqrt(Hz)", number(noise.accelerometer_noise_density))),
        ("  accelerometer_random_walk", format!("{}  # m/s^3/sqrt(Hz)", number(noise.accelerometer_random_walk))),
        ("  gyroscope_noise_density", format!("{}  # rad/s/sqrt(Hz)", number(noise.gyroscope_noise_density))),
        ("  gyroscope_random_walk", format!("{}  # rad/s^2/sqrt(Hz)", number(noise.gyroscope_random_walk))),
        ("  rostopic", text::quoted(&imu.topic)),
        ("  time_offset", "0.0".to_owned()),
        ("  update_rate", number(imu.rate_hz)),
        ("  model", "\"kalibr\"".to_owned()),
    ]));
    out.push_str(&text::rows(1, "Tw", &lower_triangle(&kalibr.gyroscope_m)));
    out.push_str(&text::rows(1, "R_IMUtoGYRO", &kalibr.gyroscope_from_imu));
    out.push_str(&text::rows(1, "Ta", &lower_triangle(&kalibr.accelerometer_m)));
    out.push_str(&text::rows(1, "R_IMUtoACC", &identity));
    out.push_str(&text::rows(1, "Tg", &Matrix3::zeros()));
    out
}
