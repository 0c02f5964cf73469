//! `dcvins run --follow` on a log while it is being written.

use std::fs::{self, File};
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Output};
use std::thread;
use std::time::Duration;

fn dcvins(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_dcvins"));
    command.current_dir(folder).env("DCVINS_CACHE_DIR", "").args(arguments);
    command.output().expect("the program starts")
}

#[test]
fn files_of_a_followed_log_are_those_of_the_complete_one() {
    let samples = Path::new(env!("CARGO_MANIFEST_DIR")).join("sample_logs");
    let folder = tempfile::tempdir().expect("a folder can be made");
    let rig = samples.join("garden.rig.yaml");
    fs::copy(rig, folder.path().join("live.rig.yaml")).expect("the rig can be copied");
    let bytes = fs::read(samples.join("garden.mcap")).expect("the sample log can be read");
    let of_run = ["--run", "auto", "--no-check", "--no-timing"];
    let followed = thread::scope(|scope| {
        scope.spawn(|| {
            // The program is there before the file, and parts end anywhere in a record.
            thread::sleep(Duration::from_millis(300));
            let mut file = File::create(folder.path().join("live.mcap")).expect("the log can be made");
            for part in bytes.chunks(200_003) {
                file.write_all(part).expect("the log can be written");
                thread::sleep(Duration::from_millis(10));
            }
        });
        dcvins(folder.path(), &[&["run", "live.mcap", "--follow", "--out", "followed"], &of_run[..]].concat())
    });
    let said = String::from_utf8_lossy(&followed.stderr).into_owned();
    assert!(followed.status.success(), "{said}");
    assert!(said.contains("followed 8.5 s of log") && said.contains("s behind it on average"), "{said}");
    let complete = dcvins(folder.path(), &[&["run", "live.mcap", "--out", "complete"], &of_run[..]].concat());
    assert!(complete.status.success(), "{}", String::from_utf8_lossy(&complete.stderr));
    let files: Vec<_> = fs::read_dir(folder.path().join("complete/auto")).expect("the folder of the run").collect();
    assert!(files.len() >= 9, "{files:?}");
    for file in files {
        let name = file.expect("a file").file_name();
        let [one, other] =
            ["followed", "complete"].map(|run| fs::read(folder.path().join(run).join("auto").join(&name)));
        assert!(one.expect("the same file") == other.expect("a file"), "{} differs", name.display());
    }
}
