//! Complete runs on the sample log: files, equal bytes, accuracy against ground truth, screenshots, and damage.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

const FILES: [&str; 8] = [
    "trajectory.tum",
    "covariance.csv",
    "calibration.csv",
    "rank.csv",
    "information.csv",
    "frames.csv",
    "rig.yaml",
    "summary.json",
];

fn sample(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("sample_logs").join(name)
}

fn dcvins(arguments: &[&str], threads: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_dcvins"));
    command.env("DCVINS_CACHE_DIR", "");
    command.args(arguments).env("RAYON_NUM_THREADS", threads).env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
    command.output().expect("the program starts")
}

/// Runs the program, asserts success, and returns its output.
fn succeed(arguments: &[&str], threads: &str) -> String {
    let output = dcvins(arguments, threads);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn text_of(path: &Path) -> &str {
    path.to_str().expect("paths of tests are UTF-8")
}

#[test]
fn three_runs_leave_the_same_bytes_twice_and_stay_near_the_truth() {
    let folder = tempfile::tempdir().unwrap();
    let log = sample("garden.mcap");
    let run = |name: &str, threads: &str| {
        let out = folder.path().join(name);
        let off = "classical:first-estimates=off,name=off";
        let specs = ["--run", "auto", "--run", "classical", "--run", "static", "--run", off];
        let mut arguments = vec!["run", text_of(&log), "--out", text_of(&out), "--no-timing"];
        arguments.extend(specs);
        let printed = succeed(&arguments, threads);
        (out, printed)
    };
    let ((first, printed), (second, _)) = (run("first", "2"), run("second", "1"));
    for label in ["auto", "classical", "static"] {
        for file in FILES {
            let bytes = fs::read(first.join(label).join(file)).unwrap();
            assert!(!bytes.is_empty(), "{label}/{file} is empty");
            assert!(bytes == fs::read(second.join(label).join(file)).unwrap(), "{label}/{file} differs");
        }
        let text = fs::read_to_string(first.join(label).join("summary.json")).unwrap();
        let summary: Value = serde_json::from_str(&text).unwrap();
        let percent = summary["accuracy"]["ate_percent_of_length"].as_f64().unwrap();
        assert!(percent < 1.0, "{label}: ATE {percent} % of the length");
        let of_chain = chain_error(&summary["calibration"]);
        assert!(printed.contains(&of_chain), "'{of_chain}' in {printed}");
        let columns = summary["rank"]["columns"].as_u64().unwrap();
        let structural = summary["rank"]["rank_structural"].as_u64().unwrap();
        let expected = match label {
            "auto" => (18, 18),
            "classical" => (24, 18),
            _ => (6, 6),
        };
        assert_eq!((columns, structural), expected, "{label}");
        check_structure(&summary, &first.join(label).join("rank.csv"), expected);
        let calibrated = first.join(label).join("rig.yaml");
        let again = folder.path().join("again");
        let short = ["--duration", "0.5", "--no-check", "--rig", text_of(&calibrated), "--out", text_of(&again)];
        let mut arguments = vec!["run", text_of(&log)];
        arguments.extend(short);
        // The calibrated rig is read; half a second is too short to initialize, which is exit code 3.
        let output = dcvins(&arguments, "2");
        assert_eq!(output.status.code(), Some(3), "{}", String::from_utf8_lossy(&output.stderr));
    }
    // The same flight twice: its calibrations agree, and the figure and the tables are written.
    let history = folder.path().join("history");
    let output = dcvins(&["history", text_of(&first), text_of(&second), "--out", text_of(&history)], "2");
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success() && printed.starts_with("✓ 2 flights agree"), "{printed}");
    assert!(printed.contains("camera cam0, run auto, parameterization minimal, 2 flights"), "{printed}");
    assert_eq!(printed, fs::read_to_string(history.join("history.txt")).unwrap());
    for name in ["history.json", "history.png", "history.svg", "values.csv", "results.csv"] {
        assert!(fs::metadata(history.join(name)).unwrap().len() > 500, "{name}");
    }
    let output = dcvins(&["history", text_of(&first), "--run", "classical"], "2");
    let refused = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{refused}");
    assert!(refused.contains("parameterization is classical: a history compares minimal ones"), "{refused}");
    // Priors linearized at other values of the calibration contain spurious information.
    let text = fs::read_to_string(first.join("off/summary.json")).unwrap();
    let summary: Value = serde_json::from_str(&text).unwrap();
    let known = summary["rank"]["known"].as_array().expect("the known losses are a list");
    let claimed = known.iter().filter(|loss| loss["largest_false_gain"].as_f64() > Some(0.1)).count();
    assert!(known.len() == 6 && claimed >= 2, "{known:?}");
}

/// End of the printed line about the chain, from the values of the summary.
fn chain_error(calibration: &Value) -> String {
    let number = |value: &Value| value.as_f64().expect("a number");
    let error = &calibration["chain_error"];
    let (translation_m, rotation_rad) = (number(&error["translation_mean_m"]), number(&error["rotation_mean_rad"]));
    let parameters = calibration["parameters"].as_array().expect("the parameters are a list");
    let squares =
        parameters.iter().map(|parameter| (number(&parameter["error"]) / number(&parameter["sigma"])).powi(2));
    let sigmas = (squares.sum::<f64>() / parameters.len() as f64).sqrt();
    let parameterization = calibration["parameterization"].as_str().expect("a text");
    format!(
        "→ {:.1} mm, {:.2}° (final, {parameterization}; errors of the parameters {sigmas:.1} σ RMS)",
        1e3 * translation_m,
        rotation_rad.to_degrees()
    )
}

/// Checks that the closed-form null directions of the parameterization agree with the measurement in every step, and
/// that no other direction is lost to the parameterization.
fn check_structure(summary: &Value, rank_csv: &Path, (columns, structural): (u64, u64)) {
    let known = summary["rank"]["known"].as_array().expect("the known losses are a list");
    assert_eq!(known.len() as u64, columns - structural);
    for loss in known {
        assert!(loss["steps"].as_u64() > Some(50) && loss["agreeing"] == loss["steps"], "{loss}");
        assert!(loss["reason"].as_str().is_some_and(|reason| reason.contains("same motion (")), "{loss}");
        assert!(loss["largest_response"].as_f64().is_some_and(|response| response < 1e-11), "{loss}");
        assert!(loss["largest_false_gain"].as_f64().is_some_and(|gain| gain < 1e-3), "{loss}");
    }
    let text = fs::read_to_string(rank_csv).expect("the run wrote its ranks");
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().expect("a head").split(',').collect();
    let column = |name: &str| header.iter().position(|head| *head == name).expect("the column is there");
    let (lost, agreeing) = (column("deficit_parameterization"), column("known_agreeing"));
    for line in lines {
        let cells: Vec<&str> = line.split(',').collect();
        assert_eq!(cells[lost], cells[agreeing], "{line}");
    }
}

#[test]
fn screenshots_of_every_panel_repeat_to_the_byte() {
    let folder = tempfile::tempdir().unwrap();
    let log = sample("garden.mcap");
    let draw = |panel: &str, name: &str, threads: &str| {
        let file = folder.path().join(name);
        let arguments =
            ["screenshot", text_of(&log), "--at", "5", "--panel", panel, "--size", "640x400", "-o", text_of(&file)];
        succeed(&arguments, threads);
        fs::read(file).unwrap()
    };
    let first = draw("all", "first.png", "2");
    assert!(first.starts_with(b"\x89PNG"));
    assert!(first == draw("all", "second.png", "1"), "the same screenshot twice has the same bytes");
    let output = dcvins(&["screenshot", text_of(&log), "--at", "5", "--panel", "speed", "-o", "x.png"], "2");
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("convergence"), "the panels that exist are named");
}

#[test]
fn a_truncated_log_plays_up_to_the_damage_with_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = fs::read(sample("garden.mcap")).unwrap();
    let log = folder.path().join("cut.mcap");
    fs::write(&log, &bytes[..bytes.len() / 2]).unwrap();
    fs::copy(sample("garden.rig.yaml"), folder.path().join("cut.rig.yaml")).unwrap();
    let out = folder.path().join("out");
    let printed = succeed(&["run", text_of(&log), "--out", text_of(&out)], "2");
    assert!(printed.contains("warning"), "{printed}");
    assert!(succeed(&["check", text_of(&log)], "2").contains("cut.mcap"));
}

#[test]
fn a_rig_with_a_missing_field_or_topic_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let rig = fs::read_to_string(sample("garden.rig.yaml")).unwrap();
    let check = |from: &str, to: &str, words: &[&str]| {
        assert!(rig.contains(from), "the sample rig holds '{from}'");
        let file = folder.path().join("bad.yaml");
        fs::write(&file, rig.replacen(from, to, 1)).unwrap();
        let out = folder.path().join("out");
        let log = sample("garden.mcap");
        let output = dcvins(&["run", text_of(&log), "--rig", text_of(&file), "--out", text_of(&out)], "2");
        let complaint = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{complaint}");
        assert!(words.iter().all(|word| complaint.contains(word)), "{complaint}");
    };
    check("gravity:", "heaviness:", &["gravity"]);
    check("rostopic: /imu", "rostopic: /nowhere", &["/nowhere", "/imu"]);
}
