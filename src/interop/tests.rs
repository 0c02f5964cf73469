//! Lists of keys are copied from the programs' example files (EuRoC, TUM-VI, T265), parsed by a parser of their format.

use std::path::Path;

use nalgebra::{Matrix3, Matrix4, UnitQuaternion, Vector2, Vector3};
use serde_json::Value;

use super::*;
use crate::camera::CameraModel;
use crate::files::RigFile as _;
use crate::geometry::RigidTransform;
use crate::sensors::{CameraMask, CameraMount, GrayImage, ImageMask, ImuIntrinsics, ImuIntrinsicsParameters};

/// A gimbal with two joints, a camera on it, a rigid camera, and every property that a format may support.
fn rig() -> Rig {
    let text = "
rig_version: 1
name: city
gravity: 9.805
imu0: {rostopic: /imu, frame_id: imu, update_rate: 400.0, accelerometer_noise_density: 0.004,
       accelerometer_random_walk: 0.006, gyroscope_noise_density: 3.4e-4, gyroscope_random_walk: 3.9e-5}
cam0:
  mount: gimbal
  rostopic: /gimbal/image_raw
  update_rate: 20.0
  camera_model: pinhole
  intrinsics: [352.6, 352.1, 322.4, 238.1]
  distortion_model: radtan
  distortion_coeffs: [-0.28, 0.07, 0.0002, 1.8e-5]
  resolution: [640, 480]
  timeshift_cam_imu: 0.0125
  readout: 0.018
cam1:
  mount: static
  rostopic: /static/image_raw
  update_rate: 30.0
  camera_model: pinhole
  intrinsics: [286.0, 287.0, 321.0, 239.5]
  distortion_model: equidistant
  distortion_coeffs: [-0.007, 0.042, -0.04, 0.0067]
  resolution: [640, 480]
  timeshift_cam_imu: -0.004
  T_cam_imu: [[0.0, -1.0, 0.0, 0.01], [0.0, 0.0, -1.0, 0.02], [1.0, 0.0, 0.0, -0.1], [0.0, 0.0, 0.0, 1.0]]
gimbal:
  rostopic: /gimbal/joint_states
  update_rate: 200.0
  encoder_sigma: 0.0087
  prior: {translation_bound: 0.003, rotation_bound: 0.0087}
  T_I_B: [[1.0, 0.0, 0.0, 0.1], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, -0.05], [0.0, 0.0, 0.0, 1.0]]
  links:
  - {joint: yaw, theta_offset: -1.56, d: 0.046, a: 0.016, alpha: -1.55, limits: [-3.0, 3.0]}
  - {joint: pitch, theta_offset: 0.02, d: 0.0, a: 0.03, alpha: 0.1, limits: [-2.0, -0.1]}
  T_E_C: [[1.0, 0.0, 0.0, 0.01], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.005], [0.0, 0.0, 0.0, 1.0]]
";
    let mut rig = Rig::from_yaml(text, Path::new("city.rig.yaml")).unwrap();
    let mut parameters = ImuIntrinsicsParameters::default();
    parameters.gyroscope.scale = Vector3::new(0.01, -0.02, 0.004);
    parameters.gyroscope_rotation_rad = Vector3::new(0.02, -0.01, 0.005);
    parameters.accelerometer.scale = Vector3::new(-0.006, 0.001, 0.015);
    parameters.accelerometer.misalignment = Vector3::new(0.008, 0.002, -0.004);
    rig.imu.intrinsics = ImuIntrinsics::from_parameters(&parameters);
    let image =
        GrayImage { width: 640, height: 480, pixels: (0..640 * 480).map(|pixel| (pixel % 251) as u8).collect() };
    rig.cameras[1].mask = Some(CameraMask { file: "legs.png".to_owned(), image: ImageMask::from_image(&image) });
    rig
}

/// The same rig with a calibrated IMU.
fn calibrated() -> Rig {
    let mut rig = rig();
    rig.imu.intrinsics = ImuIntrinsics::default();
    rig
}

fn keys(names: &[&str]) -> Vec<String> {
    names.iter().map(|name| (*name).to_owned()).collect()
}

fn configuration(rig: &Rig, program: OtherEstimator, cameras: &[&str]) -> Configuration {
    configure(rig, program, &keys(cameras), &FixedJointAngles::neutral(rig)).unwrap()
}

fn text_of<'a>(configuration: &'a Configuration, file: &str) -> &'a str {
    let (_, bytes) = configuration.files.iter().find(|(name, _)| name == file).unwrap();
    std::str::from_utf8(bytes).unwrap()
}

/// A file as parsed by its program: plain YAML, YAML of `OpenCV` (version, then types in exclamation marks), or JSON.
fn parsed(configuration: &Configuration, file: &str) -> Value {
    let text = text_of(configuration, file);
    if Path::new(file).extension().is_some_and(|extension| extension == "json") {
        return serde_json::from_str(text).unwrap();
    }
    match text.strip_prefix("%YAML:1.0\n") {
        Some(rest) => serde_saphyr::from_str(&rest.replace("!!opencv-matrix", "")).unwrap(),
        None => serde_saphyr::from_str(text).unwrap(),
    }
}

fn at<'a>(value: &'a Value, path: &str) -> &'a Value {
    path.split('/').fold(value, |value, key| match key.parse::<usize>() {
        Ok(index) => &value[index],
        Err(_) => &value[key],
    })
}

#[track_caller]
fn check_keys(value: &Value, paths: &str) {
    let mut count = 0;
    for path in paths.split_whitespace() {
        assert!(!at(value, path).is_null(), "no {path}");
        count += 1;
    }
    assert!(count > 0);
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(number).collect()
}

fn matrix3(value: &Value) -> Matrix3<f64> {
    Matrix3::from_fn(|row, column| number(&value[row][column]))
}

fn matrix4(value: &Value) -> Matrix4<f64> {
    Matrix4::from_fn(|row, column| number(&value[row][column]))
}

/// `imu_from_camera` of a camera of the rig at its neutral angles.
fn imu_from_camera(rig: &Rig, key: &str) -> RigidTransform {
    rig.chain_of_camera(key).unwrap().imu_from_camera(&match key {
        "cam0" => vec![0.0, -0.1],
        _ => vec![],
    })
}

#[track_caller]
fn check_near(found: f64, expected: f64) {
    assert!((found - expected).abs() <= 1e-12 * (1.0 + expected.abs()), "{found}, expected {expected}");
}

#[track_caller]
fn check_transform(found: &Matrix4<f64>, expected: &RigidTransform) {
    assert!((found - expected.to_matrix()).amax() < 1e-12, "{found}{}", expected.to_matrix());
}

const KALIBR_CAMERA: &str = "T_cam_imu cam_overlaps camera_model distortion_coeffs distortion_model intrinsics resolution \
    rostopic timeshift_cam_imu";
const KALIBR_IMU: &str = "T_i_b accelerometer_noise_density accelerometer_random_walk gyroscope_noise_density \
    gyroscope_random_walk model rostopic time_offset update_rate";

#[test]
fn kalibr_reads_back_as_the_same_rig() {
    for rig in [rig(), calibrated()] {
        let configuration = configuration(&rig, OtherEstimator::Kalibr, &[]);
        let chain = parsed(&configuration, "camchain-imucam.yaml");
        check_keys(&chain["cam0"], KALIBR_CAMERA);
        check_keys(&chain["cam1"], KALIBR_CAMERA);
        check_keys(&chain["cam1"], "T_cn_cnm1");
        check_keys(&parsed(&configuration, "imu.yaml"), KALIBR_IMU);

        let folder = tempfile::tempdir().unwrap();
        write_configuration(&configuration, folder.path(), false).unwrap();
        let read = Rig::from_file(&folder.path().join("camchain-imucam.yaml")).unwrap();
        let fixed = rig.at_joint_angles(&rig.neutral_joint_angles_rad()).unwrap();
        let (expected, rotation) = fixed.in_kalibr_imu_frame();
        assert_eq!(rotation == UnitQuaternion::identity(), rig.imu.intrinsics.is_identity());
        assert_eq!((&read.imu.noise, read.imu.rate_hz), (&expected.imu.noise, 400.0));
        assert_eq!(read.imu.topic, "/imu");
        let difference = read.imu.intrinsics.left_after(&expected.imu.intrinsics).unwrap();
        assert!((difference.gyroscope_correction - Matrix3::identity()).amax() < 1e-14);
        assert!((difference.accelerometer_correction - Matrix3::identity()).amax() < 1e-14);
        for (read, expected) in read.cameras.iter().zip(&expected.cameras) {
            assert_eq!((&read.model, &read.topic), (&expected.model, &expected.topic));
            assert_eq!((read.rate_hz, read.timeshift_cam_imu_s), (expected.rate_hz, expected.timeshift_cam_imu_s));
            check_near(read.readout_s, expected.readout_s);
            let images = [read, expected].map(|camera| camera.mask.as_ref().map(|mask| mask.image.clone()));
            assert_eq!(images[0], images[1]);
            let [found, expected] = [read, expected].map(|camera| match &camera.mount {
                CameraMount::Static { imu_from_camera } => *imu_from_camera,
                CameraMount::Gimbal => panic!("the gimbal is fixed"),
            });
            assert!(found.minus(&expected).norm() < 1e-12);
        }
    }
}

const VINS: &str = "imu num_of_cam imu_topic image0_topic image1_topic output_path cam0_calib cam1_calib image_width \
    image_height estimate_extrinsic body_T_cam0 body_T_cam0/rows body_T_cam0/cols body_T_cam0/dt body_T_cam0/data \
    multiple_thread max_cnt min_dist freq F_threshold show_track flow_back max_solver_time max_num_iterations \
    keyframe_parallax acc_n gyr_n acc_w gyr_w g_norm estimate_td td load_previous_pose_graph pose_graph_save_path save_image";
const VINS_CAMERA: &str = "model_type camera_name image_width image_height projection_parameters";

fn opencv_matrix(value: &Value) -> Matrix4<f64> {
    assert_eq!((number(&value["rows"]), number(&value["cols"])), (4.0, 4.0));
    Matrix4::from_row_slice(&numbers(&value["data"]))
}

#[test]
fn vins_fusion_takes_noise_per_sample_and_camera_to_imu() {
    let rig = calibrated();
    let one = configuration(&rig, OtherEstimator::VinsFusion, &[]);
    let settings = parsed(&one, "vins_config.yaml");
    check_keys(&settings, VINS);
    check_transform(&opencv_matrix(&settings["body_T_cam0"]), &imu_from_camera(&rig, "cam0"));
    check_near(number(&settings["acc_n"]), 0.004 * 20.0);
    check_near(number(&settings["gyr_w"]), 3.9e-5 * 20.0);
    check_near(number(&settings["td"]), 0.0125);
    check_near(number(&settings["g_norm"]), 9.805);
    assert_eq!(settings["num_of_cam"], 1);
    let camera = parsed(&one, "cam0.yaml");
    check_keys(&camera, VINS_CAMERA);
    check_keys(
        &camera,
        "distortion_parameters/k1 distortion_parameters/p2 projection_parameters/fx projection_parameters/cy",
    );
    assert_eq!(camera["model_type"], "PINHOLE");

    let two = configuration(&rig, OtherEstimator::VinsFusion, &["cam0", "cam1"]);
    let settings = parsed(&two, "vins_config.yaml");
    check_transform(&opencv_matrix(&settings["body_T_cam1"]), &imu_from_camera(&rig, "cam1"));
    assert_eq!((&settings["num_of_cam"], &settings["image1_topic"]), (&2.into(), &"/static/image_raw".into()));
    let fisheye = parsed(&two, "cam1.yaml");
    assert_eq!(fisheye["model_type"], "KANNALA_BRANDT");
    check_keys(&fisheye["projection_parameters"], "k2 k3 k4 k5 mu mv u0 v0");
    check_near(number(&fisheye["projection_parameters"]["k5"]), 0.0067);
    assert!(two.notes.iter().any(|note| note.contains("add -16.500 ms to the stamps of cam1")), "{:?}", two.notes);

    let mut omni = calibrated();
    omni.cameras[0].model = CameraModel::from_kalibr(
        "omni",
        &[1.4, 896.0, 897.0, 320.0, 240.0],
        "radtan",
        &[-0.3, 0.06, 1e-3, -2e-4],
        [640, 480],
    )
    .unwrap();
    let camera = parsed(&configuration(&omni, OtherEstimator::VinsFusion, &[]), "cam0.yaml");
    assert_eq!(camera["model_type"], "MEI");
    check_keys(
        &camera,
        "mirror_parameters/xi projection_parameters/gamma1 projection_parameters/v0 distortion_parameters/k2",
    );
    let eight = [0.1, -0.2, 1e-3, 2e-3, 0.03, 0.2, -0.1, 0.01];
    omni.cameras[0].model =
        CameraModel::from_kalibr("pinhole", &[400.0, 400.0, 320.0, 240.0], "rational_polynomial", &eight, [640, 480])
            .unwrap();
    let camera = parsed(&configuration(&omni, OtherEstimator::VinsFusion, &[]), "cam0.yaml");
    assert_eq!(camera["model_type"], "PINHOLE_FULL");
    check_near(number(&camera["distortion_parameters"]["k3"]), 0.03);
    check_near(number(&camera["distortion_parameters"]["k6"]), 0.01);
}

const OPENVINS: &str = "verbosity use_fej use_imuavg use_rk4int use_stereo max_cameras calib_cam_extrinsics \
    calib_cam_intrinsics calib_cam_timeoffset max_clones max_slam max_slam_in_update max_msckf_in_update dt_slam_delay \
    gravity_mag feat_rep_msckf feat_rep_slam feat_rep_aruco try_zupt zupt_chi2_multipler zupt_max_velocity \
    zupt_noise_multiplier zupt_max_disparity zupt_only_at_beginning init_window_time init_imu_thresh init_max_disparity \
    init_max_features init_dyn_use init_dyn_min_movement init_dyn_mle_opt_calib init_dyn_mle_max_iter \
    init_dyn_mle_max_time init_dyn_mle_max_threads init_dyn_num_pose init_dyn_min_deg init_dyn_inflation_ori \
    init_dyn_inflation_vel init_dyn_inflation_bg init_dyn_inflation_ba init_dyn_min_rec_cond init_dyn_bias_g \
    init_dyn_bias_a record_timing_information record_timing_filepath save_total_state filepath_est filepath_std \
    filepath_gt use_klt num_pts fast_threshold grid_x grid_y min_px_dist knn_ratio track_frequency downsample_cameras \
    num_opencv_threads histogram_method use_aruco num_aruco downsize_aruco up_msckf_sigma_px up_msckf_chi2_multipler \
    up_slam_sigma_px up_slam_chi2_multipler up_aruco_sigma_px up_aruco_chi2_multipler use_mask relative_config_imu \
    relative_config_imucam";
const OPENVINS_CAMERA: &str =
    "T_imu_cam cam_overlaps camera_model distortion_coeffs distortion_model intrinsics resolution rostopic";
const OPENVINS_IMU: &str = "T_i_b accelerometer_noise_density accelerometer_random_walk gyroscope_noise_density \
    gyroscope_random_walk rostopic time_offset update_rate model Tw R_IMUtoGYRO Ta R_IMUtoACC Tg";

#[test]
fn openvins_takes_imu_intrinsics_in_the_rotated_frame() {
    let rig = rig();
    let configuration = configuration(&rig, OtherEstimator::OpenVins, &[]);
    let settings = parsed(&configuration, "estimator_config.yaml");
    check_keys(&settings, OPENVINS);
    assert_eq!((&settings["max_cameras"], &settings["use_mask"]), (&2.into(), &true.into()));
    let names: Vec<&str> = configuration.files.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names[3..], ["mask0.png", "mask1.png"]);
    assert_eq!(settings["mask1"], "mask1.png");

    let chain = parsed(&configuration, "kalibr_imucam_chain.yaml");
    check_keys(&chain["cam0"], OPENVINS_CAMERA);
    let (_, rotation) = rig.at_joint_angles(&rig.neutral_joint_angles_rad()).unwrap().in_kalibr_imu_frame();
    let kalibr_from_imu = RigidTransform { rotation, ..RigidTransform::identity() };
    check_transform(&matrix4(&chain["cam0"]["T_imu_cam"]), &(kalibr_from_imu * imu_from_camera(&rig, "cam0")));
    check_transform(&matrix4(&chain["cam1"]["T_imu_cam"]), &(kalibr_from_imu * imu_from_camera(&rig, "cam1")));
    check_near(number(&chain["cam0"]["timeshift_cam_imu"]), 0.0125);

    let imu = &parsed(&configuration, "kalibr_imu_chain.yaml")["imu0"];
    check_keys(imu, OPENVINS_IMU);
    // measured = Tw · R_IMUtoGYRO · true in the rotated frame, both matrices lower triangular.
    let measured = Vector3::new(0.3, -0.7, 1.1);
    let corrected = rotation * rig.imu.intrinsics.correct_angular_velocity(&measured);
    let again = matrix3(&imu["Tw"]) * matrix3(&imu["R_IMUtoGYRO"]) * corrected;
    assert!((again - measured).norm() < 1e-12);
    let corrected = rotation * rig.imu.intrinsics.correct_specific_force(&measured);
    assert!((matrix3(&imu["Ta"]) * corrected - measured).norm() < 1e-12);
    for key in ["Tw", "Ta"] {
        let matrix = matrix3(&imu[key]);
        assert_eq!([(0, 1), (0, 2), (1, 2)].map(|entry| matrix[entry]), [0.0; 3], "{key}");
    }
    assert!(configuration.notes.iter().any(|note| note.contains("lower triangular")), "{:?}", configuration.notes);
}

const BASALT: &str = "T_imu_cam/0/px T_imu_cam/0/py T_imu_cam/0/pz T_imu_cam/0/qx T_imu_cam/0/qy T_imu_cam/0/qz \
    T_imu_cam/0/qw intrinsics/0/camera_type intrinsics/0/intrinsics/fx intrinsics/0/intrinsics/fy \
    intrinsics/0/intrinsics/cx intrinsics/0/intrinsics/cy resolution/0/0 resolution/0/1 vignette calib_accel_bias/8 \
    calib_gyro_bias/11 imu_update_rate accel_noise_std/2 gyro_noise_std/2 accel_bias_std/2 gyro_bias_std/2 \
    T_mocap_world/qw T_imu_marker/px mocap_time_offset_ns mocap_to_imu_offset_ns cam_time_offset_ns";

#[test]
fn basalt_takes_its_own_lens_models() {
    let mut rig = rig();
    rig.cameras[0].model =
        CameraModel::from_kalibr("omni", &[1.4, 896.0, 897.0, 320.0, 240.0], "none", &[], [640, 480]).unwrap();
    let configuration = configuration(&rig, OtherEstimator::Basalt, &[]);
    let root = parsed(&configuration, "basalt_calib.json");
    let calibration = &root["value0"];
    check_keys(calibration, BASALT);
    check_keys(calibration, "intrinsics/1/intrinsics/k1 intrinsics/1/intrinsics/k4 intrinsics/0/intrinsics/alpha");
    assert_eq!(calibration["intrinsics"][0]["camera_type"], "ucm");
    assert_eq!(calibration["intrinsics"][1]["camera_type"], "kb4");
    assert_eq!(calibration["cam_time_offset_ns"], 12_500_000);
    check_near(number(&calibration["accel_noise_std"][0]), 0.004);
    let comment = calibration["comment"][0].as_str().unwrap();
    assert!(comment.starts_with("Written by dcvins export for Basalt"), "{comment}");

    // The unified model as computed by Basalt, π(x) = f · x / (α · d + (1 − α) · z) + c.
    let lens = &calibration["intrinsics"][0]["intrinsics"];
    let [fx, fy, cx, cy, alpha] = ["fx", "fy", "cx", "cy", "alpha"].map(|key| number(&lens[key]));
    let point = Vector3::new(0.4, -0.3, 1.2);
    let denominator = alpha * point.norm() + (1.0 - alpha) * point.z;
    let pixel = Vector2::new(fx * point.x / denominator + cx, fy * point.y / denominator + cy);
    assert!((pixel - rig.cameras[0].model.project(&point).unwrap()).norm() < 1e-9);

    // calibrated = raw + S · raw − bias, in the frame in which the accelerometer's S is lower triangular.
    let accelerometer = numbers(&calibration["calib_accel_bias"]);
    let gyroscope = numbers(&calibration["calib_gyro_bias"]);
    let s = &accelerometer[3..];
    let scale = Matrix3::new(s[0], 0.0, 0.0, s[1], s[3], 0.0, s[2], s[4], s[5]);
    let (_, rotation) = rig.at_joint_angles(&rig.neutral_joint_angles_rad()).unwrap().in_kalibr_imu_frame();
    let raw = Vector3::new(0.5, 9.6, -1.4);
    assert!((raw + scale * raw - rotation * rig.imu.intrinsics.correct_specific_force(&raw)).norm() < 1e-12);
    let scale = Matrix3::from_column_slice(&gyroscope[3..]);
    assert!((raw + scale * raw - rotation * rig.imu.intrinsics.correct_angular_velocity(&raw)).norm() < 1e-12);
    assert_eq!((&accelerometer[..3], &gyroscope[..3]), (&[0.0; 3][..], &[0.0; 3][..]));
}

const ORB_SLAM3: &str = "File.version Camera.type Camera1.fx Camera1.fy Camera1.cx Camera1.cy Camera1.k1 Camera1.k2 \
    Camera.width Camera.height Camera.newWidth Camera.newHeight Camera.fps Camera.RGB IMU.T_b_c1 IMU.NoiseGyro \
    IMU.NoiseAcc IMU.GyroWalk IMU.AccWalk IMU.Frequency ORBextractor.nFeatures ORBextractor.scaleFactor \
    ORBextractor.nLevels ORBextractor.iniThFAST ORBextractor.minThFAST Viewer.KeyFrameSize Viewer.KeyFrameLineWidth \
    Viewer.GraphLineWidth Viewer.PointSize Viewer.CameraSize Viewer.CameraLineWidth Viewer.ViewpointX Viewer.ViewpointY \
    Viewer.ViewpointZ Viewer.ViewpointF";

#[test]
fn orb_slam3_takes_one_camera_and_no_time_offset() {
    let rig = rig();
    let pinhole = configuration(&rig, OtherEstimator::OrbSlam3, &[]);
    let settings = parsed(&pinhole, "orb_slam3.yaml");
    check_keys(&settings, ORB_SLAM3);
    check_keys(&settings, "Camera1.p1 Camera1.p2");
    assert_eq!((&settings["Camera.type"], &settings["Camera.fps"]), (&"PinHole".into(), &20.into()));
    check_transform(&opencv_matrix(&settings["IMU.T_b_c1"]), &imu_from_camera(&rig, "cam0"));
    check_near(number(&settings["IMU.GyroWalk"]), 3.9e-5);
    let notes = pinhole.notes.join("\n");
    for expected in [
        "cam0 is carried by the gimbal, which is assumed fixed at yaw 0.000°, pitch -5.730°, its neutral angles",
        "cam1 of the rig is left out; cam1 is rigid, its extrinsics hold at every joint angle (--camera cam1)",
        "add +12.500 ms to the stamps of cam0 first",
        "the readout of cam0, 18.000 ms, is left out",
        "takes no scale and misalignment of the IMU",
    ] {
        assert!(notes.contains(expected), "'{expected}' is not in\n{notes}");
    }
    // Every note is at the head of the file, after the version line that OpenCV requires first.
    let text = text_of(&pinhole, "orb_slam3.yaml");
    assert!(text.starts_with("%YAML:1.0\n# Written by dcvins export for ORB-SLAM3 from the rig 'city'.\n"), "{text}");
    assert_eq!(text.lines().skip(2).take_while(|line| line.starts_with("# ")).count(), pinhole.notes.len() + 1);

    let fisheye = configuration(&rig, OtherEstimator::OrbSlam3, &["cam1"]);
    let settings = parsed(&fisheye, "orb_slam3.yaml");
    assert_eq!(settings["Camera.type"], "KannalaBrandt8");
    check_keys(&settings, "Camera1.k3 Camera1.k4");
    check_transform(&opencv_matrix(&settings["IMU.T_b_c1"]), &imu_from_camera(&rig, "cam1"));
    let notes = fisheye.notes.join("\n");
    assert!(notes.contains("the cameras are rigid") && notes.contains("cam0 here is cam1 of the rig"), "{notes}");
    assert!(notes.contains("takes no mask: that of cam1 is left out"), "{notes}");
}

#[test]
fn what_a_program_lacks_is_refused() {
    let rig = rig();
    let refused = |program, cameras: &[&str]| {
        configure(&rig, program, &keys(cameras), &FixedJointAngles::neutral(&rig)).unwrap_err().to_string()
    };
    assert_eq!(
        refused(OtherEstimator::Basalt, &[]),
        "cam0 is pinhole with radtan, which Basalt lacks; it takes pinhole with none or equidistant (its kb4), and omni (its \
         ucm), eucm and ds with none. Calibrate the camera with one of these models (Kalibr fits any of its own to the same \
         images), or undistort its images and describe them as pinhole with none"
    );
    assert_eq!(refused(OtherEstimator::OrbSlam3, &["cam0", "cam1"]), "ORB-SLAM3 takes one camera, 2 were requested");
    assert_eq!(refused(OtherEstimator::Kalibr, &["cam2"]), "the rig has no camera 'cam2'; it has 'cam0', 'cam1'");
    assert_eq!(refused(OtherEstimator::Kalibr, &["cam1", "cam1"]), "--camera cam1 is given twice");
}

#[test]
fn joint_angles_are_given_in_degrees_within_their_limits() {
    let rig = calibrated();
    let given = |text: &[(&str, f64)]| {
        let named: Vec<(String, f64)> = text.iter().map(|(name, angle)| ((*name).to_owned(), *angle)).collect();
        FixedJointAngles::given(&rig, &named)
    };
    let angles = given(&[("pitch", -30.0)]).unwrap();
    assert_eq!(angles.angles_rad, [0.0, -30.0_f64.to_radians()]);
    let configuration = configure(&rig, OtherEstimator::OrbSlam3, &[], &angles).unwrap();
    let chain = rig.chain_of_camera("cam0").unwrap();
    let settings = parsed(&configuration, "orb_slam3.yaml");
    check_transform(&opencv_matrix(&settings["IMU.T_b_c1"]), &chain.imu_from_camera(&angles.angles_rad));
    assert!(
        configuration.notes[0].contains("at yaw 0.000°, pitch -30.000°, the given angles"),
        "{:?}",
        configuration.notes
    );
    let problem = |text: &[(&str, f64)]| given(text).unwrap_err().to_string();
    assert_eq!(problem(&[("pitch", 10.0)]), "pitch=10 lies beyond the joint's limits, -114.6° to -5.7°");
    assert_eq!(problem(&[("roll", 0.0)]), "the rig has no joint 'roll'; its joints are yaw, pitch");
    assert_eq!(problem(&[("yaw", 1.0), ("yaw", 2.0)]), "the angle of joint 'yaw' is given twice");
}

#[test]
fn files_of_others_are_kept() {
    let rig = rig();
    let configuration = configuration(&rig, OtherEstimator::OpenVins, &[]);
    let folder = tempfile::tempdir().unwrap();
    write_configuration(&configuration, folder.path(), false).unwrap();
    write_configuration(&configuration, folder.path(), false).unwrap();
    std::fs::write(folder.path().join("estimator_config.yaml"), "%YAML:1.0\nuse_fej: true\n").unwrap();
    let problem = write_configuration(&configuration, folder.path(), false).unwrap_err().to_string();
    assert!(problem.starts_with("the file exists and was not written by 'dcvins export'; give --force"), "{problem}");
    write_configuration(&configuration, folder.path(), true).unwrap();
}
