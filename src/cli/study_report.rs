//! `dcvins report` of a study: tables and figures of its panels.

use std::path::Path;
use std::sync::Arc;

use anyhow::{Result, anyhow};
use dcvins::export::{ScreenshotOptions, draw_study_panel, draw_study_panel_svg, png_bytes, study_panel_csv};
use dcvins::gui::study::{StudyOptions, StudyState};
use dcvins::gui::theme::ThemeName;
use dcvins::report::{ReportDrawing, ReportFigure, StudyReport, check_study_report, write_study_report};
use dcvins::sweep::OpenedStudy;

use crate::cli::terminal::{Progress, print};

/// Width of every figure in points.
const WIDTH: u32 = 720;
/// Pixels per point of figures drawn as pixels.
const PIXELS_PER_POINT: u32 = 2;
/// Number of runs from which on figures are drawn as pixels: a drawing with an element per run would be larger.
const MANY_RUNS: usize = 1500;
/// Heights in points of a figure with one strip per group: axis, and each strip.
const STRIPS: [u32; 2] = [70, 60];

/// A figure: panel, height, heading, title and explanation.
type Wanted = (&'static str, u32, &'static str, String, String);

/// Writes the report of a study into `output`.
pub(crate) fn study_report(
    study: &OpenedStudy,
    view: &StudyOptions,
    output: &Path,
    command: String,
    force: bool,
) -> Result<()> {
    let study = study.study();
    check_study_report(output, &study.name, force)?;
    let mut state = StudyState::new(Arc::clone(study), view).map_err(|problem| anyhow!(problem))?;
    let (shown, groups, parameters) = (state.shown_runs(), state.group_summaries(), state.parameter_errors());
    let options = state.options();
    let wanted = figures_of(&options, &state.metric_title(), groups.len(), !parameters.is_empty());
    let (progress, mut figures, mut tables) = (Progress::new(), Vec::new(), Vec::new());
    for (number, (panel, height, heading, title, reading)) in wanted.iter().enumerate() {
        progress.show(number as f64 / wanted.len() as f64, || format!("drawing {panel}"));
        let pixels = shown > MANY_RUNS;
        let scale = if pixels { PIXELS_PER_POINT } else { 1 };
        let drawing = ScreenshotOptions {
            size_px: [WIDTH * scale, height * scale],
            pixels_per_point: scale as f32,
            theme: ThemeName::Print,
            ..ScreenshotOptions::default()
        };
        let drawing = if pixels {
            ReportDrawing::Png(png_bytes(&draw_study_panel(panel, study, view, &drawing)?)?)
        } else {
            let prefix = format!("clip{number}-");
            ReportDrawing::Svg(draw_study_panel_svg(panel, study, view, &drawing, [&prefix, title])?)
        };
        let (heading, title, reading) = ((*heading).to_owned(), title.clone(), reading.clone());
        figures.push(ReportFigure { heading, title, reading, half: false, drawing });
        tables.push(((*panel).to_owned(), study_panel_csv(panel, study, view)?));
    }
    drop(progress);
    let report = StudyReport {
        study: study.name.clone(),
        runs: study.runs.rows(),
        shown,
        filter: options.filter.clone(),
        group: options.group.clone(),
        metric: state.metric_title(),
        reference: options.reference.clone(),
        success: options.success.clone().unwrap_or_default(),
        groups,
        parameters,
        command,
        program: concat!("dcvins ", env!("CARGO_PKG_VERSION")).to_owned(),
        figures,
        tables,
    };
    print(&format!("{}\n", write_study_report(&report, output)?.display()))
}

fn figures_of(options: &StudyOptions, metric: &str, groups: usize, parameters: bool) -> Vec<Wanted> {
    let height = |strips: usize| (STRIPS[0] + STRIPS[1] * strips as u32).clamp(160, 860);
    let by = options.group.as_ref().map(|group| format!(" by {group}")).unwrap_or_default();
    let mut wanted: Vec<Wanted> = vec![
        (
            "success",
            height(groups),
            "Success",
            format!("Success rate{by}"),
            "Dot: rate; bar: 95 % interval (Wilson).".to_owned(),
        ),
        (
            "distributions",
            height(groups),
            "Results",
            format!("{metric}{by}"),
            "Every run is a point; line: median; shaded: from the first to the third quartile.".to_owned(),
        ),
    ];
    if let Some(reference) = options.reference.as_ref().filter(|_| groups > 1) {
        wanted.push((
            "differences",
            height(groups - 1),
            "Results",
            format!("{metric}: differences to {reference}"),
            "Every point is a pair of runs on the same log, disturbance, perturbation and seed; dot and bar: mean \
             difference with its 95 % interval (Student's t)."
                .to_owned(),
        ));
    }
    wanted.push((
        "parallel",
        420,
        "Results",
        "All runs over their inputs and results".to_owned(),
        format!("Every run is a line; its colour is its value on the last axis, {metric}."),
    ));
    if parameters {
        wanted.push((
            "parameters",
            420,
            "Calibration",
            "Errors of the calibration parameters against their σ".to_owned(),
            "Left: RMS and mean of error over σ, runs within 1 σ and 3 σ. Right: the parameter whose error is largest \
             against its σ, each run a point, lines at 1 σ and 3 σ."
                .to_owned(),
        ));
    }
    wanted
}
