//! Legend of the runs and of the trajectories of other programs, with colours, dashes and accuracy.

use std::sync::Arc;

use egui::text::{LayoutJob, TextWrapping};
use egui::{Align2, Color32, Galley, Painter, Rect, Sense, Stroke, StrokeKind, TextStyle, Ui, WidgetInfo, pos2, vec2};

use crate::geometry::RigidTransform;
use crate::gui::PanelContext;
use crate::gui::comparison::POSES_ONLY;
use crate::gui::plot::paint_line;
use crate::gui::theme::{self, CURVE_WIDTH, RunStyle, Theme};
use crate::gui::under_pointer::{Item, offer_item};
use crate::gui::units::fixed;
use crate::session::accuracy::ErrorStatistics;
use crate::session::{RunRecord, StepRecord, TrajectoryLane};

/// Accuracy of one run, and the number of steps from which it was computed.
#[derive(Debug, Default)]
struct RunAccuracy {
    count: usize,
    last: Option<Arc<StepRecord>>,
    alignment: Option<RigidTransform>,
    statistics: Option<ErrorStatistics>,
}

/// State of the legend: the absolute trajectory error of each run, cached until the run has new steps.
#[derive(Debug, Default)]
pub struct RunLegend {
    runs: Vec<RunAccuracy>,
}

impl RunLegend {
    /// Widths in points of all entries, with and without the accuracies.
    pub(super) fn widths(&mut self, ui: &Ui, ctx: &PanelContext<'_>) -> [f32; 2] {
        self.update(ctx);
        [true, false].map(|accuracy| {
            let runs = ctx.recording.runs.iter().zip(&self.runs);
            let runs = runs.map(|(run, known)| (run.spec.label.as_str(), known.text()));
            let lanes = ctx.recording.trajectories.iter().map(|lane| (lane.label.as_str(), text_of_lane(lane)));
            let entries = runs.chain(lanes).map(|(label, text)| {
                let text = text.filter(|_| accuracy);
                Entry::new(ui, ctx, label, text, f32::INFINITY, ctx.theme.text).width + ui.spacing().item_spacing.x
            });
            entries.sum()
        })
    }

    /// Draws one entry per run, then one per trajectory, in a total `width`; a click selects the run. Long names are
    /// shortened.
    pub fn ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>, accuracy: bool, width: f32) {
        self.update(ctx);
        let count = (self.runs.len() + ctx.recording.trajectories.len()).max(1) as f32;
        let enough = self.widths(ui, ctx)[usize::from(!accuracy)] <= width + 0.5;
        let max_width = if enough { f32::INFINITY } else { width / count - ui.spacing().item_spacing.x };
        for (number, (run, known)) in ctx.recording.runs.iter().zip(&self.runs).enumerate() {
            entry_ui(ui, ctx, number, run, known, accuracy, max_width);
        }
        for (number, lane) in ctx.recording.trajectories.iter().enumerate() {
            lane_ui(ui, ctx, number, lane, accuracy, max_width);
        }
    }

    fn update(&mut self, ctx: &PanelContext<'_>) {
        self.runs.resize_with(ctx.recording.runs.len(), RunAccuracy::default);
        for (run, accuracy) in ctx.recording.runs.iter().zip(&mut self.runs) {
            accuracy.update(run);
        }
    }
}

impl RunAccuracy {
    /// Absolute trajectory error as text.
    fn text(&self) -> Option<String> {
        self.statistics.as_ref().map(|statistics| ate_text(statistics.rmse))
    }

    fn update(&mut self, run: &RunRecord) {
        let same = self.count == run.steps.len()
            && self.alignment == run.alignment
            && self.last.as_ref().map(Arc::as_ptr) == run.steps.last().map(Arc::as_ptr);
        if !same {
            self.count = run.steps.len();
            self.last = run.steps.last().cloned();
            self.alignment = run.alignment;
            self.statistics = ErrorStatistics::of(&run.position_errors_m());
        }
    }
}

fn ate_text(rmse_m: f64) -> String {
    format!("ATE {} m", fixed(rmse_m, 3))
}

/// Absolute trajectory error of a trajectory as text.
fn text_of_lane(lane: &TrajectoryLane) -> Option<String> {
    lane.evaluation.accuracy.as_ref().map(|accuracy| ate_text(accuracy.ate_rmse_m))
}

struct Entry {
    label: Arc<Galley>,
    accuracy: Option<Arc<Galley>>,
    width: f32,
}

impl Entry {
    /// Width of the sample of the line at the left, and the margin at the right, in points.
    const LINE: f32 = 34.0;
    const MARGIN: f32 = 6.0;

    fn new(
        ui: &Ui,
        ctx: &PanelContext<'_>,
        label: &str,
        accuracy: Option<String>,
        max_width: f32,
        color: Color32,
    ) -> Self {
        let font = TextStyle::Body.resolve(ui.style());
        let accuracy =
            accuracy.map(|text| ui.painter().layout_no_wrap(text, theme::number_font(), ctx.theme.text_weak));
        let beside = accuracy.as_ref().map_or(0.0, |galley| galley.size().x + Self::MARGIN);
        let room = (max_width - Self::LINE - Self::MARGIN - beside).max(12.0);
        let mut job = LayoutJob::simple_singleline(label.to_owned(), font, color);
        job.wrap = TextWrapping::truncate_at_width(room);
        let label = ui.painter().layout_job(job);
        let width = Self::LINE + label.size().x + beside + Self::MARGIN;
        Self { label, accuracy, width }
    }

    /// Paints a sample of the line, the label and the accuracy.
    fn paint(self, painter: &Painter, rect: Rect, theme: &Theme, style: RunStyle, text_color: Color32) {
        let middle = rect.center().y;
        let line = [pos2(rect.left() + 5.0, middle), pos2(rect.left() + 29.0, middle)];
        paint_line(painter, &line, style, CURVE_WIDTH + 0.5);
        let place = Align2::LEFT_CENTER.anchor_size(pos2(rect.left() + Self::LINE, middle), self.label.size());
        painter.galley(place.min, self.label, text_color);
        if let Some(galley) = self.accuracy {
            let place = Align2::LEFT_CENTER.anchor_size(pos2(place.right() + Self::MARGIN, middle), galley.size());
            painter.galley(place.min, galley, theme.text_weak);
        }
    }
}

/// Draws the entry of a run.
fn entry_ui(
    ui: &mut Ui,
    ctx: &mut PanelContext<'_>,
    number: usize,
    run: &RunRecord,
    known: &RunAccuracy,
    accuracy: bool,
    max_width: f32,
) {
    let theme = *ctx.theme;
    let shown = ctx.selection.run == number;
    let text_color = if shown { theme.text_strong } else { theme.text };
    let entry = Entry::new(ui, ctx, &run.spec.label, known.text().filter(|_| accuracy), max_width, text_color);
    let (rect, response) = ui.allocate_exact_size(vec2(entry.width, 22.0), Sense::click());
    let name = format!("Run {} {}", run.spec.label, known.text().unwrap_or_default());
    response.widget_info(|| WidgetInfo::selected(egui::Role::Button, true, shown, name.trim_end()));

    let painter = ui.painter_at(rect);
    if shown || response.hovered() {
        painter.rect_filled(rect, 3.0, theme.surface_raised);
    }
    if shown {
        painter.rect_stroke(rect, 3.0, Stroke::new(1.0, theme.run(number).color), StrokeKind::Inside);
    }
    entry.paint(&painter, rect, &theme, theme.run(number), text_color);

    if response.clicked() {
        ctx.selection.run = number;
    }
    if response.contains_pointer() {
        offer_item(ui, Item::Run(number));
    }
    // All steps are read only for an open tooltip.
    response.on_hover_ui(|ui| {
        ui.label(details(run, known.statistics.as_ref()));
    });
}

/// Draws the entry of a trajectory of another program; it cannot be selected, as it has no calibration and no features.
fn lane_ui(ui: &mut Ui, ctx: &PanelContext<'_>, number: usize, lane: &TrajectoryLane, accuracy: bool, max_width: f32) {
    let theme = *ctx.theme;
    let text = text_of_lane(lane);
    let name = format!("Trajectory {} {}", lane.label, text.as_deref().unwrap_or_default());
    let entry = Entry::new(ui, ctx, &lane.label, text.filter(|_| accuracy), max_width, theme.text);
    let (rect, response) = ui.allocate_exact_size(vec2(entry.width, 22.0), Sense::hover());
    response.widget_info(|| WidgetInfo::labeled(egui::Role::Label, true, name.trim_end()));
    entry.paint(&ui.painter_at(rect), rect, &theme, theme.trajectory(number), theme.text);
    let missing = lane.accuracy_missing.iter().map(String::as_str);
    let lines: Vec<&str> = [lane.source.as_str(), POSES_ONLY].into_iter().chain(missing).collect();
    response.on_hover_text(lines.join("\n"));
}

/// Specification and accuracy of a run.
fn details(run: &RunRecord, statistics: Option<&ErrorStatistics>) -> String {
    let mut lines = vec![format!("--run {}", run.spec), format!("camera {}", run.last_camera_keys().join(", "))];
    if let Some(origin) = &run.origin {
        let time_s = crate::geometry::seconds_from_ns(origin.stamp_ns);
        lines.push(format!("fork at {time_s:.3} s: {}", origin.changes));
    }
    if let Some(last) = run.steps.last() {
        lines.push(format!("parameterization {}", last.report.calibration.parameterization));
        if let Some(covariance) = last.report.newest_pose_covariance {
            let [position, attitude] = [covariance.position_sigma_m(), covariance.attitude_sigma_rad().to_degrees()];
            let [position, attitude] = [fixed(position, 3), fixed(attitude, 2)];
            lines.push(format!(
                "position ±{position} m, attitude ±{attitude}° (1σ, relative to the first estimated frame)"
            ));
        }
        let tracked = run.steps.iter().filter(|step| !step.report.window.is_empty()).count();
        lines.push(format!(
            "frames: {}, of these estimated: {tracked}, restarts: {}",
            run.steps.len(),
            last.report.restarts
        ));
    }
    if let Some(statistics) = statistics {
        let [rmse, mean, max] = [statistics.rmse, statistics.mean, statistics.max].map(|error| fixed(error, 3));
        lines.push(format!("absolute trajectory error (ATE): RMS {rmse} m, mean {mean} m, max {max} m"));
        lines.push("over the computed frames, aligned in yaw and position".to_owned());
    }
    if let Some(error) = &run.error {
        lines.push(error.clone());
    }
    lines.join("\n")
}
