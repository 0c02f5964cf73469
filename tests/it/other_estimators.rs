//! `dcvins export` on the sample log: files for every program, joint angles from a log, errors.

use std::path::{Path, PathBuf};
use std::process::Command;

use dcvins::files::RigFile as _;
use dcvins::sensors::{CameraMount, Rig};
use serde_json::Value;

fn sample(name: &str) -> String {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("sample_logs").join(name).display().to_string()
}

/// Exit code and output.
fn dcvins(arguments: &[&str]) -> (i32, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_dcvins"))
        .env("DCVINS_CACHE_DIR", "")
        .args(arguments)
        .output()
        .expect("the program runs");
    let text = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned()).concat();
    (output.status.code().unwrap_or(-1), text)
}

#[test]
fn every_program_gets_its_files() {
    let folder = tempfile::tempdir().unwrap();
    let rig = sample("garden.rig.yaml");
    let check = |program: &str, expected: &[&str]| {
        let out = folder.path().join(program).display().to_string();
        let (code, text) = dcvins(&["export", &rig, "--to", program, "-o", &out]);
        assert_eq!(code, 0, "{text}");
        assert!(text.contains("cam0 is carried by the gimbal"), "{text}");
        let mut found: Vec<String> = std::fs::read_dir(&out)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        found.sort();
        assert_eq!(found, expected, "{program}");
    };
    check("kalibr", &["camchain-imucam.yaml", "imu.yaml"]);
    check("vins-fusion", &["cam0.yaml", "vins_config.yaml"]);
    check("openvins", &["estimator_config.yaml", "kalibr_imu_chain.yaml", "kalibr_imucam_chain.yaml"]);
    check("basalt", &["basalt_calib.json"]);
    check("orb-slam3", &["orb_slam3.yaml"]);
}

/// Extrinsics of cam0 in an exported chain.
fn exported(folder: &Path) -> dcvins::geometry::RigidTransform {
    let rig = Rig::from_file(&folder.join("camchain-imucam.yaml")).expect("our reader takes the files of Kalibr");
    match &rig.cameras[0].mount {
        CameraMount::Static { imu_from_camera } => *imu_from_camera,
        CameraMount::Gimbal => panic!("an exported camera is static"),
    }
}

#[test]
fn the_gimbal_is_fixed_at_the_angles_that_the_log_measures() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display().to_string();
    let (log, path) = (sample("garden.mcap"), sample("garden.rig.yaml"));
    let (code, text) = dcvins(&["export", &log, "--to", "kalibr", "-o", &out, "--at", "4", "--json"]);
    assert_eq!(code, 0, "{text}");
    let written: Value = serde_json::from_str(&text).unwrap();
    let angles_rad: Vec<f64> =
        written["joint_angles_rad"].as_array().unwrap().iter().filter_map(Value::as_f64).collect();
    assert!(angles_rad.len() == 3 && angles_rad.iter().any(|angle| angle.abs() > 0.05), "{text}");
    assert!(written["notes"][0].as_str().unwrap().contains("those measured in garden.mcap at 4."), "{text}");
    let chain = Rig::from_file(Path::new(&path)).unwrap().chain_of_camera("cam0").unwrap();
    assert!(exported(folder.path()).minus(&chain.imu_from_camera(&angles_rad)).norm() < 1e-9);

    // The same from the rig with its log; another time replaces the files.
    let (code, text) = dcvins(&["export", &path, "--log", &log, "--at", "4", "--to", "kalibr", "-o", &out]);
    assert_eq!(code, 0, "{text}");
    assert!(exported(folder.path()).minus(&chain.imu_from_camera(&angles_rad)).norm() < 1e-9);
    let (code, text) = dcvins(&["export", &path, "--joints", "yaw=20,pitch=-30", "--to", "kalibr", "-o", &out]);
    assert_eq!(code, 0, "{text}");
    let given_rad = [20.0_f64.to_radians(), 0.0, -30.0_f64.to_radians()];
    assert!(exported(folder.path()).minus(&chain.imu_from_camera(&given_rad)).norm() < 1e-9);
}

#[test]
fn refusals_say_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display().to_string();
    let rig = sample("garden.rig.yaml");
    let check = |arguments: &[&str], code: i32, expected: &str| {
        let arguments = [&["export", &rig, "-o", &out], arguments].concat();
        let (found, text) = dcvins(&arguments);
        assert!(found == code && text.contains(expected), "{found}: {text}");
    };
    check(&["--to", "kalibr", "--at", "4"], 1, "--at needs a log: give it with --log LOG");
    check(&["--to", "kalibr", "--joints", "tilt=3"], 1, "its joints are yaw, roll, pitch");
    check(&["--to", "orb-slam3", "--camera", "cam0", "--camera", "cam1"], 1, "ORB-SLAM3 takes one camera");
    check(&["--to", "rovio"], 2, "possible values: kalibr, vins-fusion, openvins, basalt, orb-slam3");
    std::fs::write(folder.path().join("basalt_calib.json"), "{}").unwrap();
    check(&["--to", "basalt"], 1, "the file exists and was not written by 'dcvins export'; give --force");
}
