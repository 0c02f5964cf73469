//! `dcvins report`: one HTML file with all figures and tables, and CSV and JSON files.
//!
//! The same log, rig, runs and command give the same bytes: the report contains no dates and no measured times.

mod content;
mod html;
mod inputs;
mod observability;
mod page;
mod rank_intervals;
mod study;
mod tables;

use std::fs;
use std::path::{Path, PathBuf};

pub use self::content::{ReportDrawing, ReportFigure, ReportOptions};
use content::ReportContent;
use inputs::InputFile;
use serde_json::Value;
pub use study::{StudyReport, check_study_report, write_study_report};

use crate::export::existing::{RUN_FILES, check_run_folder, read_index};
use crate::export::folder_files::json_text;
use crate::export::run_files::{remove_unwritten, stage_run};
use crate::export::{CachedFile, ExportError, RunFileOptions};
use crate::files::output::OutputSet;
use crate::session::Recording;

/// The files of each run, without measured times.
const RUN_OPTIONS: RunFileOptions = RunFileOptions { timing: false, mcap: false, euroc_trajectory: false };

/// Writes `report.html`, `report.json` and a folder for each run as `run --no-timing` does; returns the paths of all
/// files, with the HTML file last.
///
/// # Errors
/// If a file cannot be read or written.
pub fn write_report(
    recording: &Recording,
    folder: &Path,
    options: &ReportOptions,
) -> Result<Vec<PathBuf>, ExportError> {
    fs::create_dir_all(folder).map_err(ExportError::write(folder))?;
    let mut outputs = OutputSet::default();
    let mut summaries = Vec::new();
    for run in &recording.runs {
        let (_, summary) = stage_run(recording, run, folder, RUN_OPTIONS, &mut outputs)?;
        summaries.push(summary);
    }
    let inputs = options.inputs.iter().map(|path| InputFile::read(path)).collect::<Result<Vec<_>, _>>()?;
    let content = ReportContent::new(recording, summaries, inputs, options);
    let json_path = folder.join("report.json");
    let earlier_runs = labels_in(&json_path);
    let json = json_text(&content, &json_path)?;
    outputs.write(&json_path, json.as_bytes()).map_err(ExportError::write(&json_path))?;
    let path = folder.join("report.html");
    let page = page::page(&content, &options.figures);
    outputs.write(&path, page.as_bytes()).map_err(ExportError::write(&path))?;
    let paths = outputs.paths();
    outputs.commit().map_err(ExportError::commit)?;
    let labels: Vec<&str> = recording.runs.iter().map(|run| run.spec.label.as_str()).collect();
    remove_earlier(folder, (&labels, &earlier_runs), &paths, &content.log)?;
    Ok(paths)
}

/// Writes the files of a report from the cache, given by paths relative to the folder with their contents, for runs
/// with these labels; otherwise as [`write_report`].
///
/// # Errors
/// If a file cannot be written.
pub fn write_known_report(
    files: &[CachedFile],
    folder: &Path,
    labels: &[&str],
    log: &str,
) -> Result<Vec<PathBuf>, ExportError> {
    let earlier_runs = labels_in(&folder.join("report.json"));
    let mut outputs = OutputSet::default();
    for (name, content) in files {
        let path = folder.join(name);
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(ExportError::write(folder))?;
        }
        outputs.write(&path, content).map_err(ExportError::write(&path))?;
    }
    let paths = outputs.paths();
    outputs.commit().map_err(ExportError::commit)?;
    remove_earlier(folder, (labels, &earlier_runs), &paths, log)?;
    Ok(paths)
}

/// Removes files of an earlier report that are not part of this one, which has the files `written` and runs with the first
/// labels.
fn remove_earlier(
    folder: &Path,
    (labels, earlier_runs): (&[&str], &[String]),
    written: &[PathBuf],
    log: &str,
) -> Result<(), ExportError> {
    for label in labels {
        remove_unwritten(&folder.join(label), written)?;
    }
    for label in earlier_runs.iter().filter(|label| !labels.contains(&label.as_str())) {
        remove_run(&folder.join(label), log)?;
    }
    Ok(())
}

/// Labels of the runs of an earlier report, as far as they are plain folder names.
fn labels_in(json: &Path) -> Vec<String> {
    let report = read_index(json).unwrap_or_default();
    let runs = report.get("runs").and_then(Value::as_array).into_iter().flatten();
    let labels = runs.filter_map(|run| run.get("label")?.as_str()).map(str::to_owned);
    labels.filter(|label| is_folder_name(label)).collect()
}

fn is_folder_name(label: &str) -> bool {
    let plain = |letter: char| letter.is_ascii_alphanumeric() || "-_.".contains(letter);
    !label.trim_matches('.').is_empty() && label.chars().all(plain)
}

/// Removes the folder of a run of the earlier report, unless it contains anything else.
fn remove_run(folder: &Path, log: &str) -> Result<(), ExportError> {
    if !folder.is_dir() || check_run_folder(folder, log).is_err() {
        return Ok(());
    }
    for name in RUN_FILES {
        let path = folder.join(name);
        if path.is_file() {
            fs::remove_file(&path).map_err(ExportError::write(&path))?;
        }
    }
    // Removes the folder only if it is empty.
    drop(fs::remove_dir(folder));
    Ok(())
}
