//! `dcvins degeneracy`: the survey of all built-in experiments, and single experiments.

use std::path::PathBuf;
use std::process::{Command, Output};

use serde_json::Value;

fn dcvins(arguments: &[&str], threads: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_dcvins"));
    command.env("DCVINS_CACHE_DIR", "");
    command.arg("degeneracy").args(arguments).env("RAYON_NUM_THREADS", threads);
    command.output().expect("the program starts")
}

fn printed(arguments: &[&str]) -> String {
    let output = dcvins(arguments, "2");
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("the report is UTF-8")
}

fn json(arguments: &[&str]) -> Value {
    serde_json::from_str(&printed(arguments)).expect("the report is JSON")
}

/// Runs one experiment with one parameterization and checks its structural rank and the words of its text.
fn check(arguments: &[&str], rank: u64, words: &[&str]) {
    let mut with_json = arguments.to_vec();
    with_json.push("--json");
    let report = json(&with_json);
    assert_eq!(report["forms"][0]["rank_structural"].as_u64(), Some(rank), "{arguments:?}");
    let text = printed(arguments);
    for word in words {
        assert!(text.contains(word), "{arguments:?} should say '{word}':\n{text}");
    }
}

#[test]
fn the_survey_is_printed_on_any_number_of_threads_with_the_same_bytes() {
    let table = json(&["--json"]);
    let rows: Vec<&Value> = table["sections"]
        .as_array()
        .expect("the sections are a list")
        .iter()
        .flat_map(|section| section["rows"].as_array().expect("the rows are a list"))
        .collect();
    assert!(rows.len() >= 60, "{} experiments", rows.len());
    for row in &rows {
        assert_eq!(row["known"], row["known_agreeing"], "{row}");
    }
    assert!(rows.iter().any(|row| row["known"].as_u64() == Some(6)), "the six redundancies of the classical chain");
    for row in table["spurious"].as_array().expect("the cases are a list") {
        assert!(row["with_first_estimates"].as_f64().expect("a number") < 1e-9, "{row}");
    }
    let (first, second) = (dcvins(&["--table"], "1"), dcvins(&[], "2"));
    assert!(first.stdout == second.stdout, "the table has the same bytes on one thread and on two");
    let text = String::from_utf8(second.stdout).unwrap();
    assert!(text.contains("encoder known, poses known                C 18/24  M 18/18  P 18/18"), "{text}");
    assert!(text.contains("null of M: L1.theta L2.theta L3.theta"), "{text}");
}

#[test]
fn experiments_name_what_is_lost_and_why() {
    check(
        &["--motion", "stabilized", "--form", "minimal"],
        15,
        &["null", "L3.d", "L3.a", "L3.y", "lost to the motion"],
    );
    check(
        &["--form", "classical"],
        18,
        &["L1.d and the translation of imu_from_base along that axis are the same motion (Eqs. 11–17)"],
    );
    check(&["--mechanism", "parallel-axes", "--form", "minimal"], 17, &["the axes of joints 1 and 2 are parallel"]);
    check(&["--encoder-sigma-deg", "none", "--frames", "16", "--form", "minimal"], 15, &["L2.theta", "unknown angles"]);
    check(&["--freeze", "1,3", "--form", "minimal"], 10, &["joint 1, joint 3 fixed"]);
    check(&["--motion", "one-joint-frozen", "--form", "minimal"], 14, &["lost to stationary joints"]);
    let rig = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("sample_logs/garden.rig.yaml");
    let rig = rig.to_str().expect("paths of tests are UTF-8");
    check(&["--rig", rig, "--form", "minimal", "--poses", "imu"], 18, &["garden (3 joints)"]);
    check(&["--rig", rig, "--form", "classical", "--motion", "hover"], 11, &["confirmed"]);
}

#[test]
fn wrong_names_are_refused_with_the_right_ones() {
    for (arguments, code, word) in [
        (&["--mechanism", "windmill"][..], 1, "pan-tilt"),
        (&["--motion", "dance"], 2, "camera-held-still"),
        (&["--form", "minimol"], 2, "minimal-swapped"),
        (&["--freeze", "4"], 1, "3 joints"),
        (&["--freeze", "0"], 1, "3 joints"),
        (&["--frames", "1"], 2, "2..=64"),
        (&["--encoder-sigma-deg=-1"], 2, "known"),
        (&["--rig", "none.yaml"], 1, "none.yaml"),
        (&["--table", "--motion", "hover"], 2, "--table"),
    ] {
        let output = dcvins(arguments, "2");
        let complaint = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {complaint}");
        assert!(complaint.contains(word), "{arguments:?} should say '{word}': {complaint}");
    }
}
