//! Outputs and exit codes: overwritten files, remaining files of earlier runs, output for scripts.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn sample(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("sample_logs").join(name)
}

/// Runs the program in a folder.
fn dcvins(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_dcvins"));
    command.env("DCVINS_CACHE_DIR", "");
    command.current_dir(folder).args(arguments).output().expect("the program starts")
}

/// Checks the exit code of a command and that its standard error contains all words.
fn check(folder: &Path, arguments: &[&str], code: i32, words: &[&str]) {
    let output = dcvins(folder, arguments);
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {complaint}");
    for word in words {
        assert!(complaint.contains(word), "{arguments:?} should say '{word}': {complaint}");
    }
}

/// A folder with the sample log.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder can be made");
    for name in ["garden.mcap", "garden.rig.yaml", "garden.truth.yaml"] {
        fs::copy(sample(name), folder.path().join(name)).expect("the sample can be copied");
    }
    folder
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("the folder can be listed");
    let mut names: Vec<String> =
        entries.map(|entry| entry.expect("the entry can be read").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn results_of_the_same_log_are_replaced_and_nothing_else() {
    let folder = folder();
    let run = |more: &[&str], code: i32, words: &[&str]| {
        let arguments = [&["run", "garden.mcap", "--out", "out", "--duration", "0.5", "--no-check"], more].concat();
        check(folder.path(), &arguments, code, words);
    };
    // Half a second is too short to initialize.
    run(&["--mcap", "--euroc"], 3, &[]);
    let out = folder.path().join("out/auto");
    assert!(out.join("results.mcap").is_file() && out.join("trajectory.euroc.csv").is_file());
    run(&[], 3, &[]);
    let expected = [
        "calibration.csv",
        "covariance.csv",
        "frames.csv",
        "information.csv",
        "rank.csv",
        "rig.yaml",
        "summary.json",
        "trajectory.tum",
    ];
    assert_eq!(names(&out), expected, "what this run does not write is gone");
    run(&["--run", "static"], 3, &["also holds runs of earlier commands: auto"]);

    fs::write(out.join("notes.txt"), "mine").unwrap();
    let before = fs::read(out.join("summary.json")).unwrap();
    run(&[], 1, &["notes.txt", "--force", "out/auto"]);
    assert!(fs::read(out.join("summary.json")).unwrap() == before);
    run(&["--force"], 3, &[]);
    assert_eq!(fs::read_to_string(out.join("notes.txt")).unwrap(), "mine");

    fs::copy(folder.path().join("garden.mcap"), folder.path().join("other.mcap")).unwrap();
    fs::copy(folder.path().join("garden.rig.yaml"), folder.path().join("other.rig.yaml")).unwrap();
    let other = ["run", "other.mcap", "--out", "out", "--run", "static", "--duration", "0.5"];
    check(folder.path(), &other, 1, &["results of the log 'garden.mcap'", "--force"]);
}

#[test]
fn outputs_that_cannot_be_written_are_noticed_before_the_work() {
    let folder = folder();
    let check = |arguments: &[&str], words: &[&str]| check(folder.path(), arguments, 1, words);
    check(&["run", "garden.mcap", "--out", "garden.rig.yaml"], &["it is a file, expected a folder"]);
    check(&["report", "garden.mcap", "-o", "garden.mcap/x"], &["'garden.mcap' is a file, not a folder"]);
    check(&["simulate", "T1", "-o", "."], &["it is a folder"]);
    check(&["simulate", "T1", "-o", "none/x.mcap"], &["its folder 'none' does not exist"]);
    check(&["simulate", "T1", "-o", "garden.rig.yaml"], &["is not a simulated log", "--force"]);
    check(&["convert", "garden.mcap", "-o", "garden.truth.yaml"], &["was not written by 'dcvins convert'", "--force"]);
    check(&["run", "garden.mcap", "--out", "out", "--start", "100"], &["--start 100 s is after the end", "8.500 s"]);
    assert_eq!(names(folder.path()), ["garden.mcap", "garden.rig.yaml", "garden.truth.yaml"]);
}

#[test]
fn a_required_accuracy_has_an_exit_code_of_its_own() {
    let folder = folder();
    let run = |require: &str, code: i32, words: &[&str]| {
        let arguments =
            ["run", "garden.mcap", "--out", "out", "--force", "--duration", "3.5", "--no-check", "--json", require];
        check(folder.path(), &arguments, code, words);
    };
    run("--require", 7, &[]);
    let summary = fs::read_to_string(folder.path().join("out/auto/summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
    let requirement = &summary["answer"]["requirement"];
    assert!(requirement["met"].as_u64() < requirement["parameters"].as_u64(), "{requirement}");
    assert_eq!(requirement["required"], "5 mm and 0.1°");
    run("--require=translation=1m,rotation=60deg", 0, &[]);
    run("--require=translation=1m,rotation=60deg,yaw.a=1e-6mm", 7, &[]);
    run("--require=rotation=-1deg", 1, &["rotation: '-1deg' is no positive number"]);
    run("--require=knee.a=1mm", 1, &["'knee.a' is no parameter"]);
}

#[test]
fn scripts_can_tell_the_ends_of_commands_apart() {
    let folder = folder();
    let run = ["run", "garden.mcap", "--out", "out"];
    check(folder.path(), &[&run[..], &["--break", "frame >= 3"]].concat(), 5, &[]);
    check(folder.path(), &["check", "garden.mcap"], 0, &[]);
    let rig = fs::read_to_string(folder.path().join("garden.rig.yaml")).unwrap();
    fs::write(folder.path().join("bad.yaml"), rig.replace("timeshift_cam_imu:", "timeshift_cam_imuu:")).unwrap();
    check(folder.path(), &["check", "garden.mcap", "--rig", "bad.yaml"], 4, &[]);
    for (command, code) in [("run", "5 the condition"), ("check", "4 errors found"), ("report", "3 a run never")] {
        let help = dcvins(folder.path(), &[command, "--help"]);
        let help = String::from_utf8_lossy(&help.stdout).split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(help.contains("Exit codes: 0") && help.contains(code), "{command}: {help}");
    }
}

#[test]
fn an_edited_rig_is_kept() {
    let folder = folder();
    let simulate = |more: &[&str], code: i32, words: &[&str]| {
        let arguments = ["simulate", "T1", "-o", "s.mcap", "--duration", "0.5", "--size", "64x48"];
        check(folder.path(), &[&arguments[..], more].concat(), code, words);
    };
    simulate(&[], 0, &[]);
    simulate(&[], 0, &[]);
    let rig = folder.path().join("s.rig.yaml");
    let edited = format!("{}# measured again\n", fs::read_to_string(&rig).unwrap());
    fs::write(&rig, &edited).unwrap();
    simulate(&[], 1, &["is not as 'dcvins simulate' wrote it", "s.rig.yaml"]);
    assert_eq!(fs::read_to_string(&rig).unwrap(), edited);
    simulate(&["--force"], 0, &[]);
    assert_ne!(fs::read_to_string(&rig).unwrap(), edited);
}

#[cfg(target_os = "linux")]
#[test]
fn an_interrupt_and_a_kill_leave_no_part_of_a_file() {
    let folder = folder();
    for (signal, code) in [("-INT", Some(130)), ("-KILL", None)] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_dcvins"));
        command.env("DCVINS_CACHE_DIR", "");
        command.current_dir(folder.path()).args(["simulate", "T1", "-o", "k.mcap", "--size", "64x48"]);
        let mut process = command.spawn().expect("the program starts");
        let temporary = || names(folder.path()).into_iter().find(|name| name.starts_with(".k.mcap.dcvins-"));
        // An empty one only checks that the file can be written.
        let size = |name: &String| fs::metadata(folder.path().join(name)).map_or(0, |metadata| metadata.len());
        while temporary().as_ref().map_or(0, size) == 0 {
            assert!(process.try_wait().unwrap().is_none(), "it ends before it writes");
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        let id = process.id().to_string();
        assert!(Command::new("kill").args([signal, &id]).status().unwrap().success());
        assert_eq!(process.wait().unwrap().code(), code);
        assert!(!folder.path().join("k.mcap").exists());
        assert_eq!(temporary().is_some(), code.is_none(), "only a killed process leaves its temporary file");
    }
    check(folder.path(), &["simulate", "T1", "-o", "k.mcap", "--duration", "0.5", "--size", "64x48"], 0, &[]);
    assert!(names(folder.path()).iter().all(|name| !name.starts_with('.')), "the next command removes it");
}
