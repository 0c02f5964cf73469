use std::fs;
use std::path::Path;

use nalgebra::Vector3;

use crate::files::RigFile as _;
use crate::flight_log::RigOfLog as _;
use crate::flight_log::tests::RIG;
use crate::flight_log::{FlightLog, LogWriter, LogWriterOptions, MessageTimes};
use crate::sensors::{AttitudeMessage, AttitudeSource, CameraMount, IntrinsicsSigma, Rig};

fn parse(text: &str) -> Result<Rig, String> {
    Rig::from_yaml(text, Path::new("some.rig.yaml")).map_err(|error| error.to_string())
}

#[test]
fn a_rig_reads_back_as_written() {
    let rig = parse(RIG).unwrap();
    let yaml = rig.to_yaml();
    let again = parse(&yaml).unwrap();
    check_same(&rig, &again);
    let mut odd = rig;
    odd.name = "null".into();
    odd.imu.noise.gyroscope_random_walk = 1e-5 / 3.0;
    odd.imu.noise.accelerometer_random_walk = 1e22;
    odd.cameras[0].frame_id = "a \"frame\": #1".into();
    odd.gimbal.as_mut().unwrap().topic = None;
    odd.gimbal.as_mut().unwrap().encoder_sigma_rad = None;
    odd.gimbal.as_mut().unwrap().switches_parameterization = true;
    let yaml = odd.to_yaml();
    assert!(yaml.contains("1.0e+22") && !yaml.contains("1e22"), "{yaml}");
    check_same(&odd, &parse(&yaml).unwrap());
}

#[test]
fn log_times_in_place_of_stamps_are_read_and_written() {
    assert!(!parse(RIG).unwrap().to_yaml().contains("use_log_time"));
    let flagged = RIG
        .replace("rostopic: /imu,", "rostopic: /imu, use_log_time: true,")
        .replace("rostopic: /camera\n", "rostopic: /camera\n  use_log_time: true\n")
        .replace("rostopic: /joints", "rostopic: /joints\n  use_log_time: true")
        .replace("{rostopic: /truth}", "{rostopic: /truth, use_log_time: true}");
    let rig = parse(&flagged).unwrap();
    for topic in ["/imu", "/camera", "/joints", "/truth"] {
        assert!(rig.uses_log_time(topic), "{topic}");
        assert!(!parse(RIG).unwrap().uses_log_time(topic), "{topic}");
    }
    assert!(!rig.uses_log_time("/other"));
    let yaml = rig.to_yaml();
    assert_eq!(yaml.matches("use_log_time: true").count(), 4, "{yaml}");
    check_same(&rig, &parse(&yaml).unwrap());
    let error = parse(&flagged.replace("/imu, use_log_time: true", "/imu, use_log_time: 1")).unwrap_err();
    assert!(error.starts_with("imu0.use_log_time: holds 1, expected true or false"), "{error}");
}

/// Test rig with an IMU on the gimbal, whose entries end with `more`.
fn with_gimbal_imu(more: &str) -> String {
    let noise = "accelerometer_noise_density: 0.002, accelerometer_random_walk: 0.0004, \
                 gyroscope_noise_density: 0.00012, gyroscope_random_walk: 0.00002";
    let axes = "T_cam_imu: [[0, -1, 0, 0.01], [0, 0, -1, 0.02], [1, 0, 0, -0.03], [0, 0, 0, 1]]";
    format!("{RIG}\nimu1: {{mount: gimbal, rostopic: /gimbal/imu, update_rate: 200, {noise}, {axes}{more}}}\n")
}

#[test]
fn an_imu_on_the_gimbal_reads_back_as_written() {
    assert_eq!(parse(RIG).unwrap().gimbal_imu, None);
    let rig = parse(&with_gimbal_imu(", timeshift_imu1_imu: 0.012, use_log_time: true")).unwrap();
    let imu = rig.gimbal_imu.as_ref().unwrap();
    assert_eq!((imu.sensor.topic.as_str(), imu.timeshift_s), ("/gimbal/imu", 0.012));
    // The x axis of the IMU is the camera's viewing direction.
    let forward = imu.camera_from_imu.rotation * Vector3::x();
    assert!((forward - Vector3::z()).norm() < 1e-12, "{forward}");
    assert!(rig.uses_log_time("/gimbal/imu") && !rig.uses_log_time("/imu"));
    let again = parse(&rig.to_yaml()).unwrap().gimbal_imu.unwrap();
    assert_eq!(again.sensor, imu.sensor);
    assert!((again.camera_from_imu.to_matrix() - imu.camera_from_imu.to_matrix()).amax() < 1e-12);
    // Kalibr's further IMUs have no mount.
    let kalibr = parse(&with_gimbal_imu("").replace("mount: gimbal, rostopic: /gimbal/imu", "rostopic: /gimbal/imu"));
    assert_eq!(kalibr.unwrap().gimbal_imu, None);
}

#[test]
fn a_wrong_imu_on_the_gimbal_is_named() {
    let check = |from: &str, to: &str, expected: &str| {
        let text = with_gimbal_imu("");
        assert!(text.contains(from), "{from}");
        let error = parse(&text.replace(from, to)).unwrap_err();
        assert!(error.contains(expected), "{to}: {error}");
    };
    check("{mount: gimbal, rostopic: /gimbal/imu", "{mount: tail, rostopic: /gimbal/imu", "imu1.mount");
    check("rostopic: /gimbal/imu", "rostopic: /imu", "topic of imu0");
    check("gyroscope_random_walk: 0.00002, ", "", "imu1.gyroscope_random_walk");
    check("T_cam_imu: [[0, -1, 0, 0.01],", "T_cam_imu: [[0, -2, 0, 0.01],", "imu1.T_cam_imu");
    check("update_rate: 200, accel", "update_rate: 200, axes: z, accel", "imu1.axes");
    let error = parse(&with_gimbal_imu(", timeshift_imu1_imu: 100")).unwrap_err();
    assert!(error.contains("imu1.timeshift_imu1_imu"), "{error}");
}

/// Test rig with a source in place of its topic of joint angles.
fn with_source(source: &str) -> String {
    RIG.replace("rostopic: /joints", &format!("source: {source}"))
}

#[test]
fn every_source_of_the_gimbals_attitude_reads_back_as_written() {
    for source in [
        "{topic: /g, type: quaternion, frame: body, axes: flu}",
        "{topic: /g, type: pose, frame: vehicle, axes: frd, vehicle: /v, vehicle_axes: flu}",
        "{topic: /g, type: euler, frame: earth, axes: frd, order: yaw=z roll=y pitch=-x, unit: deg, vehicle: /v}",
        "{topic: /tf, type: tf, frame: body, axes: flu, parent: base_link, child: camera, gimbal_axes: rdf, imu_axes: frd}",
        "{topic: /g, type: mavros, vehicle: /v, vehicle_axes: flu}",
        "{topic: /g, type: px4, frame: earth, vehicle: /v, first_joint_offset: -1.5}",
    ] {
        let rig = parse(&with_source(&format!("{source}\n  timeshift_gimbal_imu: -0.08"))).unwrap();
        let gimbal = rig.gimbal.as_ref().unwrap();
        assert!(gimbal.topic.is_some() && gimbal.attitude.is_some(), "{source}");
        assert_eq!(gimbal.timeshift_gimbal_imu_s, -0.08);
        check_same(&rig, &parse(&rig.to_yaml()).unwrap());
    }
    // A calibrated chain leaves the joint angles unchanged.
    let mut calibrated = parse(&with_source("{topic: /g, type: quaternion, frame: body, axes: flu}")).unwrap();
    let gimbal = calibrated.gimbal.as_mut().unwrap();
    let given = gimbal.chain.clone();
    for theta_offset_rad in [-1.4, -1.3] {
        let mut chain = given.clone();
        chain.links[0].theta_offset_rad = theta_offset_rad;
        gimbal.set_chain(chain);
    }
    assert_eq!(gimbal.chain.links[0].theta_offset_rad, -1.3);
    assert_eq!(gimbal.attitude.as_ref().unwrap().chain.as_deref(), Some(&given));
    check_same(&calibrated, &parse(&calibrated.to_yaml()).unwrap());
    let wanted = given.imu_from_camera(&[0.7]).rotation;
    let angles_rad = calibrated.gimbal.unwrap().inverse_chain().unwrap().solve(&wanted, None).joint_angles_rad;
    assert!((angles_rad[0] - 0.7).abs() < 1e-9, "{angles_rad:?}");
    let euler = parse(&with_source(
        "{topic: /g, type: euler, frame: body, axes: frd, order: yaw=z roll=y pitch=-x, unit: deg}",
    ));
    let euler = euler.unwrap().gimbal.unwrap().attitude.unwrap();
    let yaml = parse(RIG).map(|rig| rig.to_yaml()).unwrap();
    assert!(!yaml.contains("source") && !yaml.contains("timeshift_gimbal_imu"), "{yaml}");
    assert!(matches!(euler.message, AttitudeMessage::Euler(angles) if angles.order.len() == 3));
}

#[test]
fn what_a_source_lacks_is_named_with_the_possible_values() {
    let full = "{topic: /g, type: euler, frame: earth, axes: frd, order: yaw=z roll=y pitch=x, unit: deg, vehicle: /v}";
    let check = |found: &str, replaced: &str, expected: &str| {
        assert!(full.contains(found), "{found}");
        let error = parse(&with_source(&full.replace(found, replaced))).unwrap_err();
        assert!(error.starts_with(&format!("gimbal.source.{expected}")), "{error}");
    };
    check("topic: /g, ", "", "topic: missing, expected the topic of the gimbal's attitude");
    check("type: euler, ", "", "type: missing, expected quaternion, pose, euler, tf, mavros or px4");
    check("type: euler", "type: angles", "type: holds the text 'angles', expected quaternion, pose");
    check("frame: earth, ", "", "frame: missing, expected body, vehicle (levelled, x towards the heading) or earth");
    check("frame: earth", "frame: flags", "frame: holds the text 'flags', expected body");
    check("axes: frd, ", "", "axes: missing, expected frd (forward, right, down; earth: NED) or flu");
    check("order: yaw=z roll=y pitch=x, ", "", "order: missing, expected rotations in their order");
    check("pitch=x", "pitch=y", "order: holds the text 'yaw=z roll=y pitch=y', expected rotations");
    check("unit: deg, ", "", "unit: missing, expected rad or deg");
    check(", vehicle: /v", "", "vehicle: missing, expected the topic of the vehicle's attitude");
    check("type: euler", "type: quaternion", "order: has no meaning with type quaternion, only with euler");
    check("axes: frd", "axes: frd, imu_axes: fru", "imu_axes: holds the text 'fru', expected three letters");
    check("axes: frd", "axes: frd, axis: z", "axis: unknown key, the nearest known key is 'axes'");
    let error = parse(&with_source("{topic: /tf, type: tf, frame: body, axes: flu, parent: a}")).unwrap_err();
    assert!(error.starts_with("gimbal.source.child: missing, expected the name of the gimbal's frame"), "{error}");
    let both = RIG.replace("rostopic: /joints", &format!("rostopic: /joints\n  source: {full}"));
    assert!(parse(&both).unwrap_err().starts_with("gimbal.rostopic: is given together with gimbal.source"));
    let far = RIG.replace("rostopic: /joints", "rostopic: /joints\n  timeshift_gimbal_imu: 100");
    assert!(parse(&far).unwrap_err().starts_with("gimbal.timeshift_gimbal_imu: holds 100, expected seconds"));
}

/// Checks that two rigs are equal in every number but the rotations, which are equal to within rounding.
fn check_same(a: &Rig, b: &Rig) {
    let (mut b, mut worst) = (b.clone(), 0.0_f64);
    let mut settle = |a: &crate::geometry::RigidTransform, b: &mut crate::geometry::RigidTransform| {
        worst = worst.max(a.minus(b).norm());
        *b = *a;
    };
    for (a, b) in a.cameras.iter().zip(&mut b.cameras) {
        if let (CameraMount::Static { imu_from_camera: a }, CameraMount::Static { imu_from_camera: b }) =
            (&a.mount, &mut b.mount)
        {
            settle(a, b);
        }
    }
    if let (Some(a), Some(b)) = (&a.gimbal, &mut b.gimbal) {
        settle(&a.chain.imu_from_base, &mut b.chain.imu_from_base);
        settle(&a.chain.effector_from_camera, &mut b.chain.effector_from_camera);
        let chain_of_source = |source: &AttitudeSource| source.chain.clone();
        if let (Some(a), Some(b)) =
            (a.attitude.as_ref().and_then(chain_of_source), b.attitude.as_mut().and_then(|b| b.chain.as_mut()))
        {
            settle(&a.imu_from_base, &mut b.imu_from_base);
            settle(&a.effector_from_camera, &mut b.effector_from_camera);
        }
    }
    assert!(worst < 1e-14, "{worst}");
    assert_eq!(*a, b);
}

/// Test rig with further lines in `cam0`, and further keys in `imu0`.
fn with_sensors(camera: &str, imu: &str) -> String {
    RIG.replace("  timeshift_cam_imu: 0.0\n", &format!("  timeshift_cam_imu: 0.0\n{camera}"))
        .replace("gyroscope_random_walk: 3.9e-5}", &format!("gyroscope_random_walk: 3.9e-5{imu}}}"))
}

#[test]
fn shutter_and_intrinsics_read_back_as_written() {
    const IMU: &str = ", gyroscopes: {M: [[1.01, 0, 0], [0.002, 0.99, 0], [-0.003, 0.004, 1.02]], C_gyro_i: [[0.8, -0.6, 0], \
                       [0.6, 0.8, 0], [0, 0, 1]]}, accelerometers: {M: [[1.01, 0, 0], [0.02, 1, 0], [0, 0, 0.97]]}";
    let camera = "  readout: -0.0213\n  readout_sigma: 4.0e-4\n  \
                  intrinsics_sigma: {focal: 0.01, centre: 5.0, distortion: 0.02}\n";
    let rig = parse(&with_sensors(camera, IMU)).unwrap();
    let sigma = IntrinsicsSigma { focal_ratio: 0.01, centre_px: 5.0, distortion: 0.02 };
    let camera = &rig.cameras[0];
    assert_eq!(
        (camera.readout_s, camera.readout_sigma_s, camera.intrinsics_sigma),
        (-0.0213, Some(4.0e-4), Some(sigma))
    );
    assert!((camera.row_time_s(24.0) + 0.01065).abs() < 1e-15);
    let yaml = rig.to_yaml();
    let mut again = parse(&yaml).unwrap();
    let (kalibr, written) = (rig.imu.intrinsics.to_kalibr().unwrap(), again.imu.intrinsics.to_kalibr().unwrap());
    assert!((kalibr.gyroscope_m - written.gyroscope_m).amax() < 1e-14, "{yaml}");
    assert!(
        (kalibr.gyroscope_m[(1, 0)] - 0.002).abs() < 1e-14 && (kalibr.gyroscope_from_imu[(0, 0)] - 0.8).abs() < 1e-14
    );
    assert!((kalibr.accelerometer_m - written.accelerometer_m).amax() < 1e-14, "{yaml}");
    again.imu.intrinsics = rig.imu.intrinsics;
    check_same(&rig, &again);
    // Missing fields are not written.
    let yaml = parse(RIG).unwrap().to_yaml();
    assert!(["readout", "intrinsics_sigma", "gyroscopes", "accelerometers"].iter().all(|key| !yaml.contains(key)));
    // Kalibr's time from one row to the next.
    let rig = parse(&with_sensors("  line_delay: 0.0005\n", "")).unwrap();
    assert_eq!(rig.cameras[0].readout_s, 0.0005 * 48.0);
}

#[test]
fn wrong_shutters_and_intrinsics_are_named() {
    let check = |camera: &str, imu: &str, expected: &str| {
        let error = parse(&with_sensors(camera, imu)).unwrap_err();
        assert!(error.starts_with(expected), "{error}\nexpected {expected}");
    };
    check("  readout: 30\n", "", "cam0.readout: a readout of 30 s, expected seconds, at most 0.2 either way");
    check("  line_delay: 30\n", "", "cam0.line_delay: a readout of 1440 s, expected seconds");
    check("  line_delay: 1e-5\n  readout: 0.03\n", "", "cam0.line_delay: is given together with readout");
    check("  readout_sigma: 0\n", "", "cam0.readout_sigma: holds 0, expected a standard deviation greater than 0");
    check("  intrinsics_sigma: {focal: 0.01, centre: 5}\n", "", "cam0.intrinsics_sigma.distortion: missing, expected");
    check(
        "  intrinsics_sigma: {focal: 3, centre: 5, distortion: 0.1}\n",
        "",
        "cam0.intrinsics_sigma.focal: holds 3, expected a ratio",
    );
    check(
        "  intrinsics_sigma: {focal: 0.1, centre: 5, distortion: 0.1, fx: 1}\n",
        "",
        "cam0.intrinsics_sigma.fx: unknown key, the nearest known key is",
    );
    check("", ", gyroscopes: {M: [[1, 0], [0, 1]]}", "imu0.gyroscopes.M: 2 rows, expected 3 rows of 3 numbers");
    check(
        "",
        ", gyroscopes: {M: [[100, 0, 0], [0, 1, 0], [0, 0, 1]]}",
        "imu0.gyroscopes.M: an entry is 99.000 from the identity",
    );
    check(
        "",
        ", gyroscopes: {C_gyro_i: [[1, 0, 0], [0, 1, 0], [0, 0, -1]]}",
        "imu0.gyroscopes.C_gyro_i: has determinant -1.0000",
    );
    check("", ", accelerometers: {C: 3}", "imu0.accelerometers.C: unknown key, the nearest known key is 'M'");
}

#[test]
fn a_wrong_field_is_named_with_its_value() {
    let cases = [
        (
            "intrinsics: [50.0, 50.0, 31.5, 23.5]",
            "intrinsics: [50.0, 50.0, 31.5]",
            "cam0.intrinsics: 3 numbers, expected 4 (fx fy cx cy)",
        ),
        (
            "intrinsics: [50.0, 50.0, 31.5, 23.5]",
            "intrinsics: [-50.0, 50.0, 31.5, 2]",
            "cam0.intrinsics: focal length fx is -50, expected a positive number of pixels",
        ),
        ("  intrinsics: [50.0, 50.0, 31.5, 23.5]\n", "", "cam0.intrinsics: missing, expected 4 numbers (fx fy cx cy)"),
        ("resolution: [64, 48]", "resolution: [64.5, 48]", "cam0.resolution: 64.5×48, expected whole pixels"),
        ("distortion_model: none", "distortion_model: fov", "cam0.distortion_coeffs: 4 numbers, expected 1 (w)"),
        ("camera_model: pinhole", "camera_model: ds", "cam0.intrinsics: 4 numbers, expected 6 (xi alpha fx fy cx cy)"),
        ("mount: gimbal", "mount: fixed", "cam0.mount: holds the text 'fixed', expected gimbal or static"),
        ("mount: gimbal", "mount: static", "cam0.T_cam_imu: missing, expected 4 rows of 4 numbers"),
        (
            "camera_model: pinhole",
            "camera_model: fisheye",
            "cam0.camera_model: holds the text 'fisheye', expected pinhole",
        ),
        (
            "distortion_model: none",
            "distortion_model: brown",
            "cam0.distortion_model: holds the text 'brown', expected none, radtan",
        ),
        ("gravity: 9.81", "gravity: -9.81", "gravity: holds -9.81, expected gravity's magnitude in m/s²"),
        ("gravity: 9.81\n", "", "gravity: missing, expected gravity's magnitude"),
        ("update_rate: 200.0", "update_rate: fast", "imu0.update_rate: holds the text 'fast', expected the rate in Hz"),
        (
            "gyroscope_noise_density: 3.4e-4",
            "gyro_noise: 3.4e-4",
            "imu0.gyroscope_noise_density: missing, expected a number greater than 0 in rad/s/√Hz",
        ),
        ("rig_version: 1", "rig_version: 2", "rig_version: holds 2, expected the number 1"),
        ("encoder_sigma: 0.0087", "encoder_sigma: -1", "gimbal.encoder_sigma: holds -1, expected a standard deviation"),
        (
            "encoder_sigma: 0.0087",
            "parameterization: classical",
            "gimbal.parameterization: holds 'classical', expected auto, or nothing",
        ),
        (
            "T_I_B: [[1, 0, 0, 0.1]",
            "T_I_B: [[1.1, 0, 0, 0.1]",
            "gimbal.T_I_B: the upper left 3×3 block has determinant 1.1000",
        ),
        ("T_I_B: [[1, 0, 0, 0.1], ", "T_I_B: [", "gimbal.T_I_B: 3 rows, expected 4 rows of 4 numbers"),
        ("[0, 1, 0, 0]", "[0, 1, 0]", "gimbal.T_I_B[1]: 3 numbers, expected 4 numbers, a row"),
        (
            "limits: [-3.14, 3.14]",
            "limits: [3.14, -3.14]",
            "gimbal.links[0].limits: lower limit 3.14 not below upper limit -3.14",
        ),
        ("alpha: -1.55, ", "", "gimbal.links[0].alpha: missing, expected an angle in rad"),
        ("cam0:", "camera:", "cam0: missing, expected at least one camera"),
        ("gimbal:\n", "gimble:\n", "gimbal: missing, expected a gimbal, since cam0.mount is gimbal"),
    ];
    assert!(parse(RIG).is_ok());
    for (from, to, expected) in cases {
        assert!(RIG.contains(from), "{from}");
        let message = parse(&RIG.replacen(from, to, 1)).unwrap_err();
        assert!(message.starts_with(expected), "{message}\nexpected {expected}");
        assert!(message.ends_with("some.rig.yaml"), "{message}");
    }
    let syntax = parse("rig_version: [1").unwrap_err();
    assert!(syntax.contains("not valid YAML"), "{syntax}");
}

#[test]
fn an_unknown_key_is_named_with_the_nearest_known_one() {
    let cases = [
        (
            "timeshift_cam_imu: 0.0",
            "timeshift_cam_imuu: 0.05",
            "cam0.timeshift_cam_imuu: unknown key, the nearest known key is 'timeshift_cam_imu', line 16",
        ),
        ("limits: [", "limit: [", "gimbal.links[0].limit: unknown key, the nearest known key is 'limits', line 24"),
        ("rig_version: 1", "rig_version: 1\nnames: x", "names: unknown key, the nearest known key is 'name', line 2"),
        ("{rostopic: /truth}", "{rostopic: /truth, topic: /t}", "ground_truth.topic: unknown key"),
        ("rotation_bound: 0.0087", "rotation_bound: 0.0087, turn_bound: 1", "gimbal.prior.turn_bound: unknown key"),
        ("frame_id: imu,", "frame: imu,", "imu0.frame: unknown key, the nearest known key is 'frame_id'"),
        (
            "mount: gimbal",
            "mount: gimbal\n  T_imu_cam: []",
            "cam0.T_imu_cam: unknown key, expected T_cam_imu, the inverse",
        ),
        // A required key is missing, and the text names the key that may be meant.
        (
            "gravity: 9.81",
            "gravty: 9.81",
            "gravity: missing, expected gravity's magnitude in m/s²; the key 'gravty' is unknown",
        ),
    ];
    for (from, to, expected) in cases {
        assert!(RIG.contains(from), "{from}");
        let message = parse(&RIG.replacen(from, to, 1)).unwrap_err();
        assert!(message.starts_with(expected), "{message}\nexpected {expected}");
    }
    let several = RIG.replace("frame_id", "frame_ID").replace("encoder_sigma", "encoder_sigm");
    let message = parse(&several).unwrap_err();
    assert!(
        message.contains("also unknown: ") && message.contains("gimbal.encoder_sigm ('encoder_sigma'?)"),
        "{message}"
    );
    let hostile = RIG.replace("rig_version: 1", "rig_version: 1\n\"\\e[2J\": 1");
    let message = parse(&hostile).unwrap_err();
    assert!(message.starts_with(r"\u{1b}[2J: unknown key"), "{message}");
    let message = parse(&RIG.replace("joint: yaw", "joint: \"yaw\\e[2J\\n\"")).unwrap_err();
    assert!(message.starts_with(r"gimbal.links[0].joint: holds 'yaw\u{1b}[2J\n', expected text without"), "{message}");
}

#[test]
fn a_required_accuracy_is_read_and_written_and_a_wrong_one_has_its_line() {
    let with = |values: &str| RIG.replace("gravity: 9.81", &format!("gravity: 9.81\nrequired_accuracy: {{{values}}}"));
    let rig = parse(&with("translation: 0.01, yaw.a: 0.002, timeshift: 3.0e-3")).unwrap();
    let names = rig.parameter_names();
    let of = |name: &str| rig.required_accuracy.of(names.parse(name).unwrap());
    assert_eq!([of("yaw.d"), of("yaw.a"), of("timeshift")], [0.01, 0.002, 0.003]);
    assert_eq!(of("yaw.alpha"), 0.1_f64.to_radians());
    assert_eq!(parse(&rig.to_yaml()).unwrap().required_accuracy, rig.required_accuracy);
    let line = with("").lines().position(|line| line.starts_with("required_accuracy")).unwrap() + 1;
    for (values, expected) in [
        ("translation: 0", "required_accuracy.translation: holds 0, expected a standard deviation in m"),
        ("rotation: -0.1", "required_accuracy.rotation: holds -0.1, expected a standard deviation in rad"),
        ("rotation: 1e999", "the rig is not valid YAML: line "),
        ("yaw.a: nan", "required_accuracy.yaw.a: holds"),
        ("yaw.alpha: []", "required_accuracy.yaw.alpha: holds"),
        ("roll.a: 0.1", "required_accuracy.roll.a: 'roll.a' is no parameter, expected translation, rotation or a"),
    ] {
        let message = parse(&with(values)).unwrap_err();
        assert!(message.starts_with(expected) && message.contains(&format!("line {line}")), "{message}\n{expected}");
    }
}

#[test]
fn angles_in_degrees_are_named_with_their_radians() {
    let cases = [
        (
            "theta_offset: -1.56",
            "theta_offset: -90",
            "gimbal.links[0].theta_offset: holds -90, which looks like degrees",
        ),
        ("alpha: -1.55", "alpha: 90.5", "gimbal.links[0].alpha: holds 90.5, which looks like degrees"),
        (
            "limits: [-3.14, 3.14]",
            "limits: [-180, 180]",
            "gimbal.links[0].limits: holds -180, which looks like degrees",
        ),
        ("encoder_sigma: 0.0087", "encoder_sigma: 0.6", "gimbal.encoder_sigma: holds 0.6, which looks like degrees"),
        (
            "rotation_bound: 0.0087",
            "rotation_bound: 5",
            "gimbal.prior.rotation_bound: holds 5, which looks like degrees",
        ),
    ];
    for (from, to, expected) in cases {
        let message = parse(&RIG.replacen(from, to, 1)).unwrap_err();
        assert!(message.starts_with(expected), "{message}\nexpected {expected}");
    }
    let message = parse(&RIG.replacen("theta_offset: -1.56", "theta_offset: -90", 1)).unwrap_err();
    assert!(message.contains("(-90° are -1.570796)"), "{message}");
    // A slip ring with limits of two revolutions, and a full revolution as an offset.
    assert!(parse(&RIG.replacen("[-3.14, 3.14]", "[-12.5, 12.5]", 1)).is_ok());
    assert!(parse(&RIG.replacen("theta_offset: -1.56", "theta_offset: 6.28", 1)).is_ok());
}

#[test]
fn sizes_are_bounded() {
    let link = "  - {joint: yaw, theta_offset: -1.56, d: 0.046, a: 0.016, alpha: -1.55, limits: [-3.14, 3.14]}\n";
    let links = |count: usize| {
        let links: String = (0..count).map(|number| link.replace("yaw", &format!("j{number}"))).collect();
        parse(&RIG.replace(link, &links))
    };
    assert_eq!(links(16).unwrap().gimbal.unwrap().joints.len(), 16);
    let message = links(17).unwrap_err();
    assert!(message.starts_with("gimbal.links: 17 links, expected at most 16"), "{message}");
    let message = links(5000).unwrap_err();
    assert!(message.starts_with("gimbal.links: 5000 links, expected at most 16"), "{message}");
    let message = parse(&RIG.replace("rostopic: /camera", &format!("rostopic: /{}", "c".repeat(5000)))).unwrap_err();
    assert!(message.starts_with("cam0.rostopic: 5001 bytes of text, expected at most 1024"), "{message}");

    let folder = tempfile::TempDir::new().unwrap();
    let path = folder.path().join("large.rig.yaml");
    fs::write(&path, format!("# {}\n{RIG}", "x".repeat(2 << 20))).unwrap();
    let message = Rig::from_file(&path).unwrap_err().to_string();
    assert!(message.contains("more than 1048576 bytes"), "{message}");
    fs::write(&path, b"rig_version: 1\nname: \xff\n").unwrap();
    let message = Rig::from_file(&path).unwrap_err().to_string();
    assert!(message.contains("line 2: byte 21 is not UTF-8"), "{message}");
}

const CAMERA_CHAIN: &str = "\
cam0:
  T_cam_imu:
  - [0.0, 1.0, 0.0, 0.065]
  - [-1.0, 0.0, 0.0, -0.02]
  - [0.0, 0.0, 1.0, -0.008]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.28, 0.07, 0.0002, 1.8e-05]
  distortion_model: radtan
  intrinsics: [458.6, 457.3, 367.2, 248.4]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
  timeshift_cam_imu: 0.0012
  update_rate: 20.0
";
const IMU: &str = "\
accelerometer_noise_density: 0.002
accelerometer_random_walk: 0.003
gyroscope_noise_density: 0.00017
gyroscope_random_walk: 1.9e-05
rostopic: /imu0
update_rate: 200.0
";

#[test]
fn kalibrs_files_are_a_rig() {
    let folder = tempfile::TempDir::new().unwrap();
    let chain = folder.path().join("camchain-imucam.yaml");
    fs::write(&chain, CAMERA_CHAIN).unwrap();
    let missing = Rig::from_file(&chain).unwrap_err().to_string();
    assert!(missing.contains("imu0: missing, expected the IMU in one of imu.yaml, imu0.yaml"), "{missing}");
    fs::write(folder.path().join("imu.yaml"), IMU).unwrap();
    let rig = Rig::from_file(&chain).unwrap();
    assert_eq!((rig.imu.topic.as_str(), rig.imu.rate_hz, rig.cameras.len()), ("/imu0", 200.0, 1));
    let camera = &rig.cameras[0];
    assert_eq!(camera.timeshift_cam_imu_s, 0.0012);
    let CameraMount::Static { imu_from_camera } = &camera.mount else { panic!("static") };
    assert!((imu_from_camera.inverse().translation_m.x - 0.065).abs() < 1e-15);
    check_same(&rig, &parse(&rig.to_yaml()).unwrap());

    // File of a named run, with the IMU nested as in Kalibr's result.
    let chain = folder.path().join("camchain-imucam-flight.yaml");
    fs::write(&chain, CAMERA_CHAIN).unwrap();
    let nested = format!("  {}", IMU.trim_end().replace('\n', "\n  "));
    fs::write(folder.path().join("imu-flight.yaml"), format!("imu0:\n{nested}\n").replace("/imu0", "/other")).unwrap();
    assert_eq!(Rig::from_file(&chain).unwrap().imu.topic, "/other");
}

#[test]
fn poses_of_kalibrs_cameras_are_chained() {
    let folder = tempfile::TempDir::new().unwrap();
    let chain = folder.path().join("camchain-imucam.yaml");
    fs::write(folder.path().join("imu.yaml"), IMU).unwrap();
    let begin = CAMERA_CHAIN.find("  T_cam_imu").unwrap();
    let end = CAMERA_CHAIN.find("  cam_overlaps").unwrap();
    let relative = "  T_cn_cnm1:\n  - [0.0, 0.0, 1.0, 0.1]\n  - [0.0, 1.0, 0.0, 0.0]\n  - [-1.0, 0.0, 0.0, 0.0]\n  \
                    - [0.0, 0.0, 0.0, 1.0]\n";
    let lens = &CAMERA_CHAIN[end..];
    fs::write(&chain, format!("{CAMERA_CHAIN}cam1:\n{relative}{lens}cam2:\n{relative}{lens}")).unwrap();
    let rig = Rig::from_file(&chain).unwrap();
    let from_imu = |camera: usize| {
        let CameraMount::Static { imu_from_camera } = &rig.cameras[camera].mount else { panic!("static") };
        imu_from_camera.inverse()
    };
    let at = Vector3::new(0.3, -0.2, 0.7);
    for camera in [1, 2] {
        let before = from_imu(camera - 1).transform(&at);
        let expected = Vector3::new(before.z + 0.1, before.y, -before.x);
        assert!((from_imu(camera).transform(&at) - expected).norm() < 1e-12, "cam{camera}");
    }
    let alone = format!("{}{}", &CAMERA_CHAIN[..begin], lens);
    fs::write(&chain, alone).unwrap();
    let message = Rig::from_file(&chain).unwrap_err().to_string();
    assert!(
        message.starts_with("cam0.T_cam_imu: missing") && message.contains("kalibr_calibrate_imu_camera"),
        "{message}"
    );
}

/// OpenVINS's chain has the inverse transform and the first line of `OpenCV`'s files; its IMU has other names of matrices.
#[test]
fn a_camera_chain_of_openvins_is_read_as_one_of_kalibr() {
    let folder = tempfile::TempDir::new().unwrap();
    let [kalibr, openvins] = ["camchain-imucam.yaml", "kalibr_imucam_chain.yaml"].map(|name| folder.path().join(name));
    let scale = "[[1.02, 0.0, 0.0], [0.01, 0.99, 0.0], [0.0, 0.0, 1.0]]";
    fs::write(
        folder.path().join("imu.yaml"),
        format!("{IMU}gyroscopes: {{M: {scale}}}\naccelerometers: {{M: {scale}}}\n"),
    )
    .unwrap();
    fs::write(&kalibr, CAMERA_CHAIN).unwrap();
    let expected = Rig::from_file(&kalibr).unwrap();
    let CameraMount::Static { imu_from_camera } = &expected.cameras[0].mount else { panic!("static") };
    let (begin, end) = (CAMERA_CHAIN.find("  T_cam_imu").unwrap(), CAMERA_CHAIN.find("  cam_overlaps").unwrap());
    let matrix = imu_from_camera.to_matrix();
    let rows = matrix.row_iter().map(|row| format!("  - {:?}\n", row.iter().collect::<Vec<_>>()));
    let inverse = format!("  T_imu_cam: # camera to IMU\n{}", rows.collect::<String>());
    let chain = format!("%YAML:1.0\n\n{}{inverse}{}", &CAMERA_CHAIN[..begin], &CAMERA_CHAIN[end..]);
    fs::write(&openvins, &chain).unwrap();
    let nested = format!("  {}", IMU.trim_end().replace('\n', "\n  "));
    let imu = format!(
        "%YAML:1.0\n\nimu0:\n{nested}\n  Tw: {scale}\n  Ta: {scale}\n  Tg: [[0, 0, 0], [0, 0, 0], [0, 0, 0]]\n"
    );
    fs::write(folder.path().join("kalibr_imu_chain.yaml"), imu).unwrap();
    let found = Rig::from_file(&openvins).unwrap();
    assert_eq!(found.imu, expected.imu);
    assert!(!found.imu.intrinsics.is_identity());
    let CameraMount::Static { imu_from_camera: read } = &found.cameras[0].mount else { panic!("static") };
    assert!((read.to_matrix() - imu_from_camera.to_matrix()).amax() < 1e-12);
    // Lines keep their numbers.
    fs::write(&openvins, chain.replace("752", "wide")).unwrap();
    let message = Rig::from_file(&openvins).unwrap_err().to_string();
    assert!(message.contains("cam0.resolution") && message.contains("line 14"), "{message}");
}

#[test]
fn byte_order_marks_line_ends_and_spaces_make_no_difference() {
    let folder = tempfile::TempDir::new().unwrap();
    let path = folder.path().join("windows.rig.yaml");
    fs::write(&path, format!("\u{feff}{}", RIG.replace('\n', "  \r\n"))).unwrap();
    check_same(&parse(RIG).unwrap(), &Rig::from_file(&path).unwrap());
}

#[test]
fn keys_of_kalibr_without_a_use_are_listed() {
    use crate::flight_log::{FlightLog, LogWriter, LogWriterOptions, MessageTimes};
    let folder = tempfile::TempDir::new().unwrap();
    let path = folder.path().join("flight.mcap");
    let mut writer = LogWriter::create(&path, &LogWriterOptions::default()).unwrap();
    let times = MessageTimes { stamp_ns: 1_000_000_000, log_time_ns: 1_000_000_000 };
    writer.write_imu("/imu0", "imu", times, &nalgebra::Vector3::zeros(), &nalgebra::Vector3::z()).unwrap();
    writer.finish().unwrap();
    let chain = folder.path().join("camchain-imucam.yaml");
    fs::write(&chain, format!("{CAMERA_CHAIN}  T_cn_cnm1:\n  - [1.0, 0.0, 0.0, 0.0]\n")).unwrap();
    let imu = "model: calibrated\ntime_offset: 0.0\nT_i_b:\n- [1.0, 0.0, 0.0, 0.0]\n";
    fs::write(folder.path().join("imu.yaml"), format!("{IMU}{imu}")).unwrap();
    let log = FlightLog::open(&path).unwrap();
    let (_, unused) = Rig::for_log_with_unused_keys(&log, Some(&chain)).unwrap();
    assert_eq!(unused, ["cam0.T_cn_cnm1", "cam0.cam_overlaps", "T_i_b", "model", "time_offset"]);
    // An unknown key of the IMU file is reported with that file.
    fs::write(folder.path().join("imu.yaml"), format!("{IMU}updaterate: 1\n")).unwrap();
    let message = Rig::for_log(&log, Some(&chain)).unwrap_err().to_string();
    assert!(
        message.starts_with("updaterate: unknown key, the nearest known key is 'update_rate', line 7"),
        "{message}"
    );
    assert!(message.ends_with("imu.yaml"), "{message}");
}

/// Writes a mask of this size whose upper half is white.
fn write_mask(path: &Path, width: u32, height: u32) {
    let image =
        image::GrayImage::from_fn(width, height, |_, row| image::Luma([if row < height / 2 { 255 } else { 0 }]));
    image.save(path).unwrap();
}

#[test]
fn a_mask_lies_beside_the_rig_or_is_attached_with_it() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let [width, height] = parse(RIG).unwrap().cameras[0].model.resolution_px;
    write_mask(&at("arm.png"), width as u32, height as u32);
    write_mask(&at("small.png"), 16, 8);
    fs::write(at("text.png"), "no image").unwrap();
    let with_mask = |mask: &str| RIG.replacen("  mount: gimbal", &format!("  mask: {mask}\n  mount: gimbal"), 1);
    let read = |mask: &str| {
        fs::write(at("x.rig.yaml"), with_mask(mask)).unwrap();
        Rig::from_file(&at("x.rig.yaml")).map_err(|error| error.to_string())
    };
    let rig = read("arm.png").unwrap();
    let mask = rig.cameras[0].mask.as_ref().unwrap();
    assert_eq!((mask.file.as_str(), mask.image.size_px()), ("arm.png", [width, height]));
    assert!(mask.image.is_masked(0, height / 2 - 1) && !mask.image.is_masked(0, height / 2));
    assert!(rig.to_yaml().contains("  mask: arm.png\n"));
    let check = |mask: &str, expected: &str| {
        let error = read(mask).unwrap_err();
        assert!(error.contains("cam0.mask") && error.contains(expected), "{error}");
    };
    check("small.png", &format!("16×8 pixels, expected the resolution of the camera, {width}×{height}"));
    check("missing.png", "no such file");
    check("text.png", "not a readable PNG");
    check("../arm.png", "in the folder of the rig");
    check("/dev/zero", "in the folder of the rig");

    // A log with both as attachments needs no file.
    let path = at("flight.mcap");
    let mut writer = LogWriter::create(&path, &LogWriterOptions::default()).unwrap();
    writer.attach("x.rig.yaml", "application/yaml", &with_mask("arm.png"), 0).unwrap();
    writer.attach("arm.png", "image/png", &fs::read(at("arm.png")).unwrap(), 0).unwrap();
    let times = MessageTimes { stamp_ns: 1_000_000_000, log_time_ns: 1_000_000_000 };
    writer.write_imu("/imu", "imu", times, &Vector3::zeros(), &Vector3::z()).unwrap();
    writer.finish().unwrap();
    fs::remove_file(at("arm.png")).unwrap();
    let log = FlightLog::open(&path).unwrap();
    assert_eq!(Rig::for_log(&log, None).unwrap().cameras[0].mask, rig.cameras[0].mask);
}

#[test]
fn a_camera_may_be_calibrated_relative_to_the_one_before_it() {
    use crate::geometry::RigidTransform;
    use crate::sensors::ChainPrior;
    use crate::simulation::{SyntheticMount, SyntheticOptions, synthetic_tracks};
    let rig = |mount| {
        let options = SyntheticOptions { mount, duration_s: 0.1, beside: true, ..SyntheticOptions::default() };
        synthetic_tracks(&options).given_rig
    };
    for mount in [SyntheticMount::Static, SyntheticMount::Gimbal] {
        let mut rig = rig(mount);
        rig.cameras[1].relative_prior = Some(ChainPrior { translation_bound_m: 0.002, rotation_bound_rad: 0.01 });
        let text = rig.to_yaml();
        let read = parse(&text).unwrap();
        assert_eq!(read.cameras[1].relative_prior, rig.cameras[1].relative_prior);
        let pose = |rig: &Rig| rig.base_from_camera(Some("cam0"), "cam1").unwrap();
        assert!(pose(&read).minus(&pose(&rig)).norm() < 1e-9);
        assert_eq!(read.base_of(&read.cameras[1]).map(|base| base.key.as_str()), Some("cam0"));
        assert_eq!(read.stereo_partner(&read.cameras[0]).is_some(), mount == SyntheticMount::Static);
        assert_eq!((read.camera_number("cam0"), read.camera_number("cam1")), (0, 1));
        let chains = ["cam0", "cam1"].map(|key| read.chain_of_camera(key).unwrap());
        let angles = vec![0.2; chains[0].joint_count()];
        let [first, second] = chains.map(|chain| chain.imu_from_camera(&angles));
        assert!((first.inverse() * second).minus(&pose(&rig)).norm() < 1e-9);
        let mut moved = read.clone();
        let change = RigidTransform::new(pose(&read).rotation, Vector3::new(0.0, 0.3, 0.0));
        moved.set_base_from_camera(Some("cam0"), "cam1", change);
        assert!(pose(&moved).minus(&change).norm() < 1e-9);

        let lines: Vec<&str> = text.lines().collect();
        let at = lines.iter().position(|line| line.contains("T_cn_cnm1:")).unwrap();
        let without = [&lines[..at], &lines[at + 6..]].concat().join("\n");
        if mount == SyntheticMount::Gimbal {
            let message = parse(&without).unwrap_err();
            assert!(message.starts_with("cam1.T_cn_cnm1: "), "{message}");
        } else {
            assert_eq!(parse(&without).unwrap().cameras[1].relative_prior, None);
            let first = lines.iter().rposition(|line| line.contains("T_cam_imu:")).unwrap();
            let mut wrong: Vec<String> = lines.iter().map(|line| (*line).to_owned()).collect();
            wrong.drain(first + 1..first + 5);
            for row in ["0.0, 0.0, 0.0, 1.0", "0.0, 0.0, 1.0, 0.0", "0.0, 1.0, 0.0, 0.0", "1.0, 0.0, 0.0, 0.0"] {
                wrong.insert(first + 1, format!("  - [{row}]"));
            }
            let message = parse(&wrong.join("\n")).unwrap_err();
            assert!(message.contains("T_cam_imu: differs by") && message.contains("T_cn_cnm1"), "{message}");
        }
    }
}
