//! Exit codes and messages of the binary: 0 success, 1 failure, 2 wrong usage; never a panic.

use std::path::Path;
use std::process::{Command, Output};

fn dcvins(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_dcvins"))
        .env("DCVINS_CACHE_DIR", "")
        .args(arguments)
        .output()
        .expect("the program starts")
}

/// Runs the program and checks its exit code and that its error message contains every word.
fn check(arguments: &[&str], code: i32, words: &[&str]) {
    let output = dcvins(arguments);
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {complaint}");
    assert!(!complaint.contains("panicked"), "{arguments:?}: {complaint}");
    for word in words {
        assert!(complaint.contains(word), "{arguments:?} should say '{word}': {complaint}");
    }
}

#[test]
fn wrong_use_is_exit_code_2() {
    check(&["fly"], 2, &["unrecognized subcommand", "fly"]);
    check(&["run", "log.mcap"], 2, &["--out"]);
    check(&["calibrate", "log.mcap"], 2, &["--out"]);
    check(&["run", "log.mcap", "--out", "x", "--run", "minimol"], 2, &["minimol", "minimal-swapped"]);
    check(&["run", "log.mcap", "--out", "x", "--start=-3"], 2, &["--start"]);
    // The output has the same names in every command.
    for name in ["-o", "--out", "--output"] {
        for command in ["run", "report", "calibrate", "convert", "screenshot"] {
            check(&[command, "log.mcap", name, "x", "--no-such"], 2, &["unexpected argument '--no-such'"]);
        }
        check(&["simulate", "t1", name, "x", "--no-such"], 2, &["unexpected argument '--no-such'"]);
    }
    check(&["evaluate", "a.tum", "b.tum", "--delta", "3x"], 2, &["--delta", "10m"]);
    check(&["simulate", "T9", "-o", "x.mcap"], 2, &["T9", "t1"]);
    check(&["simulate", "T1", "--world", "desert", "-o", "x.mcap"], 2, &["desert", "textured, plain, facades"]);
    check(&["simulate", "T1", "--swing", "91", "-o", "x.mcap"], 2, &["91", "degrees from 0 to 90"]);
}

#[test]
fn failed_work_is_exit_code_1_and_one_message() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    let out = path("out");
    check(&["run", &path("none.mcap"), "--out", &out], 1, &["none.mcap"]);
    std::fs::write(path("empty.mcap"), b"").unwrap();
    check(&["run", &path("empty.mcap"), "--out", &out], 1, &["empty.mcap"]);
    std::fs::write(path("text.mcap"), b"this is no log, but a text of some length\n").unwrap();
    check(&["run", &path("text.mcap"), "--out", &out], 1, &["text.mcap"]);
    check(&["calibrate", &path("text.mcap"), "--out", &out], 1, &["text.mcap"]);
    check(&["check", &path("text.mcap")], 1, &["text.mcap"]);
    check(&["convert", &path("text.mcap"), "--to", "euroc", "-o", &out], 1, &["text.mcap"]);
    check(&["convert", &path("text.mcap"), "--camera", "cam0", "-o", &path("x.mcap")], 1, &["--to euroc"]);
    check(&["simulate", "T1", "--world", "facades", "-o", &path("x.mcap")], 1, &["T1", "'facades'", "plain"]);
    check(&["evaluate", &path("a.tum"), &path("b.tum")], 1, &["a.tum"]);
    assert!(!Path::new(&out).exists(), "nothing is written for a log that cannot be read");
}

#[test]
fn help_and_version_are_exit_code_0() {
    for arguments in [&["--help"][..], &["--version"], &["run", "--help"], &["simulate", "--help"]] {
        let output = dcvins(arguments);
        assert!(output.status.success());
        assert!(!output.stdout.is_empty());
    }
}
