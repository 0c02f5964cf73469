//! `dcvins sweep`: interrupted and resumed; with jobs that fail, are killed or time out; in shards; against a baseline.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use dcvins::study::StudyTable;
use dcvins::sweep::read_parquet;
use serde_json::Value;

use crate::sample_folder;

/// Five seconds of the sample log with and without errors of the rig, and a file that is not a log.
const PLAN: &str = r#"
name = "garden"
seeds = [1, 2]
specs = ["auto", "static"]

[[logs]]
path = "garden.mcap"
duration_s = 5

[[logs]]
path = "bro*.mcap"

[[perturbations]]
name = "none"

[[perturbations]]
name = "5 mm"
start = "truth"
changes = [{ quantity = "gimbal.translation", magnitude = "5 mm" }]
"#;

fn folder(plan: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder can be made");
    sample_folder::fill(folder.path(), plan);
    fs::write(folder.path().join("broken.mcap"), "this is no log").expect("a file in a new folder");
    folder
}

fn sweep(folder: &Path, out: &str, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_dcvins"));
    command.env("DCVINS_CACHE_DIR", "");
    command.current_dir(folder).args(["sweep", "plan.toml", "-o", out]).args(more);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Runs a sweep, checks its exit code and returns its JSON.
fn check(folder: &Path, out: &str, more: &[&str], code: i32) -> Value {
    let output: Output = sweep(folder, out, &[more, &["--json"]].concat()).output().expect("the program starts");
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{more:?}: {complaint}");
    serde_json::from_slice(&output.stdout).unwrap_or(Value::Null)
}

fn results(folder: &Path, out: &str) -> StudyTable {
    read_parquet(&folder.join(out).join("results.parquet")).expect("the table can be read")
}

/// Number of rows by status.
fn statuses(runs: &StudyTable) -> BTreeMap<String, usize> {
    runs.groups("status").into_iter().map(|(status, rows)| (status, rows.len())).collect()
}

/// Files of this name below the jobs of a study.
fn job_files(folder: &Path, out: &str, name: &str) -> Vec<PathBuf> {
    let jobs = fs::read_dir(folder.join(out).join("jobs")).into_iter().flatten().filter_map(Result::ok);
    jobs.map(|job| job.path().join(name)).filter(|path| path.is_file()).collect()
}

/// Waits for a condition, at most a minute.
fn wait_for(what: &str, mut condition: impl FnMut() -> bool) {
    for _ in 0..1200 {
        if condition() {
            return;
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    panic!("{what} did not happen within a minute");
}

fn signal(name: &str, process: u32) {
    let sent = Command::new("kill").args([name, &process.to_string()]).stderr(Stdio::null()).status();
    sent.expect("kill runs");
}

/// Child processes of a process.
fn children(of: &Child) -> Vec<u32> {
    let id = of.id();
    let text = fs::read_to_string(format!("/proc/{id}/task/{id}/children")).unwrap_or_default();
    text.split_whitespace().filter_map(|child| child.parse().ok()).collect()
}

#[test]
fn a_sweep_is_killed_and_resumed_with_jobs_that_fail() {
    let folder = folder(PLAN);
    let path = folder.path();
    let mut first = sweep(path, "study", &["--jobs", "1"]).spawn().unwrap();
    wait_for("a first job", || !job_files(path, "study", "results.parquet").is_empty());
    let running = children(&first);
    signal("-KILL", first.id());
    drop(first.wait());
    wait_for("the end of its child", || running.iter().all(|child| !Path::new(&format!("/proc/{child}")).exists()));
    let before = job_files(path, "study", "results.parquet").len();
    assert!(before < 12, "the sweep was not killed in its middle");

    // 2 runs × (without errors, 2 seeds of errors) × 2 logs.
    let report = check(path, "study", &[], 6);
    assert_eq!((report["jobs"].as_u64(), report["skipped"].as_u64()), (Some(12), Some(before as u64)));
    assert_eq!((report["failed"].as_u64(), report["missing"].as_u64()), (Some(6), Some(0)));
    let runs = results(path, "study");
    assert_eq!(statuses(&runs), BTreeMap::from([("failed".to_owned(), 6), ("ok".to_owned(), 6)]));
    for row in 0..runs.rows() {
        if runs.text(row, "status") == Some("ok") {
            let ate_m = runs.number(row, "ate_rmse_m").expect("the sample has ground truth");
            assert!(ate_m < 0.5 && runs.number(row, "worst_frame_s").is_some(), "ATE {ate_m}");
            assert!(runs.integer(row, "peak_memory_bytes").is_some_and(|bytes| bytes > 1 << 20));
        } else {
            assert_eq!(runs.integer(row, "attempts"), Some(2));
            assert!(
                runs.text(row, "message").is_some_and(|text| text.contains("broken.mcap")),
                "{:?}",
                runs.text(row, "message")
            );
        }
    }
    let parameters = read_parquet(&path.join("study/parameters.parquet")).unwrap();
    assert!(parameters.rows() > 6 * 6 && parameters.column("sigma").is_some());
    assert!(fs::read_to_string(path.join("study/results.csv")).unwrap().lines().count() >= 13);

    let table = fs::read(path.join("study/results.parquet")).unwrap();
    assert_eq!(check(path, "study", &[], 6)["skipped"].as_u64(), Some(12));
    assert_eq!(fs::read(path.join("study/results.parquet")).unwrap(), table, "nothing ran again");

    // Shards of another folder give the same results.
    check(path, "shards", &["--shard", "2/2"], 6);
    check(path, "shards", &["--collect"], 1);
    check(path, "shards", &["--shard", "1/2"], 6);
    check(path, "shards", &["--collect"], 6);
    let shards = results(path, "shards");
    for column in ["key", "status", "ate_rmse_m", "pose_nees", "rank_informed", "chain_error_m", "rig_sha256"] {
        let cells = |table: &StudyTable| (0..table.rows()).map(|row| table.cell(row, column)).collect::<Vec<_>>();
        assert_eq!(cells(&shards), cells(&runs), "{column}");
    }

    let summary = path.join("summary.md");
    let guard = [
        "--collect",
        "--baseline",
        "study/results.parquet",
        "--tolerance",
        "ate_rmse_m=0.1",
        "--summary",
        "summary.md",
    ];
    let comparison = check(path, "shards", &guard, 6);
    assert_eq!(comparison["comparison"]["pairs"].as_u64(), Some(12));
    assert!(fs::read_to_string(summary).unwrap().contains("not worse than the baseline"));
    let unknown = ["--collect", "--baseline", "study/results.parquet", "--tolerance", "ate=0.1"];
    check(path, "shards", &unknown, 1);
}

#[test]
fn jobs_that_are_killed_or_take_too_long_are_rows() {
    let plan = "[[logs]]\npath = \"garden.mcap\"\n[limits]\ntimeout_s = 60\n";
    let folder = folder(plan);
    let path = folder.path();
    let running = sweep(path, "killed", &["--json"]).spawn().unwrap();
    for attempt in 0..2 {
        let mut child = None;
        wait_for("a job", || {
            child = children(&running).first().copied();
            child.is_some()
        });
        let child = child.unwrap();
        signal("-KILL", child);
        wait_for("the end of the job", || !children(&running).contains(&child));
        assert!(attempt < 2);
    }
    let output = running.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(6), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(statuses(&results(path, "killed")), BTreeMap::from([("killed".to_owned(), 1)]));

    fs::write(path.join("plan.toml"), plan.replace("60", "0.2")).unwrap();
    check(path, "slow", &[], 6);
    let slow = results(path, "slow");
    assert_eq!(statuses(&slow), BTreeMap::from([("timeout".to_owned(), 1)]));
    assert_eq!(slow.text(0, "message"), Some("longer than 0.2 s (limits.timeout_s)"));
}

#[test]
fn a_flight_is_rendered_once_and_the_first_job_gives_an_estimate() {
    let plan = r#"
specs = ["auto", "static"]
[[flights]]
experiment = "T3"
duration_s = 2
size_px = [160, 120]
[output]
frames = true
files = true
"#;
    let folder = folder(plan);
    let path = folder.path();
    let report = check(path, "study", &["--dry-run"], 0);
    assert_eq!((report["jobs"].as_array().map(Vec::len), report["estimate"]["jobs"].as_u64()), (Some(2), Some(1)));
    assert!(report["estimate"]["wall_s"].as_f64().is_some_and(|wall_s| wall_s > 0.0));
    let report = check(path, "study", &[], 0);
    assert_eq!((report["skipped"].as_u64(), report["done"].as_u64()), (Some(1), Some(1)));
    let flights = fs::read_dir(path.join("study/flights")).unwrap().filter_map(Result::ok);
    assert_eq!(flights.filter(|entry| entry.path().is_dir()).count(), 1);
    let frames = read_parquet(&path.join("study/frames.parquet")).unwrap();
    assert_eq!(frames.rows(), 2 * 40);
    assert_eq!(job_files(path, "study", "auto/trajectory.tum").len(), 1);
}

#[test]
fn a_folder_with_other_files_and_a_wrong_plan_are_refused() {
    let folder = folder("seeds = [1, 1]\n");
    let path = folder.path();
    let complaint = |out: &str| {
        let output = sweep(path, out, &[]).output().unwrap();
        assert_eq!(output.status.code(), Some(1));
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    assert!(complaint("study").contains("line 1: 'seeds' has a seed twice"));
    fs::write(path.join("plan.toml"), "[[logs]]\npath = \"none*.mcap\"\n").unwrap();
    assert!(complaint("study").contains("logs 'none*.mcap' of the plan: match no file in"));
    fs::write(path.join("plan.toml"), PLAN).unwrap();
    fs::create_dir(path.join("mine")).unwrap();
    fs::write(path.join("mine/notes.txt"), "mine").unwrap();
    assert!(complaint("mine").contains("the folder holds 'notes.txt' and no study.json"));
}
