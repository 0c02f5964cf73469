//! Calibration panel: the verdict of the whole flight on every calibration parameter, with reason and remedy.

#[cfg(test)]
mod tests;

use egui::{DragValue, RichText, ScrollArea, TextEdit, Ui};

use super::derived::flight::FlightReport;
use super::parameter_names::{meaning_of, place_of};
use super::table::{TableOrder, TableRow, TableUi};
use super::widgets::empty_ui;
use super::{CsvTable, Panel, PanelContext};
use crate::geometry::seconds_from_ns;
use crate::gui::units::fixed;
use crate::observability::Determination;
use crate::sensors::RequiredAccuracy;
use crate::session::{CalibrationRow, Command, FlightParameter, Recording, RunRecord, flight_headline, flight_table};
use crate::table::csv;

/// Gap between two columns in points.
const GAP: f32 = 12.0;
const HEADING_HEIGHT: f32 = 18.0;
/// Width of the scroll bar in points.
const SCROLL_BAR: f32 = 10.0;

/// State of the calibration panel: filter and order of the rows.
#[derive(Clone, Debug)]
pub struct CalibrationPanel {
    filter: String,
    order: TableOrder,
    /// Accuracy that is being entered.
    entered: Option<RequiredAccuracy>,
}

impl Default for CalibrationPanel {
    /// At first the worst verdict is on top.
    fn default() -> Self {
        Self { filter: String::new(), order: TableOrder::descending("Verdict"), entered: None }
    }
}

impl CsvTable for CalibrationPanel {
    /// Verdict of the whole flight on each parameter of the shown run, in the order of `summary.json`.
    fn csv_table(&mut self, ctx: &PanelContext<'_>) -> String {
        let Some(run) = ctx.selected_run() else { return String::new() };
        let rows = flight_table(ctx.recording, run);
        let rows = rows.iter().map(|flight| CalibrationRow { flight, summary: None, waits_for_advice: false });
        csv(&CalibrationRow::columns(), rows)
    }
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
        self.table_ui(ui, ctx, &report);
    }

    fn view_copy(&self) -> Self {
        self.clone()
    }
}

impl CalibrationPanel {
    /// Draws the headline of the flight, and the fields of the required accuracy and of the filter.
    fn bar_ui(
        &mut self,
        ui: &mut Ui,
        ctx: &mut PanelContext<'_>,
        number: usize,
        run: &RunRecord,
        report: &FlightReport,
    ) {
        const FILTER_WIDTH: f32 = 120.0;
        ui.horizontal_wrapped(|ui| {
            let several = ctx.recording.runs.len() > 1;
            if several {
                let label = RichText::new(format!("Run {}", run.spec.label));
                ui.label(label.strong().color(ctx.theme.run(number).color));
            }
            ui.label(RichText::new(span_text(ctx.recording, run)).color(ctx.theme.text_weak));
            let headline = RichText::new(flight_headline(&report.rows)).color(ctx.theme.text_strong);
            let scale = report.rows.first().map_or(1.0, |row| row.sigma_scale);
            let measured = format!(
                "σ is multiplied by {}: the factor by which the estimates of this run have changed more than their σ allow.",
                fixed(scale, 2)
            );
            ui.label(headline).on_hover_text(format!("{}\n{measured}", rule(ctx, &report.rows)));
            if !ctx.presentation.is_figure() {
                self.required_ui(ui, ctx);
                let field = TextEdit::singleline(&mut self.filter).hint_text("Filter").desired_width(FILTER_WIDTH);
                let response = ui.add(field).on_hover_text("Rows that contain this text, such as weak or pitch");
                response
                    .widget_info(|| egui::WidgetInfo::labeled(egui::Role::TextInput, true, "Filter the parameters"));
            }
        });
    }

    /// Draws fields for the required accuracy of lengths and angles; it is compared when a field is left.
    fn required_ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>) {
        let mut required = self.entered.take().unwrap_or_else(|| ctx.recording.rig.required_accuracy.clone());
        let [mut length_mm, mut angle_deg] = [1e3 * required.translation_m, required.rotation_rad.to_degrees()];
        let fields = [
            (
                &mut length_mm,
                0.01..=1e3,
                " mm",
                "Required accuracy of lengths: σ with which they are known well enough",
            ),
            (&mut angle_deg, 0.001..=90.0, "°", "Required accuracy of angles: σ with which they are known well enough"),
        ];
        ui.label(RichText::new("Required").color(ctx.theme.text_weak));
        let (mut is_left, mut is_used) = (false, false);
        for (value, range, unit, meaning) in fields {
            let speed = 0.02 * *value;
            let response = ui.add(DragValue::new(value).range(range).speed(speed).max_decimals(3).suffix(unit));
            response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::SpinButton, true, meaning));
            is_left |= response.drag_stopped() || response.lost_focus();
            is_used |= response.dragged() || response.has_focus();
            response.on_hover_text(meaning);
        }
        (required.translation_m, required.rotation_rad) = (1e-3 * length_mm, angle_deg.to_radians());
        if is_left && required != ctx.recording.rig.required_accuracy {
            ctx.commands.push(Command::RequireAccuracy(required));
        } else if is_used {
            self.entered = Some(required);
        }
    }

    /// Draws the rows that contain the text of the filter; a click goes to the start of a verdict.
    fn table_ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>, report: &FlightReport) {
        let wanted = self.filter.trim().to_lowercase();
        let contains = |row: &&FlightParameter| {
            let texts =
                [row.name.clone(), row.group.to_owned(), row.verdict_text(), row.reason.clone(), row.remedy.clone()];
            wanted.is_empty() || texts.iter().any(|text| text.to_lowercase().contains(&wanted))
        };
        let row = |flight| CalibrationRow { flight, summary: None, waits_for_advice: report.waits_for_advice };
        let mut rows: Vec<CalibrationRow<'_>> = report.rows.iter().filter(contains).map(row).collect();
        rows.sort_by_key(|row| place_of(row.flight.parameter));
        let columns = CalibrationRow::columns();
        self.order.sort(&columns, &mut rows);
        let table = TableUi::new(ui, &columns, &rows, GAP, ui.available_width() - SCROLL_BAR);
        table.headings_ui(ui, ctx, HEADING_HEIGHT, Some(&mut self.order));
        if rows.is_empty() {
            ui.label(RichText::new("No parameter contains this text").color(ctx.theme.text_weak));
        }
        let recording = ctx.recording;
        let properties = |row: &CalibrationRow<'_>| TableRow {
            parameter: Some(row.flight.parameter),
            sentence: row.flight.sentence(),
            hint: format!("{}: {}", row.flight.name, meaning_of(row.flight.parameter, &recording.rig)),
        };
        let rows = ScrollArea::vertical().auto_shrink(false);
        let clicked = rows.show(ui, |ui| table.rows_ui(ui, ctx, properties, |_, _, _| {})).inner;
        let since_ns = clicked.and_then(|row| row.flight.since_ns);
        ctx.commands.extend(since_ns.map(|stamp_ns| Command::Seek { stamp_ns }));
    }
}

/// Scale of the verdicts with the required accuracy of some parameters.
pub(super) fn rule(ctx: &PanelContext<'_>, rows: &[FlightParameter]) -> String {
    let required = ctx.recording.rig.required_accuracy.text_for(rows.iter().map(|row| row.parameter));
    format!("Required: {required}. {}", Determination::RULE)
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
