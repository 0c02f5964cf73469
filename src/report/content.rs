//! The content of a report as data, and the options that add to it: `report.json`, and the input of the HTML page.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::Serialize;

use super::inputs::InputFile;
use super::observability::{Observability, observability};
use super::rank_intervals::{RankInterval, rank_intervals};
use crate::geometry::{median, seconds_from_ns};
use crate::log_check::CheckReport;
use crate::session::{PoseError, Recording, RunRecord, RunSummary, WarningLine, log_warning_lines};
use crate::table::Medium::Page;
use crate::text::log_name;

/// A notable event of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct ReportEvent {
    /// Stamp of its first frame, in seconds since the log began.
    pub(super) time_s: f64,
    pub(super) kind: String,
    /// Reason in one sentence.
    pub(super) message: String,
    /// Number of consecutive frames with the event.
    pub(super) times: usize,
}

impl ReportEvent {
    /// For example `2.60 s, initialized from motion: 118 landmarks`.
    pub(super) fn sentence(&self) -> String {
        let times = if self.times > 1 { format!(" ({} consecutive frames)", self.times) } else { String::new() };
        format!("{} s, {}: {}{times}", Page.fixed(self.time_s, 2), self.kind, self.message)
    }
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct RunContent {
    pub(super) label: String,
    /// `None` without a rank analysis.
    pub(super) observability: Option<Observability>,
    pub(super) summary: RunSummary,
    /// Standard deviation of the last position in metres, relative to the first estimated frame.
    pub(super) position_sigma_m: Option<f64>,
    /// Mean squared error over covariance of the poses (NEES), 6 when consistent; `None` without ground truth.
    pub(super) nees: Option<f64>,
    /// Median over the frames of the RMS of the reprojection residuals after the solve.
    pub(super) reprojection_px: Option<f64>,
    #[serde(rename = "rank_story")]
    pub(super) rank_intervals: Vec<RankInterval>,
    pub(super) events: Vec<ReportEvent>,
    /// Counts of the frequent kinds of events.
    pub(super) frequent_events: BTreeMap<String, usize>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct ReportContent {
    /// Name and version of this program.
    pub(super) program: &'static str,
    pub(super) command: String,
    pub(super) log: String,
    pub(super) rig: String,
    /// Length of the log in seconds.
    pub(super) duration_s: f64,
    /// Input files with their hashes.
    pub(super) inputs: Vec<InputFile>,
    /// True if the errors are distances to a batch reference.
    #[serde(skip)]
    pub(super) truth_is_batch: bool,
    /// Runs in the order of the command line.
    pub(super) runs: Vec<RunContent>,
    /// Findings about the log and its rig, as printed by `check --json`.
    pub(super) check: Option<CheckReport>,
    pub(super) log_warnings: Vec<String>,
}

impl ReportContent {
    /// Collects the content of a recording; `summaries` has one summary per run, in order.
    pub(super) fn new(
        recording: &Recording,
        summaries: Vec<RunSummary>,
        inputs: Vec<InputFile>,
        options: &ReportOptions,
    ) -> Self {
        let runs = recording.runs.iter().zip(summaries).map(|(run, summary)| {
            let (events, frequent_events) = events(run);
            RunContent {
                label: run.spec.label.clone(),
                observability: observability(recording, run, &summary.answer),
                position_sigma_m: last_position_sigma_m(run),
                nees: PoseError::mean_nees(&run.pose_errors()),
                reprojection_px: reprojection_px(run),
                summary,
                rank_intervals: rank_intervals(run, &recording.rig),
                events,
                frequent_events,
            }
        });
        let log_warnings: Vec<String> =
            log_warning_lines(&recording.warnings).iter().map(WarningLine::with_time).collect();
        Self {
            program: concat!("dcvins ", env!("CARGO_PKG_VERSION")),
            command: options.command.clone(),
            log: log_name(&recording.log_path),
            rig: recording.rig.name.clone(),
            duration_s: seconds_from_ns(recording.duration_ns),
            inputs,
            truth_is_batch: recording.truth_is_batch,
            runs: runs.collect(),
            check: options.check.clone(),
            log_warnings,
        }
    }
}

/// Standard deviation of the last position with a covariance, in metres.
fn last_position_sigma_m(run: &RunRecord) -> Option<f64> {
    let covariance = run.steps.iter().rev().find_map(|step| step.report.newest_pose_covariance)?;
    Some(covariance.position_sigma_m())
}

fn reprojection_px(run: &RunRecord) -> Option<f64> {
    let estimated = run.steps.iter().filter(|step| step.report.newest().is_some());
    median(estimated.map(|step| step.report.reprojection_rms_after_px).filter(|px| px.is_finite()))
}

/// Notable events, equal ones of consecutive frames merged, and the counts of the others by kind.
fn events(run: &RunRecord) -> (Vec<ReportEvent>, BTreeMap<String, usize>) {
    let mut notable: Vec<ReportEvent> = Vec::new();
    let mut frequent = BTreeMap::new();
    // By kind: index of its last frame, and its index in `notable`.
    let mut latest: BTreeMap<String, (usize, usize)> = BTreeMap::new();
    for (number, step) in run.steps.iter().enumerate() {
        for event in &step.report.events {
            let kind = words(&format!("{:?}", event.kind));
            if !event.kind.is_notable() {
                *frequent.entry(kind).or_default() += 1;
                continue;
            }
            let before = latest.get(&kind).filter(|(frame, _)| frame + 1 >= number).map(|(_, place)| *place);
            let place = before.unwrap_or(notable.len());
            match notable.get_mut(place) {
                Some(known) => known.times += 1,
                None => notable.push(ReportEvent {
                    time_s: seconds_from_ns(step.report.stamp_ns),
                    kind: kind.clone(),
                    message: event.message.clone(),
                    times: 1,
                }),
            }
            latest.insert(kind, (number, place));
        }
    }
    (notable, frequent)
}

/// Converts `InitializedFromMotion` to `initialized from motion`.
fn words(name: &str) -> String {
    let mut words = String::new();
    for letter in name.chars() {
        if letter.is_ascii_uppercase() && !words.is_empty() {
            words.push(' ');
        }
        words.push(letter.to_ascii_lowercase());
    }
    words
}

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

#[cfg(test)]
mod tests {
    use super::words;

    #[test]
    fn kinds_of_events_are_written_as_words() {
        assert_eq!(words("InitializedFromMotion"), "initialized from motion");
        assert_eq!(words("Failure"), "failure");
    }
}
