//! Calibration panel: the verdict of the whole flight on every calibration parameter, with reason and remedy.

mod csv;
mod order;
mod table;
#[cfg(test)]
mod tests;

use egui::{RichText, TextEdit, Ui};

use self::order::Order;
use super::derived::flight::FlightReport;
use super::widgets::empty_ui;
use super::{Panel, PanelContext};
use crate::geometry::seconds_from_ns;
use crate::gui::units::fixed;
use crate::observability::Determination;
use crate::session::{FlightParameter, Recording, RunRecord, flight_headline};

/// State of the calibration panel: filter and order of the rows.
#[derive(Clone, Debug, Default)]
pub struct CalibrationPanel {
    filter: String,
    order: Order,
}

impl Panel for CalibrationPanel {
    fn ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>) {
        let recording = ctx.recording;
        let number = ctx.selection.run.min(recording.runs.len().saturating_sub(1));
        let Some(run) = recording.runs.get(number) else {
            empty_ui(ui, "No runs");
            return;
        };
        let report = ctx.flight(ui, run);
        if report.rows.is_empty() {
            let fixed = run.steps.iter().any(|step| step.report.newest().is_some());
            let label = &run.spec.label;
            empty_ui(ui, &if fixed { format!("Calibration fixed in run {label}") } else { "No steps yet".to_owned() });
            return;
        }
        self.bar_ui(ui, ctx, number, run, &report);
        let rows = self.shown(&report.rows);
        table::ui(ui, ctx, &mut self.order, &rows, report.waits_for_advice);
    }

    fn view_copy(&self) -> Self {
        self.clone()
    }
}

impl CalibrationPanel {
    /// Draws the headline of the flight, and the field that filters the rows.
    fn bar_ui(&mut self, ui: &mut Ui, ctx: &PanelContext<'_>, number: usize, run: &RunRecord, report: &FlightReport) {
        const FILTER_WIDTH: f32 = 120.0;
        ui.horizontal_wrapped(|ui| {
            let several = ctx.recording.runs.len() > 1;
            if several {
                let label = RichText::new(format!("Run {}", run.spec.label));
                ui.label(label.strong().color(ctx.theme.run(number).color));
            }
            ui.label(RichText::new(span_text(ctx.recording, run)).color(ctx.theme.text_weak));
            let headline = RichText::new(flight_headline(&report.rows)).color(ctx.theme.text_strong);
            ui.label(headline).on_hover_text(Determination::RULE);
            if !ctx.presentation.is_figure() {
                let field = TextEdit::singleline(&mut self.filter).hint_text("Filter").desired_width(FILTER_WIDTH);
                let response = ui.add(field).on_hover_text("Rows that contain this text, such as weak or pitch");
                response
                    .widget_info(|| egui::WidgetInfo::labeled(egui::Role::TextInput, true, "Filter the parameters"));
            }
        });
    }

    /// Rows that contain the text of the filter, in the chosen order.
    fn shown<'a>(&self, rows: &'a [FlightParameter]) -> Vec<&'a FlightParameter> {
        let wanted = self.filter.trim().to_lowercase();
        let contains = |row: &&FlightParameter| {
            let texts =
                [row.name.clone(), row.group.to_owned(), row.verdict_text(), row.reason.clone(), row.remedy.clone()];
            wanted.is_empty() || texts.iter().any(|text| text.to_lowercase().contains(&wanted))
        };
        let mut shown: Vec<&FlightParameter> = rows.iter().filter(contains).collect();
        self.order.sort(&mut shown);
        shown
    }
}

/// Interval of the verdicts: the whole flight, or its computed part.
pub(super) fn span_text(recording: &Recording, run: &RunRecord) -> String {
    /// Time in nanoseconds between the last image and the last message of a log.
    const MAX_REST_NS: i64 = 1_000_000_000;
    let last_ns = run.steps.last().map_or(0, |step| step.report.stamp_ns);
    if run.finished && recording.duration_ns - last_ns < MAX_REST_NS {
        return "Whole flight:".to_owned();
    }
    format!("Flight to {} s:", fixed(seconds_from_ns(last_ns), 1))
}
