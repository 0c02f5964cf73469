//! Small EuRoC folder, written by the test.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::sync::Arc;

use dcvins::flight_log::RigOfLog as _;
use dcvins::flight_log::{FlightLog, FrameStream, SensorFrame};
use dcvins::sensors::{CameraMount, Rig};
use image::{GrayImage, Luma};
use nalgebra::Vector3;

use super::{run, topic};

const STAMP_NS: i64 = 1_403_636_579_763_555_584;

const INTO_STRING: &str = "writing into a string cannot fail";

const IMU_YAML: &str = "\
sensor_type: imu
T_BS:
  cols: 4
  rows: 4
  data: [1.0, 0.0, 0.0, 0.0,
         0.0, 1.0, 0.0, 0.0,
         0.0, 0.0, 1.0, 0.0,
         0.0, 0.0, 0.0, 1.0]
rate_hz: 200
gyroscope_noise_density: 1.6968e-04
gyroscope_random_walk: 1.9393e-05
accelerometer_noise_density: 2.0000e-3
accelerometer_random_walk: 3.0000e-3
";

/// Camera that looks forward (z along the body's x), 0.1 m ahead.
const CAMERA_YAML: &str = "\
%YAML:1.0
# General sensor definitions.
sensor_type: camera
T_BS:
  cols: 4
  rows: 4
  data: [0.0, 0.0, 1.0, 0.1,
        -1.0, 0.0, 0.0, 0.0,
         0.0,-1.0, 0.0, 0.0,
         0.0, 0.0, 0.0, 1.0]
rate_hz: 20
resolution: [64, 48]
camera_model: pinhole
intrinsics: [45.8, 45.7, 31.5, 24.5] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [-0.28, 0.07, 0.0002, 1.8e-05]
";

fn write_folder(source: &Path) {
    let write = |name: &str, text: &str| {
        let path = source.join("mav0").join(name);
        fs::create_dir_all(path.parent().expect("it lies in a folder")).expect("the folder can be made");
        fs::write(path, text).expect("the file can be written");
    };
    let mut imu =
        "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y,w_RS_S_z,a_RS_S_x [m s^-2],a_RS_S_y,a_RS_S_z\r\n".to_owned();
    for index in 0..60 {
        let (stamp_ns, z) = (STAMP_NS + index * 5_000_000, 0.001 * index as f64);
        writeln!(imu, "{stamp_ns},0.1,-0.2,{z},9.0,0.5,-1.5\r").expect(INTO_STRING);
    }
    write("imu0/data.csv", &imu);
    write("imu0/sensor.yaml", IMU_YAML);
    let mut images = "#timestamp [ns],filename\n".to_owned();
    fs::create_dir_all(source.join("mav0/cam0/data")).expect("the folder can be made");
    for index in 0..5_i64 {
        let stamp_ns = STAMP_NS + index * 50_000_000;
        writeln!(images, "{stamp_ns},{stamp_ns}.png").expect(INTO_STRING);
        if index != 3 {
            let image = GrayImage::from_fn(64, 48, |x, y| Luma([(x + 2 * y + index as u32) as u8]));
            image.save(source.join(format!("mav0/cam0/data/{stamp_ns}.png"))).expect("the image can be written");
        }
    }
    write("cam0/data.csv", &images);
    write("cam0/sensor.yaml", CAMERA_YAML);
    let mut ground_truth = "#timestamp, p_RS_R_x [m], …\n".to_owned();
    for index in 0..60 {
        let x = 4.6 + 0.005 * index as f64;
        let stamp_ns = STAMP_NS + index * 5_000_000;
        writeln!(ground_truth, "{stamp_ns},{x},-1.7,0.9,0.5,-0.5,0.5,0.5,1,0,0,0,0,0,0,0,0").expect(INTO_STRING);
    }
    write("state_groundtruth_estimate0/data.csv", &ground_truth);
    write("leica0/data.csv", &format!("#timestamp, p_RS_R_x [m]\n{STAMP_NS},4.6,-1.7,0.9\n"));
}

#[test]
fn a_folder_becomes_a_log_with_its_rig() {
    let folder = tempfile::tempdir().unwrap();
    let (source, path) = (folder.path().join("MH_01_easy"), folder.path().join("flight.mcap"));
    write_folder(&source);
    let report = run(&source, &path).unwrap();
    let counts = |name: &str| (topic(&report, name).taken, topic(&report, name).left);
    assert_eq!(counts("/imu0"), (60, 0), "{report}");
    assert_eq!(counts("/cam0/image_raw/compressed"), (4, 1), "{report}");
    assert_eq!(counts("/state_groundtruth_estimate0/pose"), (60, 0), "{report}");
    assert_eq!(counts("/leica0"), (0, 1), "{report}");
    assert_eq!(report.rig, Some(folder.path().join("flight.rig.yaml")));

    let log = Arc::new(FlightLog::open(&path).unwrap());
    assert_eq!(log.epoch_ns(), STAMP_NS);
    let rig = Rig::for_log(&log, None).unwrap();
    assert_eq!(rig.name, "MH_01_easy");
    assert_eq!(rig.imu.noise.gyroscope_noise_density, 1.6968e-4);
    assert_eq!(rig.cameras[0].model.resolution_px, [64, 48]);
    let CameraMount::Static { imu_from_camera } = rig.cameras[0].mount else { panic!("the camera is rigid") };
    let ahead = imu_from_camera.transform(&Vector3::new(0.0, 0.0, 2.0));
    assert!((ahead - Vector3::new(2.1, 0.0, 0.0)).norm() < 1e-12, "2 m before the camera is at {ahead}");

    let mut stream = FrameStream::new(Arc::clone(&log), &rig, "cam0", 0.0, None).unwrap();
    let frames: Vec<SensorFrame> = std::iter::from_fn(|| stream.next_frame()).collect();
    let frame = frames.iter().find(|frame| frame.stamp_ns == 50_000_000).expect("the second image is a frame");
    assert_eq!(frame.image.pixels[64 + 1], 4, "x + 2 y + 1");
    assert!((frame.imu[3].angular_velocity_rad_per_s - Vector3::new(0.1, -0.2, 0.003)).norm() < 1e-12);
    let pose = frame.ground_truth.expect("the image has a truth");
    assert!((pose.translation_m - Vector3::new(4.65, -1.7, 0.9)).norm() < 1e-9, "{pose:?}");

    let again = folder.path().join("again.mcap");
    run(&source, &again).unwrap();
    assert!(fs::read(&again).unwrap() == fs::read(&path).unwrap(), "the same folder gives the same bytes");
}

#[test]
fn a_wrong_folder_says_where() {
    let folder = tempfile::tempdir().unwrap();
    let (source, path) = (folder.path().join("flight"), folder.path().join("flight.mcap"));
    let check = |file: &str, text: &str, words: &[&str]| {
        write_folder(&source);
        fs::write(source.join("mav0").join(file), text).unwrap();
        let complaint = run(&source, &path).unwrap_err().to_string();
        for word in words {
            assert!(complaint.contains(word), "'{word}' is missing in: {complaint}");
        }
    };
    check("imu0/data.csv", "1,2,3,4,5,6,7\n12,0,0,x,0,0,0\n", &["line 2", "'x'", "data.csv"]);
    check("imu0/data.csv", "1:5,2,3,4,5,6,7\n", &["line 1", "'1:5'", "nanoseconds"]);
    check("imu0/data.csv", "1,2,3\n", &["line 1", "2 numbers", "expected 6"]);
}

#[test]
fn byte_order_marks_line_ends_and_spaces_do_not_matter() {
    let folder = tempfile::tempdir().unwrap();
    let (source, path) = (folder.path().join("flight"), folder.path().join("flight.mcap"));
    write_folder(&source);
    let expected = run(&source, &path).map(|_| fs::read(&path).unwrap()).unwrap();
    let rig = fs::read_to_string(path.with_extension("rig.yaml")).unwrap();
    for name in ["imu0", "cam0", "state_groundtruth_estimate0"] {
        for file in ["data.csv", "sensor.yaml"] {
            let path = source.join("mav0").join(name).join(file);
            let Ok(text) = fs::read_to_string(&path) else { continue };
            let text = if file == "data.csv" { text.replace(',', " , ") } else { text };
            fs::write(&path, format!("\u{feff}{}", text.replace('\r', "").replace('\n', "\r\n"))).unwrap();
        }
    }
    let again = folder.path().join("again.mcap");
    run(&source, &again).unwrap();
    assert!(fs::read(&again).unwrap() == expected, "the same samples give the same bytes");
    assert_eq!(fs::read_to_string(again.with_extension("rig.yaml")).unwrap(), rig);
}

#[test]
fn units_of_stamps_are_recognized() {
    let folder = tempfile::tempdir().unwrap();
    let (source, path) = (folder.path().join("flight"), folder.path().join("flight.mcap"));
    write_folder(&source);
    let expected = run(&source, &path).map(|_| fs::read(&path).unwrap()).unwrap();
    // Nanoseconds of the unit, and its number of decimals.
    for (name, unit_ns, decimals) in [("imu0", 1_000_000_000, 9), ("cam0", 1_000_000, 6), ("leica0", 1000, 3)] {
        let table = source.join("mav0").join(name).join("data.csv");
        let text = fs::read_to_string(&table).unwrap();
        let row = |line: &str| match line.split_once(',').filter(|_| !line.starts_with('#')) {
            Some((stamp_ns, rest)) => {
                let stamp_ns: i64 = stamp_ns.parse().unwrap();
                format!("{}.{:0decimals$},{rest}\n", stamp_ns / unit_ns, stamp_ns % unit_ns)
            }
            None => format!("{}\n", line.trim_start_matches('#')),
        };
        fs::write(&table, text.lines().map(row).collect::<String>()).unwrap();
    }
    let again = folder.path().join("again.mcap");
    let report = run(&source, &again).unwrap();
    assert!(fs::read(&again).unwrap() == expected, "the same samples give the same bytes");
    let notes = report.notes.join("\n");
    assert!(
        notes.contains("the stamps of imu0/data.csv are in seconds, which are converted to nanoseconds"),
        "{notes}"
    );
    assert!(notes.contains("the stamps of cam0/data.csv are in milliseconds"), "{notes}");
}

#[test]
fn a_folder_with_an_unusable_description_converts_with_a_note() {
    let folder = tempfile::tempdir().unwrap();
    let (source, path) = (folder.path().join("flight"), folder.path().join("flight.mcap"));
    let check = |file: &str, text: &str, words: &[&str]| {
        write_folder(&source);
        fs::write(source.join("mav0").join(file), text).unwrap();
        let report = run(&source, &path).unwrap();
        assert_eq!((topic(&report, "/imu0").taken, report.rig.as_ref()), (60, None), "{report}");
        let notes = report.notes.join("\n");
        for word in words.iter().chain(&["no rig was written"]) {
            assert!(notes.contains(word), "'{word}' is missing in: {notes}");
        }
    };
    check(
        "imu0/sensor.yaml",
        &IMU_YAML.replace("imu\n", "imu: b: c\n"),
        &["imu0/sensor.yaml cannot be used", "line 1"],
    );
    check("cam0/sensor.yaml", &CAMERA_YAML.replace("[64, 48]", "[64]"), &["resolution", "sensor.yaml"]);
    check("cam0/sensor.yaml", &CAMERA_YAML.replace("pinhole", "fisheye"), &["fisheye"]);
    check("cam0/sensor.yaml", &CAMERA_YAML.replace("0.0, 0.0, 1.0, 0.1", "0.0, 0.0, 2.0, 0.1"), &["T_BS", "rigid"]);
    check("imu0/sensor.yaml", &IMU_YAML.replace("1.6968e-04", "-1"), &["gyroscope_noise_density", "-1"]);
}

#[test]
fn image_names_stay_inside_their_folder() {
    let folder = tempfile::tempdir().unwrap();
    let (source, path) = (folder.path().join("flight"), folder.path().join("flight.mcap"));
    write_folder(&source);
    let data = source.join("mav0/cam0/data");
    let good = data.join(format!("{STAMP_NS}.png"));
    fs::copy(&good, folder.path().join("secret.png")).unwrap();
    fs::copy(&good, data.join("no_ending")).unwrap();
    fs::write(data.join("text.png"), "root:x:0:0").unwrap();
    fs::create_dir(data.join("folder.png")).unwrap();
    let outside = folder.path().join("secret.png");
    let mut names = vec![
        "../../../../secret.png".to_owned(),
        outside.to_str().unwrap().to_owned(),
        "text.png".to_owned(),
        "folder.png".to_owned(),
        "no_ending".to_owned(),
    ];
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(&outside, data.join("link.png")).unwrap();
        names.push("link.png".to_owned());
    }
    for name in names {
        fs::write(source.join("mav0/cam0/data.csv"), format!("{STAMP_NS},{STAMP_NS}.png\n{STAMP_NS},{name}\n"))
            .unwrap();
        let report = run(&source, &path).unwrap();
        let images = topic(&report, "/cam0/image_raw/compressed");
        // A file without an extension is also read as an image.
        let expected = if name == "no_ending" { (2, 0) } else { (1, 1) };
        assert_eq!((images.taken, images.left), expected, "{name}\n{report}");
        let reasons = ["leads out of the folder", "neither PNG nor JPEG", "no image", "link that leads out"];
        let told = images.reason.as_ref().is_some_and(|reason| reasons.iter().any(|words| reason.contains(words)));
        assert!(told || name == "no_ending", "{name}\n{report}");
    }
}
