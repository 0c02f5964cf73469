//! The figures of a report with their captions.

use std::sync::Arc;

use anyhow::Result;
use dcvins::export::{ScreenshotOptions, draw_panel, draw_panel_svg, png_bytes};
use dcvins::flight_log::ImageReader;
use dcvins::geometry::{ns_from_seconds, seconds_from_ns};
use dcvins::gimbal::ParameterId;
use dcvins::gui::comparison::ComparisonView;
use dcvins::gui::theme::ThemeName;
use dcvins::gui::window::{FigureContent, FigureText, figure_height};
use dcvins::gui::{PanelName, Presentation};
use dcvins::report::{ReportDrawing, ReportFigure};
use dcvins::session::{Computation, Recording, SessionPlan};
use dcvins::text::Named as _;

use super::terminal::Progress;

/// Width of every figure in points. Printed 170 mm wide, text of 11 points is then 2.6 mm high.
const WIDTH: u32 = 720;
/// Pixels per point of images and of the scene: 215 dpi in print.
const PIXELS_PER_POINT: u32 = 2;
/// Largest height of a figure in points, 203 mm in print: a page of A4 or Letter with the caption.
const MAX_HEIGHT: f32 = 860.0;
/// Number of runs up to which each has its own figures of parameters and ranks.
const FEW_RUNS: usize = 2;

struct Wanted {
    panel: PanelName,
    /// View of the comparison.
    view: Option<ComparisonView>,
    run: usize,
    height: u32,
    /// True for half the width of the page.
    half: bool,
    text: FigureText,
}

impl Wanted {
    /// True if the figure is drawn as SVG; images and the scene are drawn as pixels.
    fn is_plot(&self) -> bool {
        !matches!(self.panel, PanelName::Image | PanelName::Scene)
    }
}

/// Draws the figures of a report: figures of the whole log, then figures at each of the times `at_s` in seconds, or at the
/// end of the log without any.
pub(crate) fn draw(at_s: &[f64], plan: &SessionPlan, computation: &mut Computation) -> Result<Vec<ReportFigure>> {
    let mut images = ImageReader::new(Arc::clone(&plan.log), &plan.rig);
    let end_ns = computation.recording().last_stamp_ns();
    let stamps_ns: Vec<i64> = at_s.iter().map(|at_s| ns_from_seconds(*at_s).min(end_ns)).collect();
    let stamps_ns = if stamps_ns.is_empty() { vec![end_ns] } else { stamps_ns };
    let whole = whole_log(computation.recording(), end_ns);
    let mut groups = vec![("Over the whole log".to_owned(), end_ns, whole)];
    for cursor_ns in stamps_ns {
        computation.fill_in(cursor_ns);
        let heading = format!("At {:.2} s", seconds_from_ns(cursor_ns));
        groups.push((heading, cursor_ns, at_stamp(computation.recording(), cursor_ns)));
    }
    let count: usize = groups.iter().map(|(.., wanted)| wanted.len()).sum();
    let progress = Progress::new();
    let mut figures = Vec::new();
    for (heading, cursor_ns, wanted) in groups {
        computation.fill_in(cursor_ns);
        let recording = computation.recording();
        for figure in wanted {
            let panel = figure.panel.name();
            progress.show(figures.len() as f64 / count as f64, || format!("drawing {panel}"));
            let scale = if figure.is_plot() { 1 } else { PIXELS_PER_POINT };
            let width = if figure.half { WIDTH / 2 } else { WIDTH };
            let options = ScreenshotOptions {
                size_px: [width * scale, figure.height * scale],
                view: figure.view,
                pixels_per_point: scale as f32,
                theme: ThemeName::Print,
                run: figure.run,
                presentation: Presentation::FigureOfReport,
                ..ScreenshotOptions::default()
            };
            let drawing = if figure.is_plot() {
                let prefix = format!("clip{}-", figures.len());
                let names = [prefix.as_str(), figure.text.title.as_str()];
                ReportDrawing::Svg(draw_panel_svg(panel, recording, cursor_ns, &mut images, &options, names)?)
            } else {
                ReportDrawing::Png(png_bytes(&draw_panel(panel, recording, cursor_ns, &mut images, &options)?)?)
            };
            let Wanted { text: FigureText { title, reading }, half, .. } = figure;
            figures.push(ReportFigure { heading: heading.clone(), title, reading, half, drawing });
        }
    }
    Ok(figures)
}

/// A figure with its text and its height.
fn wanted(recording: &Recording, panel: PanelName, view: Option<ComparisonView>, run: usize, cursor_ns: i64) -> Wanted {
    let content = FigureContent { panel, view, recording, run, range_ns: (0, recording.last_stamp_ns()), cursor_ns };
    let half = matches!(panel, PanelName::Image | PanelName::Scene);
    let width = if half { WIDTH / 2 } else { WIDTH };
    let height = figure_height(&content, Presentation::FigureOfReport, width as f32).min(MAX_HEIGHT) as u32;
    Wanted { panel, view, run, height, half, text: FigureText::of(&content) }
}

/// Figures of the whole log, with the values at its end.
fn whole_log(recording: &Recording, end_ns: i64) -> Vec<Wanted> {
    let mut figures = Vec::new();
    if recording.runs.iter().any(|run| !run.pose_errors().is_empty()) {
        figures.push(wanted(recording, PanelName::Comparison, Some(ComparisonView::Errors), 0, end_ns));
    }
    let mut first: Option<&str> = None;
    let mut drawn: Vec<ParameterId> = Vec::new();
    for (run, record) in recording.runs.iter().enumerate() {
        let parameters = record.steps.last().map_or(&[][..], |step| &step.report.calibration.parameters);
        // Plots have the values of all runs; of many runs only those without any plot get another figure.
        let is_drawn = parameters.iter().any(|parameter| drawn.contains(parameter));
        if parameters.is_empty() || recording.runs.len() > FEW_RUNS && is_drawn {
            continue;
        }
        drawn.extend(parameters);
        let mut figure = wanted(recording, PanelName::Convergence, None, run, end_ns);
        match first {
            Some(earlier) => {
                figure.text.reading = format!(
                    "Axes, hatching and strips as in the figure of run {earlier}. Band: ±3σ of run {}. Above each plot: \
                     value and σ at {:.2} s.",
                    record.spec.label,
                    seconds_from_ns(end_ns)
                );
            }
            None => first = Some(&record.spec.label),
        }
        figures.push(figure);
    }
    figures.push(wanted(recording, PanelName::Timeline, None, 0, end_ns));
    figures
}

/// Figures of one stamp.
fn at_stamp(recording: &Recording, cursor_ns: i64) -> Vec<Wanted> {
    let mut figures = Vec::new();
    let mut cameras: Vec<&str> = Vec::new();
    for (run, record) in recording.runs.iter().enumerate() {
        if cameras.contains(&record.camera_key.as_str()) || run > 0 && recording.runs.len() > FEW_RUNS {
            continue;
        }
        cameras.push(&record.camera_key);
        figures.push(wanted(recording, PanelName::Image, None, run, cursor_ns));
    }
    let mut scene = wanted(recording, PanelName::Scene, None, 0, cursor_ns);
    // Beside an image both have one height.
    scene.height = figures.last().map_or(scene.height, |image| image.height);
    figures.push(scene);
    figures.push(wanted(recording, PanelName::Residuals, None, 0, cursor_ns));
    let mut first: Option<&str> = None;
    // Of many runs, the table of results has the ranks.
    let ranked_runs = if recording.runs.len() > FEW_RUNS { 1 } else { FEW_RUNS };
    for (run, record) in recording.runs.iter().enumerate().take(ranked_runs) {
        let ranked = record.step_at(cursor_ns).and_then(|step| step.rank.as_ref());
        if ranked.is_none_or(|rank| rank.parameters.is_empty()) {
            continue;
        }
        let mut figure = wanted(recording, PanelName::Rank, None, run, cursor_ns);
        match first {
            Some(earlier) => {
                figure.text.reading = format!(
                    "Directions, weights, singular values and ranks as in the figure of run {earlier}, here of run {}.",
                    record.spec.label
                );
            }
            None => first = Some(&record.spec.label),
        }
        figures.push(figure);
    }
    figures
}
