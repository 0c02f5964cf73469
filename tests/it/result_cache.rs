//! Screenshots and reports from the cache of earlier commands.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

const LOG: &str = "sample_logs/garden.mcap";

/// Runs the program with its cache in this folder.
fn run(cache: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_dcvins"));
    let output = command.env("DCVINS_CACHE_DIR", cache).args(arguments).output().expect("the program runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output
}

fn entries(cache: &Path) -> Vec<std::path::PathBuf> {
    let found = fs::read_dir(cache)
        .map(|entries| entries.map(|entry| entry.expect("the folder can be read").path()).collect::<Vec<_>>());
    found.unwrap_or_default()
}

#[test]
fn a_screenshot_of_the_same_command_is_the_same_and_another_one_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let cache = folder.path().join("cache");
    let draw = |name: &str, more: &[&str]| {
        let path = folder.path().join(name);
        let common =
            ["screenshot", LOG, "--panel", "timeline", "--size", "640x480", "--csv", "-o", path.to_str().unwrap()];
        let output = run(&cache, &[&common[..], more].concat());
        let read = |extension: &str| fs::read(path.with_extension(extension)).unwrap();
        (read("png"), read("csv"), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let first = draw("first.png", &["--at", "0.5"]);
    assert_eq!(entries(&cache).len(), 1);
    // The second screenshot comes from the cache entry: with other bytes in the entry, the program reports that it is
    // damaged.
    assert_eq!(draw("second.png", &["--at", "0.5"]), first);
    let entry = entries(&cache).remove(0);
    let mut bytes = fs::read(&entry).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    fs::write(&entry, bytes).unwrap();
    let third = draw("third.png", &["--at", "0.5"]);
    assert!(third.2.contains("damaged entry"), "{}", third.2);
    assert_eq!((&third.0, &third.1), (&first.0, &first.1));
    assert_eq!(draw("fourth.png", &["--at", "0.5"]), first);
    assert!(draw("other.png", &["--at", "0.8"]).0 != first.0, "the cursor is at another time");
    assert_eq!(entries(&cache).len(), 2);
    draw("none.png", &["--at", "0.3", "--no-cache"]);
    assert_eq!(entries(&cache).len(), 2);
}

#[test]
fn a_report_of_the_same_command_is_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let (cache, report) = (folder.path().join("cache"), folder.path().join("report"));
    let write = || {
        run(&cache, &["report", LOG, "--duration", "3", "-o", report.to_str().unwrap()]);
        let read = |name: &str| fs::read(report.join(name)).unwrap();
        ["report.html", "report.json", "auto/summary.json", "auto/frames.csv"].map(read)
    };
    let first = write();
    // The report and the check of its log.
    assert_eq!(entries(&cache).len(), 2);
    fs::write(report.join("auto/frames.csv"), "spoiled").unwrap();
    assert_eq!(write(), first);
}

#[test]
fn a_log_is_checked_once_for_all_commands() {
    let folder = tempfile::tempdir().unwrap();
    let (cache, out) = (folder.path().join("cache"), folder.path().join("out"));
    let checked = |options: &[&str]| run(&cache, &[&["check", LOG], options].concat()).stdout;
    let (text, json) = (checked(&["--no-cache"]), checked(&["--no-cache", "--json"]));
    assert_eq!(entries(&cache).len(), 0);
    run(&cache, &["run", LOG, "--duration", "4", "-o", out.to_str().unwrap()]);
    let entry = entries(&cache);
    assert_eq!((checked(&[]), checked(&["--json"])), (text, json));
    assert_eq!((entry.len(), entries(&cache)), (1, entry));
}
