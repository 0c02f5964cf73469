//! `screenshot` at several times.

use std::fs;
use std::path::Path;
use std::process::Command;

/// Draws the timeline of the sample log into a folder; returns the exit code and the names of the files.
fn draw(folder: &Path, arguments: &[&str]) -> (Option<i32>, Vec<String>) {
    let log = Path::new(env!("CARGO_MANIFEST_DIR")).join("sample_logs/garden.mcap");
    let mut command = Command::new(env!("CARGO_BIN_EXE_dcvins"));
    command.env("DCVINS_CACHE_DIR", "");
    command.arg("screenshot").arg(log).args(["--panel", "timeline", "--size", "640x200", "-o"]);
    command.arg(folder.join("line.png")).args(arguments);
    let output = command.output().expect("the program starts");
    let entries = fs::read_dir(folder).expect("the folder is there");
    let name = |entry: std::io::Result<fs::DirEntry>| {
        entry.expect("it can be read").file_name().to_string_lossy().into_owned()
    };
    let mut names: Vec<String> = entries.map(name).collect();
    names.sort();
    (output.status.code(), names)
}

#[test]
fn a_name_that_no_screenshot_has_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let log = Path::new(env!("CARGO_MANIFEST_DIR")).join("sample_logs/garden.mcap");
    let mut command = Command::new(env!("CARGO_BIN_EXE_dcvins"));
    command.env("DCVINS_CACHE_DIR", "");
    let output =
        command.arg("screenshot").arg(log).args(["--at", "0.5", "-o"]).arg(folder.path().join("line.csv")).output();
    let output = output.expect("the program starts");
    assert_eq!(output.status.code(), Some(1));
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(message.contains("neither .png nor .svg"), "{message}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is written");
}

#[test]
fn several_instants_are_named_by_their_time() {
    let check = |arguments: &[&str], code: i32, names: &[&str]| {
        let folder = tempfile::tempdir().unwrap();
        let drawn = draw(folder.path(), arguments);
        assert_eq!(
            (drawn.0, drawn.1.as_slice()),
            (Some(code), names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>().as_slice()),
            "{arguments:?}"
        );
        for name in names {
            let picture = image::open(folder.path().join(name)).unwrap();
            assert_eq!((picture.width(), picture.height()), (640, 200), "{name}");
        }
    };
    check(&["--at", "0.5"], 0, &["line.png"]);
    check(&["--at", "1", "--at", "0.5", "--at", "1.0"], 0, &["line-0000.500.png", "line-0001.000.png"]);
    let every = ["line-0000.200.png", "line-0000.700.png", "line-0001.200.png", "line-0001.300.png"];
    check(&["--every", "0.5", "--start", "0.2", "--duration", "1.1", "--at", "1.3"], 0, &every);
    check(&[], 2, &[]);
    check(&["--every", "0"], 2, &[]);
}
