use super::*;
use crate::camera::{CameraModel, Distortion, Projection, RationalLens};
use crate::files::RigFile as _;
use crate::flight_log::RigOfLog as _;

/// Writes a log with one message of each kind that a rig needs, and attachments.
fn write_log(path: &Path, attachments: &[(&str, &str)], camera_info: Option<&CameraModel>) {
    let mut writer = LogWriter::create(path, &LogWriterOptions::default()).unwrap();
    for number in 0..5 {
        let times = MessageTimes { stamp_ns: EPOCH_NS + number * 40 * MS, log_time_ns: EPOCH_NS + number * 40 * MS };
        let image = image_at(number, [WIDTH, HEIGHT]);
        writer.write_raw_image("/camera", "camera", times, [WIDTH, HEIGHT], "mono8", &image.pixels).unwrap();
        writer.write_imu("/imu", "imu", times, &Vector3::zeros(), &Vector3::z()).unwrap();
        if let Some(model) = camera_info {
            writer.write_camera_info("/camera_info", "camera", times, model).unwrap();
        }
    }
    for (name, text) in attachments {
        writer.attach(name, "application/yaml", text, EPOCH_NS).unwrap();
    }
    let note = std::collections::BTreeMap::from([("seed".to_owned(), "7".to_owned())]);
    writer.write_metadata("experiment", note).unwrap();
    writer.finish().unwrap();
}

#[test]
fn a_rig_is_found_beside_the_log_then_in_it() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("flight.mcap");
    let attached = RIG.replace("name: test", "name: attached");
    let ground_truth = RIG.replace("name: test", "name: actual");
    write_log(&path, &[("x.rig.yaml", &attached), ("x.truth.yaml", &ground_truth)], None);
    let log = FlightLog::open(&path).unwrap();
    assert_eq!(Rig::for_log(&log, None).unwrap().name, "attached");
    assert_eq!(Rig::ground_truth_for_log(&log, None).unwrap().unwrap().name, "actual");
    std::fs::write(folder.path().join("flight.rig.yaml"), RIG).unwrap();
    assert_eq!(Rig::for_log(&log, None).unwrap().name, "test");
    let other = folder.path().join("other.yaml");
    std::fs::write(&other, RIG.replace("name: test", "name: chosen")).unwrap();
    assert_eq!(Rig::for_log(&log, Some(&other)).unwrap().name, "chosen");
    let missing = Rig::for_log(&log, Some(Path::new("/nowhere.yaml"))).unwrap_err().to_string();
    assert!(missing.contains("cannot read the rig") && missing.ends_with("/nowhere.yaml"), "{missing}");
}

#[test]
fn the_ground_truth_of_another_mechanism_is_left_out_or_refused() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("flight.mcap");
    let link = "  - {joint: yaw, theta_offset: -1.56, d: 0.046, a: 0.016, alpha: -1.55, limits: [-3.14, 3.14]}\n";
    let two_joints = RIG.replace(link, &format!("{link}{}", link.replace("yaw", "roll")));
    write_log(&path, &[("x.rig.yaml", RIG), ("x.truth.yaml", &two_joints)], None);
    let log = FlightLog::open(&path).unwrap();
    let rig = Rig::for_log(&log, None).unwrap();
    assert_eq!(rig.own_ground_truth(&log, None).unwrap(), None);
    let other = Rig::from_yaml(&two_joints, Path::new("two.rig.yaml")).unwrap();
    assert_eq!(other.own_ground_truth(&log, None).unwrap().as_ref(), Some(&other));
    let file = folder.path().join("given.yaml");
    std::fs::write(&file, &two_joints).unwrap();
    let refused = rig.own_ground_truth(&log, Some(&file)).unwrap_err().to_string();
    let words = ["cam0", "2 joints in the ground truth, 1 in the rig 'test'", "given.yaml"];
    assert!(words.iter().all(|word| refused.contains(word)), "{refused}");
}

#[test]
fn a_broken_attachment_is_named() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("flight.mcap");
    write_log(&path, &[("x.rig.yaml", "rig_version: 1\nname: x\n")], None);
    let message = Rig::for_log(&FlightLog::open(&path).unwrap(), None).unwrap_err().to_string();
    assert!(
        message.contains("gravity: missing") && message.ends_with("flight.mcap (attachment x.rig.yaml)"),
        "{message}"
    );
}

#[test]
fn intrinsics_missing_in_the_rig_come_from_the_log() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("flight.mcap");
    let open_rig = RIG.replace("  intrinsics: [50.0, 50.0, 31.5, 23.5]\n", "").replace("  update_rate: 20.0\n", "");
    std::fs::write(folder.path().join("flight.rig.yaml"), open_rig).unwrap();
    let radtan = Distortion::Radtan([-0.1, 0.02, 1e-3, -1e-3]);
    let plumb_bob = Distortion::Rational(RationalLens::new([-0.1, 0.02, 1e-3, -1e-3, 0.01, 0.0, 0.0, 0.0]));
    let rational = Distortion::Rational(RationalLens::new([8.2, 3.1, -3e-4, 5e-4, 0.12, 8.5, 5.6, 0.61]));
    let fisheye = Distortion::Equidistant([0.1, 0.02, 0.003, 0.004]);
    for distortion in [Distortion::None, radtan, plumb_bob, rational, fisheye] {
        let model =
            CameraModel::new(Projection::Pinhole, distortion, [51.0, 52.0, 30.0, 22.0], [WIDTH, HEIGHT]).unwrap();
        write_log(&path, &[], Some(&model));
        let rig = Rig::for_log(&FlightLog::open(&path).unwrap(), None).unwrap();
        assert_eq!(rig.cameras[0].model, model);
        assert!((rig.cameras[0].rate_hz - 25.0).abs() < 1e-9);
    }
    let unusual =
        CameraModel::new(Projection::Pinhole, Distortion::Fov(0.9), [51.0, 52.0, 30.0, 22.0], [WIDTH, HEIGHT]);
    write_log(&path, &[], Some(&unusual.unwrap()));
    let message = Rig::for_log(&FlightLog::open(&path).unwrap(), None).unwrap_err().to_string();
    assert!(message.contains("/camera_info: distortion 'fov' with 1 coefficients, expected plumb_bob"), "{message}");
    write_log(&path, &[], None);
    let message = Rig::for_log(&FlightLog::open(&path).unwrap(), None).unwrap_err().to_string();
    assert!(message.contains("cam0.intrinsics: missing, expected 4 numbers"), "{message}");
    assert!(message.contains("the log has none of /camera_info"), "{message}");
}
