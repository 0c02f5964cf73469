//! `dcvins plan`: files, determinism, limits, and a simulated flight along the planned motion.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

fn data(name: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = if name.starts_with("garden") { folder.join("sample_logs") } else { folder.join("tests/data") };
    folder.join(name).to_string_lossy().into_owned()
}

fn dcvins(folder: &Path, arguments: &[&str], threads: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_dcvins"));
    command.env("DCVINS_CACHE_DIR", "").env("RAYON_NUM_THREADS", threads);
    command.current_dir(folder).args(arguments).output().expect("the program starts")
}

/// Runs `dcvins plan` and checks its exit code and words of its standard error.
fn plan(folder: &Path, arguments: &[&str], threads: &str, code: i32, words: &[&str]) -> Output {
    let output = dcvins(folder, &[&["plan"], arguments].concat(), threads);
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {complaint}");
    for word in words {
        assert!(complaint.contains(word), "{arguments:?} should say '{word}': {complaint}");
    }
    output
}

fn index(folder: &Path) -> Value {
    let text = fs::read_to_string(folder.join("plan.json")).expect("the plan is written");
    serde_json::from_str(&text).expect("the plan is JSON")
}

fn files(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let paths = fs::read_dir(folder).expect("the folder can be listed").map(|entry| entry.expect("an entry").path());
    let mut paths: Vec<PathBuf> = paths.collect();
    paths.sort();
    let name = |path: &Path| path.file_name().expect("a name").to_string_lossy().into_owned();
    paths.iter().map(|path| (name(path), fs::read(path).expect("the file can be read"))).collect()
}

const SMALL: [&str; 6] = ["--duration", "8", "--starts", "2", "--trials", "15"];

#[test]
fn a_plan_has_the_same_bytes_on_any_number_of_threads_and_replaces_its_own() {
    let folder = tempfile::tempdir().expect("a folder can be made");
    let (garden, pan_tilt) = (data("garden.rig.yaml"), data("pan_tilt.rig.yaml"));
    plan(folder.path(), &[&[garden.as_str(), "-o", "a"], &SMALL[..]].concat(), "1", 0, &["motion.csv"]);
    let printed = plan(folder.path(), &[&[garden.as_str(), "-o", "b"], &SMALL[..]].concat(), "3", 0, &[]).stdout;
    let (a, b) = (files(&folder.path().join("a")), files(&folder.path().join("b")));
    let names: Vec<&str> = a.iter().map(|(name, _)| name.as_str()).collect();
    let expected = ["joint_trajectory.yaml", "listed.csv", "motion.csv", "plan.json", "plan.txt", "sigma.csv"];
    assert_eq!(names, expected);
    assert!(a == b, "the files differ");
    assert_eq!(printed, a[4].1, "the text is printed");

    let plan_json = index(&folder.path().join("a"));
    assert_eq!((plan_json["rig"].as_str(), plan_json["kind"].as_str()), (Some("garden"), Some("motion")));
    assert!(plan_json["worst_ratio"].as_f64() < plan_json["listed"]["worst_ratio"].as_f64(), "{plan_json}");
    for limit in plan_json["limits"].as_array().expect("a list") {
        assert!(limit["reached"].as_f64() <= limit["limit"].as_f64().map(|limit| limit + 1e-9), "{limit}");
    }
    let motion = String::from_utf8(a[2].1.clone()).expect("text");
    assert!(motion.starts_with("t_s,yaw_rad,roll_rad,pitch_rad,x_m,y_m,z_m,heading_rad\n0,"), "{motion}");
    assert_eq!(motion.lines().count(), 162);
    let sigmas = String::from_utf8(a[5].1.clone()).expect("text");
    assert_eq!(sigmas.lines().count(), 1 + 9 * 18, "nine times, 18 parameters");

    let by_hand = [&[garden.as_str(), "-o", "a", "--by-hand"], &SMALL[..2]].concat();
    plan(folder.path(), &by_hand, "2", 0, &["plan.txt"]);
    let names: Vec<String> = files(&folder.path().join("a")).into_iter().map(|(name, _)| name).collect();
    let expected = ["joint_trajectory.yaml", "motion.csv", "plan.json", "plan.txt", "sigma.csv"];
    assert_eq!(names, expected, "moves by hand are compared with nothing");
    let place = [&by_hand[..], &["--home", "-33.9,151.2,12,90"]].concat();
    plan(folder.path(), &place, "2", 0, &["mission.waypoints", "mission.plan", "mission.txt"]);
    let mission = fs::read_to_string(folder.path().join("a/mission.waypoints")).expect("a mission");
    assert!(mission.starts_with("QGC WPL 110\n") && mission.contains("\t1000\t"), "{mission}");
    plan(folder.path(), &by_hand, "2", 0, &[]);
    assert!(!folder.path().join("a/mission.plan").exists(), "the mission of the earlier plan is removed");
    let steps = index(&folder.path().join("a"))["steps"].as_array().map(Vec::len);
    assert_eq!(steps, Some(2));
    let other = [&[pan_tilt.as_str(), "-o", "a"], &SMALL[..]].concat();
    plan(folder.path(), &other, "2", 1, &["a plan for the rig 'garden'", "--force"]);
}

#[test]
fn mechanisms_with_two_and_with_five_joints_are_planned() {
    let folder = tempfile::tempdir().expect("a folder can be made");
    for (rig, joints, parameters) in [("pan_tilt.rig.yaml", 2, 14), ("wrist_arm.rig.yaml", 5, 26)] {
        let path = data(rig);
        let arguments = [&[path.as_str(), "-o", rig, "--run", "minimal"], &SMALL[..]].concat();
        plan(folder.path(), &arguments, "2", 0, &[]);
        let plan = index(&folder.path().join(rig));
        assert_eq!(plan["parameters"].as_array().map(Vec::len), Some(parameters), "{rig}");
        let motion = fs::read_to_string(folder.path().join(rig).join("motion.csv")).expect("a motion");
        assert_eq!(motion.lines().next().map(|line| line.split(',').count()), Some(joints + 5), "{rig}");
        let motion = format!("{rig}/motion.csv");
        let flight =
            ["simulate", "T2", "-o", "t2.mcap", "--force", "--rig", path.as_str(), "--motion", motion.as_str()];
        let output = dcvins(folder.path(), &[&flight[..], &["--duration", "0.5"]].concat(), "2");
        assert!(output.status.success(), "{rig}: {}", String::from_utf8_lossy(&output.stderr));
        assert!(String::from_utf8_lossy(&output.stdout).contains("10 images"), "{rig}");
    }
}

#[test]
fn a_planned_motion_is_flown_by_the_simulation() {
    let folder = tempfile::tempdir().expect("a folder can be made");
    plan(folder.path(), &[&[data("garden.rig.yaml").as_str(), "-o", "plan"], &SMALL[..]].concat(), "2", 0, &[]);
    let simulate = |motion: &str, code: i32, words: &[&str]| {
        let small = ["--size", "64x48", "--rate", "2", "--no-static-camera", "--force"];
        let arguments = [&["simulate", "T2", "-o", "t2.mcap", "--motion", motion], &small[..]].concat();
        let output = dcvins(folder.path(), &arguments, "2");
        let said = String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned();
        assert_eq!(output.status.code(), Some(code), "{said}");
        for word in words {
            assert!(said.contains(word), "{motion} should give '{word}': {said}");
        }
    };
    plan(
        folder.path(),
        &[data("garden.rig.yaml").as_str(), "-o", "steps", "--by-hand", "--duration", "8"],
        "2",
        0,
        &[],
    );
    for motion in ["plan/motion.csv", "plan/listed.csv", "steps/motion.csv"] {
        simulate(motion, 0, &["t2.mcap: 8.0 s", "16 images"]);
    }
    simulate("plan/sigma.csv", 1, &["cannot read the motion: the columns are t_s, parameter", "sigma.csv"]);
    simulate("plan/none.csv", 1, &["cannot read", "none.csv"]);
}

#[test]
fn wrong_requests_say_what_is_possible() {
    let folder = tempfile::tempdir().expect("a folder can be made");
    let garden = data("garden.rig.yaml");
    let check = |more: &[&str], code: i32, words: &[&str]| {
        plan(folder.path(), &[&[garden.as_str(), "-o", "out"], more].concat(), "1", code, words);
    };
    check(&["--parameters", "pitch.q"], 1, &["--parameters names 'pitch.q'", "pitch.beta"]);
    check(&["--run", "auto:calibrate=off"], 1, &["auto-calibrate-off", "does not estimate the calibration"]);
    check(&["--run", "auto:timeshift=on"], 1, &["the chain only"]);
    check(&["--home", "95,8"], 2, &["expected LAT,LON"]);
    check(&["--duration", "3"], 2, &["expected seconds from 8 to 120"]);
    check(&["--box", "1,2"], 2, &["three lengths"]);
    check(&["--distance", "9,4"], 2, &["nearest and the farthest"]);
    assert!(!folder.path().join("out").exists());
}
