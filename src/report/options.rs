//! Contents of a report in addition to the recording.

use std::path::PathBuf;

use crate::log_check::CheckReport;

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReportFigure {
    /// Heading above the figure, once for consecutive figures with the same heading.
    pub heading: String,
    /// Content, run and time; the page adds the number of the figure.
    pub title: String,
    /// Legend: colours, dashes, units.
    pub reading: String,
    /// True for a figure of half the width of the page, beside the next one of that width.
    pub half: bool,
    pub drawing: ReportDrawing,
}

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
    pub command: String,
    /// Input files, listed with their hashes.
    pub inputs: Vec<PathBuf>,
    /// Figures in the order of the page.
    pub figures: Vec<ReportFigure>,
    /// Findings of `check` about the log and its rig.
    pub check: Option<CheckReport>,
}
