//! Runs with a stereo pair and two cameras on the gimbal.

use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

/// Runs the program in a folder and returns its standard output.
fn dcvins(folder: &Path, arguments: &[&str]) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_dcvins"));
    command.env("DCVINS_CACHE_DIR", "").current_dir(folder).args(arguments);
    let output = command.output().expect("the program starts");
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn summary(folder: &Path, run: &str) -> Value {
    let text = fs::read_to_string(folder.join(run).join("summary.json")).expect("the run has a summary");
    serde_json::from_str(&text).expect("it is JSON")
}

#[test]
fn a_cluster_of_four_cameras_starts_from_its_stereo_pair_and_gives_equal_bytes() {
    let folder = tempfile::tempdir().expect("a folder can be made");
    let at = folder.path();
    let flight =
        ["--size", "240x180", "--rate", "10", "--duration", "5", "--stereo", "0.12", "--gimbal-camera", "thermal"];
    dcvins(at, &[&["simulate", "T2", "-o", "t2.mcap"], &flight[..]].concat());
    let runs = ["--run", "cluster", "--run", "cluster:cameras=cam1+cam2,name=pair", "--run", "static"];
    let said = dcvins(at, &[&["run", "t2.mcap", "--no-check", "--no-timing", "-o", "first"], &runs[..]].concat());
    assert!(said.contains("cluster on t2.mcap (cam0, cam1, cam2, cam3)"), "{said}");
    assert!(said.contains("on t2.mcap (cam1, cam2)"), "{said}");
    dcvins(at, &[&["run", "t2.mcap", "--no-check", "--no-timing", "-o", "again"], &runs[..]].concat());
    for run in ["cluster", "pair", "static"] {
        for file in ["summary.json", "trajectory.tum", "calibration.csv"] {
            let [first, again] = ["first", "again"].map(|to| fs::read(at.join(to).join(run).join(file)).expect(file));
            assert!(first == again, "{run}/{file} is not repeated");
        }
    }
    let started_s = |run: &str| summary(&at.join("first"), run)["frames"]["initialized_at_s"].as_f64();
    for run in ["cluster", "pair"] {
        assert!(started_s(run).is_some_and(|started_s| started_s < 0.5), "{run} starts at {:?}", started_s(run));
    }
    assert!(started_s("static").is_none_or(|started_s| started_s > 1.0), "one camera waits for motion");
    // A camera that reads the topic of another one is left out, and check names it.
    let rig = fs::read_to_string(at.join("t2.rig.yaml")).expect("the flight has a rig");
    let wrong = rig.replace("/static_camera_right/image_raw/compressed", "/static_camera/image_raw/compressed");
    assert_ne!(wrong, rig);
    fs::write(at.join("wrong.rig.yaml"), wrong).expect("the folder can be written");
    let options = ["--rig", "wrong.rig.yaml", "--run", "cluster", "-o", "wrong"];
    let said = dcvins(at, &[&["run", "t2.mcap"], &options[..]].concat());
    assert!(said.contains("cam1 and cam2 have one topic") && said.contains("(cam0, cam1, cam3)"), "{said}");
    assert!(said.contains("cam2 is not used by 'cluster': it has the topic of cam1"), "{said}");
    // The calibrated rig has all cameras, and a run starts from it.
    dcvins(
        at,
        &[
            "run",
            "t2.mcap",
            "--rig",
            "first/cluster/rig.yaml",
            "--run",
            "cluster",
            "--duration",
            "1",
            "--no-check",
            "-o",
            "next",
        ],
    );
}
