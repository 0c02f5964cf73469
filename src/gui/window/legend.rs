//! The runs with their colours, dashes and accuracy.

use std::sync::Arc;

use egui::{Align2, Sense, Stroke, StrokeKind, Ui, WidgetInfo, pos2, vec2};

use crate::geometry::RigidTransform;
use crate::gui::PanelContext;
use crate::gui::plot::paint_line;
use crate::gui::theme::{self, CURVE_WIDTH};
use crate::gui::units::fixed;
use crate::session::accuracy::ErrorStatistics;
use crate::session::{Command, RunRecord, StepRecord};

/// The accuracy of one run, and the number of steps it was computed from.
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
    /// Draws one entry per run; a click selects the run.
    pub fn ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>) {
        let recording = ctx.recording;
        self.runs.resize_with(recording.runs.len(), RunAccuracy::default);
        for (number, (run, accuracy)) in recording.runs.iter().zip(&mut self.runs).enumerate() {
            accuracy.update(run);
            entry_ui(ui, ctx, number, run, accuracy.statistics.as_ref());
        }
    }
}

impl RunAccuracy {
    fn update(&mut self, run: &RunRecord) {
        let same = self.count == run.steps.len()
            && self.alignment == run.alignment
            && self.last.as_ref().map(Arc::as_ptr) == run.steps.last().map(Arc::as_ptr);
        if !same {
            self.count = run.steps.len();
            self.last = run.steps.last().cloned();
            self.alignment = run.alignment;
            self.statistics = run.alignment.and_then(|alignment| position_errors(run, &alignment));
        }
    }
}

/// Distances between aligned estimate and ground truth in metres, over the estimated frames.
fn position_errors(run: &RunRecord, alignment: &RigidTransform) -> Option<ErrorStatistics> {
    let errors_m: Vec<f64> = run
        .steps
        .iter()
        .filter_map(|step| {
            let estimate = alignment.transform(&step.report.newest()?.world_from_imu.translation_m);
            Some((estimate - step.ground_truth?.translation_m).norm())
        })
        .collect();
    ErrorStatistics::of(&errors_m)
}

fn entry_ui(
    ui: &mut Ui,
    ctx: &mut PanelContext<'_>,
    number: usize,
    run: &RunRecord,
    statistics: Option<&ErrorStatistics>,
) {
    let theme = *ctx.theme;
    let accuracy = statistics.map(|statistics| format!("ATE {} m", fixed(statistics.rmse, 3)));
    let shown = ctx.selection.run == number;
    let text_color = if shown { theme.text_strong } else { theme.text };
    let label = ui.painter().layout_no_wrap(run.spec.label.clone(), egui::FontId::proportional(12.5), text_color);
    let accuracy_label =
        ui.painter().layout_no_wrap(accuracy.clone().unwrap_or_default(), theme::number_font(), theme.text_weak);
    let width = 34.0 + label.size().x + if accuracy.is_some() { 6.0 + accuracy_label.size().x } else { 0.0 } + 6.0;
    let (rect, response) = ui.allocate_exact_size(vec2(width, 22.0), Sense::click());
    let name = format!("Run {} {}", run.spec.label, accuracy.clone().unwrap_or_default());
    response.widget_info(|| WidgetInfo::selected(egui::Role::Button, true, shown, name.trim_end()));

    let painter = ui.painter_at(rect);
    if shown || response.hovered() {
        painter.rect_filled(rect, 3.0, theme.surface_raised);
    }
    if shown {
        painter.rect_stroke(rect, 3.0, Stroke::new(1.0, theme.run(number).color), StrokeKind::Inside);
    }
    let middle = rect.center().y;
    let line = [pos2(rect.left() + 5.0, middle), pos2(rect.left() + 29.0, middle)];
    paint_line(&painter, &line, theme.run(number), CURVE_WIDTH + 0.5);
    let place = Align2::LEFT_CENTER.anchor_size(pos2(rect.left() + 34.0, middle), label.size());
    painter.galley(place.min, label, text_color);
    let place = Align2::LEFT_CENTER.anchor_size(pos2(place.right() + 6.0, middle), accuracy_label.size());
    painter.galley(place.min, accuracy_label, theme.text_weak);

    if response.clicked() {
        ctx.selection.run = number;
    }
    response.context_menu(|ui| {
        if ui.button("Remove run").clicked() {
            ctx.commands.push(Command::RemoveRun(number));
            ui.close();
        }
    });
    // All steps are read only for an open tooltip.
    response.on_hover_ui(|ui| {
        ui.label(details(run, statistics));
    });
}

/// Specification and accuracy of a run.
fn details(run: &RunRecord, statistics: Option<&ErrorStatistics>) -> String {
    let mut lines = vec![format!("--run {}", run.spec), format!("camera {}", run.camera_key)];
    if let Some(origin) = &run.origin {
        let time_s = crate::geometry::seconds_from_ns(origin.stamp_ns);
        lines.push(format!("fork at {time_s:.3} s: {}", origin.changes));
    }
    if let Some(last) = run.steps.last() {
        lines.push(format!("parameterization {}", last.report.calibration.parameterization));
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
