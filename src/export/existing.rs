//! Existing output: files that a run may overwrite.
//!
//! Results are replaced without `--force` only by results of the same command for the same log. The folder of a run
//! must contain only such files; `report` and `calibrate` check only files with their own names.

use std::ffi::OsStr;
use std::fs;
use std::io::Read as _;
use std::path::Path;

use serde_json::Value;

use super::calibration_files::TRAJECTORY_FILES;
use super::error::ExportError;
use super::masks::is_mask_name;
use super::posterior::POSTERIOR;
use super::stills_files::STILLS_FILES;
use crate::files::output;
use crate::flight_log::FlightLog;
use crate::text::{log_name, shortened};

/// Names of all files that a run can write.
pub(crate) const RUN_FILES: [&str; 11] = [
    "summary.json",
    "trajectory.tum",
    "covariance.csv",
    "calibration.csv",
    "rank.csv",
    "information.csv",
    "frames.csv",
    "rig.yaml",
    POSTERIOR,
    "trajectory.euroc.csv",
    "results.mcap",
];
const REPORT_FILES: [&str; 2] = ["report.json", "report.html"];
const CALIBRATION_FILES: [&str; 7] = [
    "calibration.json",
    "rig.yaml",
    POSTERIOR,
    "report.txt",
    TRAJECTORY_FILES[0],
    TRAJECTORY_FILES[1],
    TRAJECTORY_FILES[2],
];
/// Size limit of a file that is read for the name of its log.
const LARGEST_INDEX_BYTES: u64 = 64 << 20;

/// Checks that the results of runs on a log may be written into the folders of their labels, below `folder`.
///
/// # Errors
/// If a folder cannot be written or, without `force`, contains anything other than a run on the same log.
pub fn check_run_folders(folder: &Path, labels: &[&str], log: &Path, force: bool) -> Result<(), ExportError> {
    output::check_folder(folder).map_err(ExportError::write(folder))?;
    for label in labels {
        let folder = folder.join(label);
        output::check_folder(&folder).map_err(ExportError::write(&folder))?;
        if !force {
            check_run_folder(&folder, &log_name(log))?;
        }
    }
    Ok(())
}

/// Checks that a report and its runs may be written into a folder.
///
/// # Errors
/// As [`check_run_folders`], and for another log's report in the folder.
pub fn check_report_folder(folder: &Path, labels: &[&str], log: &Path, force: bool) -> Result<(), ExportError> {
    check_run_folders(folder, labels, log, force)?;
    if force { Ok(()) } else { check_files(folder, &REPORT_FILES, &log_name(log)) }
}

/// Checks that an offline calibration may be written into a folder.
///
/// # Errors
/// As [`check_run_folders`], and for another log's calibration, or a rig, in the folder.
pub fn check_calibration_folder(folder: &Path, log: &Path, force: bool) -> Result<(), ExportError> {
    output::check_folder(folder).map_err(ExportError::write(folder))?;
    if force { Ok(()) } else { check_files(folder, &CALIBRATION_FILES, &log_name(log)) }
}

/// Checks that a calibration from stills may be written into a folder.
///
/// # Errors
/// As [`check_calibration_folder`].
pub fn check_stills_folder(folder: &Path, stills: &Path, force: bool) -> Result<(), ExportError> {
    output::check_folder(folder).map_err(ExportError::write(folder))?;
    if force { Ok(()) } else { check_files(folder, &STILLS_FILES, &log_name(stills)) }
}

/// Checks that `simulate` may write a log and its rigs: an existing log must be a simulation of the same experiment,
/// and its rigs must be unmodified.
///
/// # Errors
/// If a file cannot be written or, without `force`, is something else.
pub fn check_simulated_log(log: &Path, force: bool) -> Result<(), ExportError> {
    output::check_file(log).map_err(ExportError::write(log))?;
    let beside = ["rig.yaml", "truth.yaml"].map(|ending| (format!(".{ending}"), log.with_extension(ending)));
    for (_, path) in &beside {
        output::check_file(path).map_err(ExportError::write(path))?;
    }
    if force {
        return Ok(());
    }
    let existing =
        |problem: &str, path: &Path| ExportError::Existing { problem: problem.to_owned(), path: path.to_owned() };
    let simulated = if log.exists() {
        let simulated = (writer_of(log) == Some(LogOrigin::Simulation)).then(|| FlightLog::open(log).ok()).flatten();
        Some(simulated.ok_or_else(|| existing("the file exists and is not a simulated log", log))?)
    } else {
        None
    };
    for (ending, path) in &beside {
        let Ok(text) = fs::read(path) else { continue };
        let written = simulated.as_ref().and_then(|log| log.attachment(ending));
        if written.is_none_or(|(_, content)| content != text) {
            return Err(existing("the rig exists and is not as 'dcvins simulate' wrote it", path));
        }
    }
    Ok(())
}

/// Checks that `convert` may write a log: an existing file must be a log that this program has written, and not a
/// simulation.
///
/// # Errors
/// If the file cannot be written or, without `force`, is something else.
pub fn check_converted_log(log: &Path, force: bool) -> Result<(), ExportError> {
    output::check_file(log).map_err(ExportError::write(log))?;
    if force || !log.exists() || writer_of(log) == Some(LogOrigin::Other) {
        return Ok(());
    }
    let problem = "the file exists and was not written by 'dcvins convert'".to_owned();
    Err(ExportError::Existing { problem, path: log.to_owned() })
}

/// Writes the text of a new rig; an existing file is only replaced with `force`.
///
/// # Errors
/// If the file cannot be written or, without `force`, exists.
pub fn write_new_rig(path: &Path, text: &str, force: bool) -> Result<(), ExportError> {
    output::check_file(path).map_err(ExportError::write(path))?;
    if !force && path.exists() {
        return Err(ExportError::Existing { problem: "the rig exists".to_owned(), path: path.to_owned() });
    }
    let staged = output::StagedFile::with_content(path, text.as_bytes()).map_err(ExportError::write(path))?;
    staged.commit().map_err(ExportError::write(path))
}

/// Origin of a log written by this program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum LogOrigin {
    Simulation,
    Other,
}

/// Origin of a log according to its first bytes: the header names the program, and the metadata marks a simulation.
/// `None` for files of other programs.
fn writer_of(log: &Path) -> Option<LogOrigin> {
    const START_BYTES: u64 = 512;
    let mut start = Vec::new();
    fs::File::open(log).ok()?.take(START_BYTES).read_to_end(&mut start).ok()?;
    let holds = |text: &[u8]| start.windows(text.len()).any(|bytes| bytes == text);
    if !start.starts_with(b"\x89MCAP") || !holds(b"dcvins ") {
        return None;
    }
    Some(if holds(b"dcvins simulate") { LogOrigin::Simulation } else { LogOrigin::Other })
}

/// Checks that a screenshot or table may be written: an existing file must have the same format.
///
/// # Errors
/// If the file cannot be written or, without `force`, is something else.
pub fn check_screenshot(path: &Path, force: bool) -> Result<(), ExportError> {
    let folder = output::folder_of(path);
    output::check_folder(&folder).map_err(ExportError::write(&folder))?;
    if !path.exists() {
        return Ok(());
    }
    output::check_file(path).map_err(ExportError::write(path))?;
    let mut start = Vec::new();
    let file = fs::File::open(path).map_err(|source| ExportError::Read { source, path: path.to_owned() })?;
    file.take(16).read_to_end(&mut start).map_err(|source| ExportError::Read { source, path: path.to_owned() })?;
    let text = || String::from_utf8_lossy(&start).trim_start().to_owned();
    let extension = path.extension().and_then(OsStr::to_str).unwrap_or_default().to_ascii_lowercase();
    let same = match extension.as_str() {
        // Other programs write PDFs too.
        "pdf" => start.is_empty() || is_own_pdf(path)?,
        "csv" => std::str::from_utf8(&start).is_ok_and(|text| text.contains(['_', ','])),
        _ => {
            start.is_empty()
                || start.starts_with(b"\x89PNG")
                || text().starts_with("<svg")
                || text().starts_with("<?xml")
        }
    };
    if force || same {
        return Ok(());
    }
    Err(ExportError::Existing {
        problem: "the file exists and is not a screenshot or table".to_owned(),
        path: path.to_owned(),
    })
}

/// True for a PDF whose creator is this program.
fn is_own_pdf(path: &Path) -> Result<bool, ExportError> {
    /// Largest part of a file that is searched; figures are smaller.
    const MAX_BYTES: u64 = 64 << 20;
    let read = |source| ExportError::Read { source, path: path.to_owned() };
    let mut bytes = Vec::new();
    fs::File::open(path).map_err(read)?.take(MAX_BYTES).read_to_end(&mut bytes).map_err(read)?;
    let creator = b"/Creator (dcvins ";
    Ok(bytes.starts_with(b"%PDF") && bytes.windows(creator.len()).any(|part| part == creator))
}

/// Labels of runs in a folder other than the given ones, in alphabetical order.
pub fn other_runs(folder: &Path, labels: &[&str]) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok);
    let names = entries.filter(|entry| entry.path().join(RUN_FILES[0]).is_file()).map(|entry| entry.file_name());
    let mut names: Vec<String> = names.map(|name| name.to_string_lossy().into_owned()).collect();
    names.retain(|name| !labels.contains(&name.as_str()));
    names.sort();
    names
}

/// A folder of a run must hold nothing, or a run on this log and nothing else.
pub(crate) fn check_run_folder(folder: &Path, log: &str) -> Result<(), ExportError> {
    let existing = |problem: String| ExportError::Existing { problem, path: folder.to_owned() };
    for entry in fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok) {
        let name = entry.file_name();
        let ours =
            name.to_str().is_some_and(|name| RUN_FILES.contains(&name) || is_mask_name(name)) && entry.path().is_file();
        if !ours && !output::is_temporary(&name) {
            let name = name.to_string_lossy();
            return Err(existing(format!(
                "the folder of the run holds '{}', which no run writes",
                shortened(&name, 80)
            )));
        }
    }
    check_files(folder, &RUN_FILES, log)
}

/// If one of the files exists, the first one must exist and name the log.
fn check_files(folder: &Path, names: &[&str], log: &str) -> Result<(), ExportError> {
    let existing = |problem: String| Err(ExportError::Existing { problem, path: folder.to_owned() });
    let Some(found) = names.iter().find(|name| folder.join(name).exists()) else { return Ok(()) };
    let index = names[0];
    match log_of(&folder.join(index)) {
        Some(other) if other == log => Ok(()),
        Some(other) => existing(format!("the folder holds results of the log '{}'", shortened(&other, 80))),
        None => existing(format!("the folder holds '{found}' and no {index} that names its log")),
    }
}

/// Name of the log or of the stills in an index file of results.
fn log_of(index: &Path) -> Option<String> {
    let value = read_index(index)?;
    value.get("log").or_else(|| value.get("stills")).and_then(Value::as_str).map(str::to_owned)
}

/// A JSON file of results.
pub(crate) fn read_index(index: &Path) -> Option<Value> {
    let file = fs::File::open(index).ok()?;
    let mut text = String::new();
    file.take(LARGEST_INDEX_BYTES).read_to_string(&mut text).ok()?;
    serde_json::from_str(&text).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn problem(result: Result<(), ExportError>) -> String {
        result.unwrap_err().to_string()
    }

    #[test]
    fn only_runs_on_the_same_log_are_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let (out, log) = (folder.path(), Path::new("a/flight.mcap"));
        let check = |force| check_run_folders(out, &["auto"], log, force);
        check(false).unwrap();
        let run = out.join("auto");
        fs::create_dir(&run).unwrap();
        check(false).unwrap();
        fs::write(run.join("rig.yaml"), "rig_version: 1").unwrap();
        assert!(problem(check(false)).starts_with("the folder holds 'rig.yaml' and no summary.json"));
        fs::write(run.join("summary.json"), r#"{"log": "flight.mcap"}"#).unwrap();
        fs::write(run.join(".rank.csv.dcvins-abc123.tmp"), "left").unwrap();
        check(false).unwrap();
        let other = check_run_folders(out, &["auto"], Path::new("other.mcap"), false);
        assert!(problem(other).starts_with("the folder holds results of the log 'flight.mcap'; give --force"));
        fs::write(run.join("notes.txt"), "mine").unwrap();
        assert!(problem(check(false)).contains("holds 'notes.txt', which no run writes"));
        check(true).unwrap();
        assert_eq!(other_runs(out, &[]), ["auto"]);
        assert!(other_runs(out, &["auto"]).is_empty());
    }

    #[test]
    fn a_rig_that_lies_in_the_folder_of_a_calibration_stays() {
        let folder = tempfile::tempdir().unwrap();
        let check = |force| check_calibration_folder(folder.path(), Path::new("flight.mcap"), force);
        fs::write(folder.path().join("other.txt"), "mine").unwrap();
        check(false).unwrap();
        fs::write(folder.path().join("rig.yaml"), "rig_version: 1").unwrap();
        assert!(problem(check(false)).contains("holds 'rig.yaml' and no calibration.json"));
        check(true).unwrap();
    }

    #[test]
    fn screenshots_replace_screenshots() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("flight.mcap");
        check_screenshot(&path, false).unwrap();
        fs::write(&path, b"\x89MCAP0\r\n").unwrap();
        assert!(problem(check_screenshot(&path, false)).starts_with("the file exists and is not a screenshot"));
        check_screenshot(&path, true).unwrap();
        fs::write(&path, b"\x89PNG\r\n").unwrap();
        check_screenshot(&path, false).unwrap();
        assert!(problem(check_screenshot(folder.path(), true)).contains("it is a folder"));
    }
}
