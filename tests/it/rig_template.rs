//! Rig for a recording without one: written from the log, checked and used in a run.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

fn sample_log() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("sample_logs/garden.mcap")
}

fn dcvins(arguments: &[&str]) -> (i32, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_dcvins"))
        .env("DCVINS_CACHE_DIR", "")
        .args(arguments)
        .output()
        .expect("the program runs");
    let text = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    (output.status.code().unwrap_or(-1), text)
}

#[test]
fn a_log_without_its_rig_is_run_with_a_new_one() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (log, rig, results) = (sample_log().to_str().unwrap().to_owned(), at("new.rig.yaml"), at("results"));
    let new =
        ["rig", "new", &log, "--mechanism", "yaw-roll-pitch", "--camera", "info", "--at", "0.1,0,-0.06", "-o", &rig];
    let (code, text) = dcvins(&new);
    assert_eq!(code, 0, "{text}");
    let (code, text) = dcvins(&new);
    assert!(code == 1 && text.contains("--force"), "a rig is not overwritten: {text}");

    // One finding for each assumed field, and none for other fields.
    let (code, text) = dcvins(&["check", &log, "--rig", &rig, "--json"]);
    assert_eq!(code, 0, "{text}");
    let report: Value = serde_json::from_str(&text).unwrap();
    let titles = report["findings"].as_array().unwrap().iter().filter_map(|finding| finding["title"].as_str());
    let mut asked: Vec<&str> = titles.filter_map(|title| title.strip_suffix(" is only assumed")).collect();
    asked.sort_unstable();
    let expected = [
        "cam0.timeshift_cam_imu",
        "gimbal.T_E_C",
        "gimbal.T_I_B",
        "gimbal.encoder_sigma",
        "gimbal.links",
        "imu0.accelerometer_noise_density",
        "imu0.gyroscope_noise_density",
    ];
    assert_eq!(asked, expected);

    let (code, text) = dcvins(&["run", &log, "--rig", &rig, "--out", &results]);
    assert_eq!(code, 0, "{text}");
    let summary = std::fs::read_to_string(folder.path().join("results/auto/summary.json")).unwrap();
    let summary: Value = serde_json::from_str(&summary).unwrap();
    let ate_m = summary["accuracy"]["ate_rmse_m"].as_f64().unwrap();
    let chain = &summary["calibration"]["chain_error"];
    let rotation_deg = chain["rotation_mean_rad"].as_f64().unwrap().to_degrees();
    assert!(ate_m < 0.05, "ATE {ate_m} m");
    assert!(rotation_deg < 0.5, "rotation of the chain wrong by {rotation_deg}°, at first by about 6°");
}
