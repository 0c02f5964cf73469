//! Recordings and robot descriptions on the command line: conversion into the cache folder, chains in and out.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use dcvins::files::RigFile as _;
use dcvins::files::urdf::{CameraAxes, RobotModel};
use dcvins::sensors::Rig;
use dcvins::session::{Session, SessionRequest};

fn sample(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("sample_logs").join(name)
}

/// Paths of a ROS 2 bag with the sample log, made in a folder, and of the cache beside it.
fn bag_and_cache(folder: &Path) -> [PathBuf; 2] {
    let bag = folder.join("flight");
    fs::create_dir(&bag).expect("the folder is new");
    fs::copy(sample("garden.mcap"), bag.join("flight_0.mcap")).expect("the sample log is there");
    [bag, folder.join("cache")]
}

/// Runs the program with a cache folder; returns its exit code, standard output and standard error.
fn dcvins(cache: &Path, arguments: &[&str]) -> (i32, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_dcvins"));
    command.env("DCVINS_CACHE_DIR", cache).env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
    let output = command.args(arguments).output().expect("the program starts");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code().unwrap_or(-1), text(&output.stdout), text(&output.stderr))
}

#[test]
fn a_bag_is_checked_like_a_log_and_kept_in_the_cache() {
    let folder = tempfile::tempdir().unwrap();
    let [bag, cache] = bag_and_cache(folder.path());
    let bag = bag.display().to_string();
    let (code, text, notices) = dcvins(&cache, &["check", &bag]);
    assert_eq!(code, 0, "{notices}");
    assert!(text.contains("flight.mcap: 8.500 s, rig garden"), "{text}");
    assert!(notices.contains("converted flight (ROS 2 bag) into"), "{notices}");
    let entries = || -> Vec<PathBuf> {
        fs::read_dir(cache.join("converted")).unwrap().map(|entry| entry.unwrap().path()).collect()
    };
    let [entry] = entries().try_into().expect("one entry");
    assert!(entry.join("flight.mcap").is_file() && entry.join("report.txt").is_file());
    // The second command finds the log; a rig next to the recording goes before the attached one.
    let rig = fs::read_to_string(sample("garden.rig.yaml")).unwrap().replace("name: garden", "name: flight");
    fs::write(folder.path().join("flight.rig.yaml"), rig).unwrap();
    let (_, text, notices) = dcvins(&cache, &["check", &bag]);
    assert!(!notices.contains("converted") && entries() == [entry], "{notices}");
    assert!(text.contains("flight.mcap: 8.500 s, rig flight"), "{text}");
    let (code, _, problem) = dcvins(Path::new(""), &["check", &bag]);
    assert!(code == 1 && problem.contains("DCVINS_CACHE_DIR is empty"), "{problem}");
}

/// Ctrl+C after the conversion ends the command at once, as on a log that needs none.
#[cfg(target_os = "linux")]
#[test]
fn an_interrupt_after_the_conversion_ends_the_command() {
    use std::io::{BufRead as _, BufReader, Read as _};
    use std::process::Stdio;

    let folder = tempfile::tempdir().unwrap();
    let [bag, cache] = bag_and_cache(folder.path());
    let mut command = Command::new(env!("CARGO_BIN_EXE_dcvins"));
    command.env("DCVINS_CACHE_DIR", &cache).arg("check").arg(&bag).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut process = command.spawn().expect("the program starts");
    let mut notices = BufReader::new(process.stderr.take().expect("it is piped"));
    let mut line = String::new();
    while !line.contains("converted flight (ROS 2 bag)") {
        line.clear();
        assert!(notices.read_line(&mut line).unwrap() > 0, "it ends without a conversion");
    }
    assert!(Command::new("kill").args(["-INT", &process.id().to_string()]).status().unwrap().success());
    let mut printed = String::new();
    process.stdout.take().expect("it is piped").read_to_string(&mut printed).unwrap();
    assert_eq!((process.wait().unwrap().code(), printed.as_str()), (None, ""), "the check goes on");
}

#[test]
fn a_session_on_a_converted_recording_converts_it_again() {
    let folder = tempfile::tempdir().unwrap();
    let [bag, cache] = bag_and_cache(folder.path());
    dcvins(&cache, &["check", &bag.display().to_string()]);
    let entry = fs::read_dir(cache.join("converted")).unwrap().next().expect("one entry").unwrap().path();
    let log_path = entry.join("flight.mcap");
    let request = SessionRequest {
        log_path: log_path.clone(),
        recording: vec![bag.clone()],
        duration_s: Some(3.0),
        ..SessionRequest::default()
    };
    let mut session = Session::open(&request).unwrap();
    session.finish();
    let saved = folder.path().join("a.session.json");
    fs::write(&saved, session.saved(None).to_text()).unwrap();
    drop(session);
    fs::remove_dir_all(&entry).unwrap();
    let screenshot = folder.path().join("a.png").display().to_string();
    let (saved, at) = (saved.display().to_string(), ["--at", "2.9", "-o", &screenshot]);
    let (code, _, problem) = dcvins(&cache, &[&["screenshot", &saved, "--panel", "convergence"][..], &at].concat());
    assert!(code == 0 && log_path.is_file(), "{problem}");
    assert!(!problem.contains("differs"), "{problem}");
    // Without the recording the error names it.
    fs::remove_dir_all(&entry).unwrap();
    fs::remove_dir_all(&bag).unwrap();
    let (code, _, problem) =
        dcvins(&cache, &[&["screenshot", &saved, "--panel", "convergence", "--force"][..], &at].concat());
    assert!(code == 1 && problem.contains(&bag.display().to_string()), "{problem}");
}

#[test]
fn what_cannot_be_opened_is_named_with_what_it_lacks() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    fs::write(path("notes.txt"), "hello\n").unwrap();
    fs::write(path("flight.srt"), "1\n00:00:00,000 --> 00:00:00,033\nSrtCnt : 1\n").unwrap();
    fs::copy(sample("garden.rig.yaml"), path("garden.rig.yaml")).unwrap();
    let check = |arguments: &[&str], expected: &str| {
        let (code, _, problem) = dcvins(folder.path(), arguments);
        assert!(code == 1 && problem.contains(expected), "{problem}");
    };
    check(
        &["view", &path("notes.txt")],
        "a file that begins with the bytes 68 65 6c 6c 6f 0a; expected a EuRoC/ASL folder",
    );
    check(&["view", &path("flight.srt")], "no motion can be estimated from it");
    check(&["view", &path("garden.rig.yaml")], "a rig alone; open it together with its log");
    let log = sample("garden.mcap").display().to_string();
    check(&["view", &log, &log], "are not one log");
}

#[test]
fn a_robot_description_becomes_a_rig_and_takes_its_calibration() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let urdf = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/urdf/pan_tilt.urdf").display().to_string();
    let links = ["--urdf", urdf.as_str(), "--imu-link", "imu_link", "--camera-link", "camera_optical_frame"];
    let rig_path = path("unit.rig.yaml");
    let camera = ["rig", "new", "--camera", "fov:80", "--size", "640x480", "-o", &rig_path];
    let (code, text, problem) = dcvins(folder.path(), &[&camera[..], &links].concat());
    assert_eq!(code, 0, "{problem}");
    assert!(text.contains("design values of the robot description 'pan_tilt_unit'"), "{text}");
    let mut rig = Rig::from_file(Path::new(&rig_path)).unwrap();
    assert_eq!(rig.joint_names(), ["ptu_pan", "ptu_tilt"]);

    let gimbal = rig.gimbal.as_mut().unwrap();
    gimbal.chain.links[0].d_m += 0.002;
    gimbal.chain.links[1].alpha_rad += 0.01;
    fs::write(&rig_path, rig.to_yaml()).unwrap();
    let export = ["export", &rig_path, "--to", "urdf", "-o", &path("out")];
    let (code, text, problem) = dcvins(folder.path(), &[&export[..], &links].concat());
    assert!(code == 0 && text.contains("origin of joint 'ptu_tilt' changed by"), "{text}{problem}");
    let model = RobotModel::read(Path::new(&path("out/pan_tilt.urdf"))).unwrap();
    let chain = model.path("imu_link", "camera_optical_frame", CameraAxes::Optical).unwrap();
    let angles_rad = [0.3, -0.4];
    let expected = rig.gimbal.as_ref().unwrap().chain.imu_from_camera(&angles_rad);
    assert!(chain.imu_from_camera(&angles_rad).minus(&expected).norm() < 1e-12);
    // A file that is not of this command is not replaced.
    let (code, _, problem) = dcvins(folder.path(), &[&export[..], &links].concat());
    assert!(code == 1 && problem.contains("give --force"), "{problem}");
}
