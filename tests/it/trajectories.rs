//! Trajectories of other programs in addition to the runs: evaluated like a run, in summary, report and screenshots.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use dcvins::flight_log::FlightLog;
use dcvins::gui::app::StudySource;
use dcvins::study::view::comparable_rows;
use dcvins::sweep::OpenedStudy;
use dcvins::sweep::read_parquet;
use serde_json::Value;

use crate::sample_folder;

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

/// Writes the ground truth of the sample log as a EuRoC table, with heights that are alternately too large and too
/// small by a constant error.
fn write_trajectory(path: &Path, error_m: f64) {
    let log = FlightLog::open(&sample_log()).expect("the sample log");
    let mut text = "#timestamp [ns],p x,p y,p z,q w,q x,q y,q z\n".to_owned();
    for (index, pose) in log
        .read_trajectory_topic("/ground_truth/odometry")
        .expect("the topic of its ground truth")
        .iter()
        .step_by(10)
        .enumerate()
    {
        let (p, q) = (pose.position_m, pose.rotation.expect("poses have attitudes"));
        let z = p.z + if index % 2 == 0 { error_m } else { -error_m };
        writeln!(text, "{},{},{},{},{},{},{},{}", pose.stamp_ns, p.x, p.y, z, q.w, q.i, q.j, q.k)
            .expect("writing into a string cannot fail");
    }
    std::fs::write(path, text).expect("a file in a new folder");
}

#[test]
fn a_trajectory_is_evaluated_like_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (log, results) = (sample_log().to_str().unwrap().to_owned(), at("results"));
    write_trajectory(Path::new(&at("other.csv")), 0.05);
    let (file, topic) = (format!("{}:Other", at("other.csv")), "topic:/ground_truth/odometry:Truth");
    let run =
        ["run", &log, "--duration", "6", "--no-check", "--out", &results, "--trajectory", &file, "--trajectory", topic];
    let (code, text) = dcvins(&run);
    assert_eq!(code, 0, "{text}");
    assert!(text.contains("trajectory Other (") && text.contains("ATE 50.0 mm RMSE"), "{text}");
    let summary = std::fs::read_to_string(folder.path().join("results/auto/summary.json")).unwrap();
    let summary: Value = serde_json::from_str(&summary).unwrap();
    let lanes = summary["trajectories"].as_array().unwrap();
    assert_eq!((lanes[0]["label"].as_str(), lanes[1]["label"].as_str()), (Some("Other"), Some("Truth")));
    let ate_m = |lane: &Value| lane["accuracy"]["ate_rmse_m"].as_f64().unwrap();
    assert!((ate_m(&lanes[0]) - 0.05).abs() < 1e-3 && ate_m(&lanes[1]) < 1e-9, "{lanes:?}");
    assert!(lanes[0]["accuracy"]["rpe"].as_array().is_some_and(|rpe| !rpe.is_empty()), "{lanes:?}");
    assert_eq!(lanes[1]["source"], "topic:/ground_truth/odometry");

    // The run's trajectory is evaluated like the run.
    let own = format!("{}:own", at("results/auto/trajectory.tum"));
    let again = at("again");
    let (code, text) = dcvins(&["run", &log, "--duration", "6", "--no-check", "--out", &again, "--trajectory", &own]);
    assert_eq!(code, 0, "{text}");
    let summary: Value =
        serde_json::from_str(&std::fs::read_to_string(folder.path().join("again/auto/summary.json")).unwrap()).unwrap();
    let of_run = summary["accuracy"]["ate_rmse_m"].as_f64().unwrap();
    assert!((ate_m(&summary["trajectories"][0]) - of_run).abs() < 1e-6, "{summary}");

    let report = at("report");
    let (code, text) = dcvins(&["report", &log, "--duration", "6", "-o", &report, "--trajectory", &file]);
    assert_eq!(code, 0, "{text}");
    let page = std::fs::read_to_string(folder.path().join("report/report.html")).unwrap();
    assert!(page.contains("All runs; errors after alignment") && page.contains("Other"), "the page lists it");
}

/// A sweep has a row for each trajectory, with the same errors as the run with the same poses.
#[test]
fn a_sweep_evaluates_trajectories_beside_its_runs() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let plan = "seeds = [1, 2]\nspecs = [\"auto\"]\n[[logs]]\npath = \"garden.mcap\"\nduration_s = 5\n\
                trajectories = [\"other/{log}.csv:Other\", \"topic:/ground_truth/odometry:Truth\"]\n\
                [[perturbations]]\nname = \"none\"\n[[perturbations]]\nname = \"5 mm\"\nstart = \"truth\"\n\
                changes = [{ quantity = \"gimbal.translation\", magnitude = \"5 mm\" }]\n";
    sample_folder::fill(folder.path(), plan);
    std::fs::create_dir(folder.path().join("other")).unwrap();
    write_trajectory(Path::new(&at("other/garden.csv")), 0.05);
    let sweep = ["sweep", &at("plan.toml"), "-o", &at("study")];
    let (code, text) = dcvins(&sweep);
    assert_eq!(code, 0, "{text}");
    let table = read_parquet(&folder.path().join("study/results.parquet")).unwrap();
    // One run without errors and two with errors; trajectories once.
    let labels: Vec<&str> = (0..table.rows()).map(|row| table.text(row, "label").unwrap()).collect();
    assert_eq!(labels, ["auto", "auto", "auto", "Other", "Truth"]);
    let number = |row: usize, column: &str| table.number(row, column).unwrap();
    assert!((number(3, "ate_rmse_m") - 0.05).abs() < 1e-3 && number(4, "ate_rmse_m") < 1e-9);
    assert!((number(3, "worst_frame_m") - 0.05).abs() < 2e-3 && number(3, "rpe_5m_translation_m") > 0.01);
    assert!((number(3, "length_m") - number(4, "length_m")).abs() < 0.05);
    assert_eq!(table.text(3, "run"), Some("trajectory:Other"));
    assert_eq!((table.text(3, "status"), table.text(3, "parameterization")), (Some("ok"), None));
    assert_eq!(table.text(4, "trajectory_path"), Some("topic:/ground_truth/odometry"));
    // The row of a trajectory opens the run on the same log, with both trajectories.
    let study = OpenedStudy::read(&folder.path().join("study")).unwrap();
    let rows = comparable_rows(&study.study().runs, 3, 4);
    assert_eq!(rows, [3, 0, 4]);
    let opened = StudySource::open_runs(&study, &rows).unwrap();
    let recording = opened.recording();
    let lanes: Vec<&str> = recording.trajectories.iter().map(|lane| lane.label.as_str()).collect();
    assert_eq!((recording.runs.len(), lanes), (1, vec!["Other", "Truth"]));
    // A second time there is nothing to do, also with the file in another folder.
    std::fs::rename(folder.path().join("other"), folder.path().join("moved")).unwrap();
    std::fs::write(at("plan.toml"), plan.replace("other/", "moved/")).unwrap();
    let (code, text) = dcvins(&sweep);
    assert!(code == 0 && text.contains("0 done now, 5 done before"), "{text}");
    // The message names a missing file.
    std::fs::remove_dir_all(folder.path().join("moved")).unwrap();
    let (code, text) = dcvins(&sweep);
    assert!(code != 0 && text.contains("moved/garden.csv"), "{code}: {text}");
}

#[test]
fn what_does_not_belong_to_the_log_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let log = sample_log().to_str().unwrap().to_owned();
    let out = folder.path().join("results").to_str().unwrap().to_owned();
    let file = folder.path().join("other.tum").to_str().unwrap().to_owned();
    let check = |content: &str, trajectory: &str, expected: &str| {
        std::fs::write(&file, content).unwrap();
        let (code, text) =
            dcvins(&["run", &log, "--duration", "1", "--no-check", "--out", &out, "--trajectory", trajectory]);
        assert!(code == 1 && text.contains(expected), "{code}: {text}");
    };
    check(
        "1.0 0 0 0 0 0 0 1\n",
        &file,
        "no pose with an attitude within the time of the log: its stamps are 1.000 to 1.000 s",
    );
    check("1.0 0 0 0\n", &file, "it has positions without attitudes");
    check("1.0 0 0\n", &file, "line 1 holds 3 numbers; expected 't x y z qx qy qz qw'");
    check("", "topic:/vins", "no topic '/vins' in the log; topics with poses or positions: /ground_truth/odometry");
    check("", "topic:/imu", "topic '/imu' is of type sensor_msgs/msg/Imu, expected one of nav_msgs/msg/Odometry");
}

/// Writes positions of an antenna at 5 Hz from the ground truth of the sample log, as TUM with quaternions of zeros.
fn write_positions(path: &Path, lever_arm_m: [f64; 3]) {
    let log = FlightLog::open(&sample_log()).expect("the sample log");
    let mut text = String::new();
    let poses = log.read_trajectory_topic("/ground_truth/odometry").expect("the topic of its ground truth");
    for pose in poses.iter().step_by(20) {
        let at = pose.position_m + pose.rotation.expect("poses have attitudes") * nalgebra::Vector3::from(lever_arm_m);
        let (seconds, rest) = (pose.stamp_ns / 1_000_000_000, pose.stamp_ns % 1_000_000_000);
        writeln!(text, "{seconds}.{rest:09} {} {} {} 0 0 0 0", at.x, at.y, at.z)
            .expect("writing into a string cannot fail");
    }
    std::fs::write(path, text).expect("a file in a new folder");
}

#[test]
fn positions_of_an_antenna_are_ground_truth() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let log = sample_log().to_str().unwrap().to_owned();
    let lever_arm_m = [0.12, -0.05, 0.31];
    let positions = at("rtk.tum");
    write_positions(Path::new(&positions), lever_arm_m);
    let accuracy = |name: &str, options: &[&str]| -> Value {
        let out = at(name);
        let (code, text) = dcvins(&[&["run", &log, "--no-check", "--out", &out], options].concat());
        assert_eq!(code, 0, "{text}");
        let summary = std::fs::read_to_string(folder.path().join(name).join("auto/summary.json")).unwrap();
        let summary: Value = serde_json::from_str(&summary).unwrap();
        summary["accuracy"].clone()
    };
    let ate_m = |accuracy: &Value| accuracy["ate_rmse_m"].as_f64().unwrap();
    let poses = accuracy("poses", &[]);
    let known = accuracy("known", &["--truth-trajectory", &positions, "--lever-arm", "0.12,-0.05,0.31"]);
    assert!((ate_m(&known) - ate_m(&poses)).abs() < 0.3 * ate_m(&poses) + 1e-3, "{known} {poses}");
    assert_eq!(known["rpe"].as_array().map(Vec::len), Some(0));
    let none = accuracy("none", &["--truth-trajectory", &positions]);
    assert!(ate_m(&none) > 1.5 * ate_m(&known), "{none} {known}");
    let estimated = accuracy("estimated", &["--truth-trajectory", &positions, "--lever-arm", "estimate"]);
    let numbers = |key: &str| -> Vec<f64> {
        estimated["antenna"][key].as_array().unwrap().iter().filter_map(Value::as_f64).collect()
    };
    for ((found, sigma), actual) in numbers("lever_arm_m").iter().zip(numbers("lever_arm_sigma_m")).zip(lever_arm_m) {
        assert!((found - actual).abs() < 4.0 * sigma && sigma < 0.1, "{estimated}");
    }
    assert!(ate_m(&estimated) < 1.1 * ate_m(&known), "{estimated} {known}");

    let poses_file = at("poses/auto/trajectory.tum");
    let out = at("refused");
    let refused = ["run", &log, "--out", &out, "--truth-trajectory", &poses_file, "--lever-arm", "estimate"];
    let (code, text) = dcvins(&refused);
    assert!(code == 1 && text.contains("it has attitudes, but a lever arm applies only to positions"), "{text}");
}
