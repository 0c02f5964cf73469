//! `dcvins report`: one HTML file with all figures and tables, with CSV and JSON beside it.
//!
//! The same log, rig, runs and command give the same bytes: it contains no dates and no measured times.

mod content;
mod html;
mod inputs;
mod page;
mod rank_intervals;
mod tables;

use std::fs;
use std::path::{Path, PathBuf};

use content::ReportContent;
use inputs::InputFile;
use rank_intervals::RankInterval;

use super::error::ExportError;
use super::run_files::{RunFileOptions, write_run};
use crate::log_check::CheckReport;
use crate::session::Recording;

/// A figure of a report.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReportFigure {
    /// Heading above it; consecutive figures with the same heading share it.
    pub heading: String,
    /// Caption below it.
    pub caption: String,
    /// Its drawing.
    pub drawing: ReportDrawing,
}

/// The drawing of a figure.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ReportDrawing {
    /// A PNG file, for images and the 3D scene.
    Png(Vec<u8>),
    /// An SVG, for plots; the prefix of its element ids is unique in the report.
    Svg(String),
}

/// Contents of a report in addition to the recording.
#[derive(Clone, Debug, PartialEq)]
pub struct ReportOptions {
    /// The command line.
    pub command: String,
    /// Input files, listed with their hashes.
    pub inputs: Vec<PathBuf>,
    /// Figures in the order of the page.
    pub figures: Vec<ReportFigure>,
    /// Findings of `check` about the log and its rig.
    pub check: Option<CheckReport>,
}

/// Writes `report.html`, `report.json` and a folder for each run as `run --no-timing` does; returns the HTML's path.
///
/// # Errors
/// When a file cannot be read or written.
pub fn write_report(recording: &Recording, folder: &Path, options: &ReportOptions) -> Result<PathBuf, ExportError> {
    fs::create_dir_all(folder).map_err(ExportError::write(folder))?;
    let run_options = RunFileOptions { timing: false, ..RunFileOptions::default() };
    let mut summaries = Vec::new();
    for run in &recording.runs {
        summaries.push(write_run(recording, run, folder, run_options)?.1);
    }
    let inputs = options.inputs.iter().map(|path| InputFile::read(path)).collect::<Result<Vec<_>, _>>()?;
    let content = ReportContent::new(recording, summaries, inputs, options);
    let json_path = folder.join("report.json");
    let json = serde_json::to_string_pretty(&content)
        .map_err(|source| ExportError::Write { source: source.into(), path: json_path.clone() })?;
    fs::write(&json_path, format!("{json}\n")).map_err(ExportError::write(&json_path))?;
    let path = folder.join("report.html");
    fs::write(&path, page::page(&content, &options.figures)).map_err(ExportError::write(&path))?;
    Ok(path)
}
