//! Status bar: step time, real-time factor, memory, clock, warnings.

use std::path::PathBuf;

use egui::{Align, Button, FontId, Label, Layout as UiLayout, ProgressBar, RichText, TextStyle, Ui};

use super::notices::Notices;
use super::progress::Progress;
use super::request::WindowRequest;
use crate::gui::theme::{self, Theme};
use crate::gui::units::{bytes, counted, fixed, seconds};
use crate::gui::{PanelContext, ReadingCursor};
use crate::session::warning_lines;
use crate::session::{Recording, RunRecord};

/// Height of the bar in points.
pub(super) const HEIGHT: f32 = 22.0;
/// Widths in points of the warnings, of the progress, and of the log that is being opened.
const RIGHT_WIDTH: f32 = 110.0;
const PROGRESS_WIDTH: f32 = 160.0;
const OPENING_WIDTH: f32 = 240.0;

/// Width in points that a message has at least.
const NOTICE_WIDTH: f32 = 260.0;
/// Number of steps over which the real-time factor is averaged.
const STEPS_OF_MEAN: usize = 100;

/// State of the application that the bars show.
#[derive(Debug, Default)]
pub struct AppStatus {
    /// Memory of the process in bytes, if known. It differs between executions, so screenshots omit it.
    pub memory_bytes: Option<u64>,
    /// Show step times; screenshots omit them for the same reason.
    pub show_times: bool,
    /// Progress of the estimation; `None` when all steps are computed.
    pub progress: Option<Progress>,
    /// Progress of a log that is being opened while another one is shown, as text.
    pub opening: Option<String>,
    /// Name of the study from which the session was opened.
    pub study: Option<String>,
    /// Recently opened logs and sessions, newest first, for the menu.
    pub recent_logs: Vec<PathBuf>,
}

pub(super) fn ui(
    ui: &mut Ui,
    status: &AppStatus,
    ctx: &PanelContext<'_>,
    notices: &mut Notices,
    requests: &mut Vec<WindowRequest>,
) {
    let theme = *ctx.theme;
    let run = ctx.selected_run();
    ui.horizontal_centered(|ui| {
        ui.spacing_mut().item_spacing.x = 5.0;
        let mut fields = Vec::new();
        let mut pair = |rank: u8, name: &'static str, value: String, hover: &str| {
            fields.push(Field { rank, name, value, hover: hover.to_owned() });
        };
        if let Some(run) = run.filter(|_| status.show_times) {
            if let Some(step) = run.step_at(ctx.cursor_ns) {
                let hover = "Processing time of the step at the cursor, ms";
                pair(1, "step", format!("{} ms", fixed(step.report.times.step_ms, 1)), hover);
            }
            if let Some(factor) = real_time_factor(run, ctx.cursor_ns) {
                let hover = "Real-time factor: log time over processing time, last 100 steps";
                pair(2, "speed", format!("{}× real-time", fixed(factor, 1)), hover);
            }
        }
        if let Some(memory) = status.memory_bytes {
            pair(4, "memory", bytes(memory), "Resident memory of the process");
            let (text, hover) = recorded(ctx.recording);
            pair(0, "recording", text, &hover);
        }
        for cursor in ReadingCursor::ALL {
            if let Some(stamp_ns) = ctx.selection.reading.cursor_ns(cursor) {
                pair(0, cursor.letter(), format!("{} s", seconds(stamp_ns)), "Reading cursor (C, V; X clears both)");
            }
        }
        if let Some(interval_ns) = ctx.selection.reading.interval_ns() {
            pair(0, "Δt", format!("{} s", seconds(interval_ns)), "Time from reading cursor A to B");
        }
        let step = run.and_then(|run| run.step_at(ctx.cursor_ns));
        let delay_ms = step.map(|step| (step.log_time_ns - step.report.stamp_ns) as f64 * 1e-6);
        let with_delay = |delay_ms| format!("header stamp (log time {delay_ms:+.1} ms)");
        let clock = delay_ms.map_or_else(|| "header stamp".to_owned(), with_delay);
        pair(
            3,
            "clock",
            clock,
            "Time base header.stamp; in parentheses MCAP log time minus header.stamp, frame at the cursor",
        );
        if let Some(step) = run.and_then(|run| run.step_at(ctx.cursor_ns)) {
            let stamp_ns = ctx.recording.epoch_ns + step.report.stamp_ns;
            let text = format!("{}.{:09}", stamp_ns.div_euclid(1_000_000_000), stamp_ns.rem_euclid(1_000_000_000));
            pair(5, "stamp", text, "header.stamp of the frame at the cursor, s since the Unix epoch");
        }
        let findings = ctx.selected_run().map_or(0, |run| ctx.answer(run).findings.len());
        let count = warning_lines(ctx.recording).len() + findings;
        let reserved = RIGHT_WIDTH
            + if status.progress.is_some() { PROGRESS_WIDTH + 5.0 } else { 0.0 }
            + if status.opening.is_some() { OPENING_WIDTH } else { 0.0 };
        let room = ui.available_width() - reserved;
        fields_ui(ui, &theme, fields, if notices.is_shown() { room - NOTICE_WIDTH } else { room });
        ui.with_layout(UiLayout::right_to_left(Align::Center), |ui| {
            let (text, color) = if count == 0 {
                ("No warnings".to_owned(), theme.text_weak)
            } else {
                (format!("⚠ {}", counted(count, "warning")), theme.warn)
            };
            let button = Button::new(RichText::new(text).small().color(color)).frame(count > 0);
            if ui
                .add(button)
                .on_hover_text("Findings about the shown run, warnings of the log and the runs (W)")
                .clicked()
            {
                notices.list_open = !notices.list_open;
            }
            if let Some(progress) = &status.progress {
                progress_ui(ui, progress);
            }
            if let Some(text) = &status.opening
                && opening_ui(ui, text)
            {
                requests.push(WindowRequest::CancelOpening);
            }
            notices.line_ui(ui, &theme);
        });
    });
}

struct Field {
    /// Priority: fields with a higher number are omitted first in a narrow window.
    rank: u8,
    name: &'static str,
    value: String,
    hover: String,
}

/// Draws the fields that fit into the width `room`, in points.
fn fields_ui(ui: &mut Ui, theme: &Theme, mut fields: Vec<Field>, room: f32) {
    const GAP: f32 = 10.0;
    let small = TextStyle::Small.resolve(ui.style());
    let width_of = |field: &Field| {
        let width = |text: &str, font: FontId| ui.painter().layout_no_wrap(text.to_owned(), font, theme.text).size().x;
        let gaps = 3.0 * ui.spacing().item_spacing.x + GAP;
        width(field.name, small.clone()) + width(&field.value, theme::number_font()) + gaps
    };
    while fields.iter().map(width_of).sum::<f32>() > room {
        let last = fields.iter().enumerate().max_by_key(|(_, field)| field.rank).map(|(index, _)| index);
        let Some(last) = last else { return };
        fields.remove(last);
    }
    for Field { name, value, hover, .. } in fields {
        ui.label(RichText::new(name).small().color(theme.text_weak)).on_hover_text(&hover);
        ui.label(RichText::new(value).font(theme::number_font()).color(theme.text)).on_hover_text(&hover);
        ui.add_space(GAP);
    }
}

fn progress_ui(ui: &mut Ui, progress: &Progress) {
    let left = progress.left_s.map_or_else(String::new, |left_s| format!(", {} s left", fixed(left_s.ceil(), 0)));
    let runs = counted(progress.runs, "run");
    let text = match progress.behind_s {
        Some(_) if progress.interruption.is_some() => "no connection".to_owned(),
        Some(behind_s) => format!("{runs}: {} s behind", fixed(behind_s, 1)),
        None => format!("{runs}: {} %{left}", fixed(100.0 * progress.fraction, 0)),
    };
    let bar =
        ProgressBar::new(progress.fraction as f32).desired_width(PROGRESS_WIDTH).text(RichText::new(&text).small());
    let response = ui.add(bar);
    response
        .widget_info(|| egui::WidgetInfo::labeled(egui::Role::ProgressIndicator, true, format!("Computing {text}")));
    response.on_hover_text(match &progress.interruption {
        Some(problem) => format!("No messages come, the connection is tried again twice a second: {problem}"),
        None if progress.behind_s.is_some() => {
            "Another program is writing the log: log time from the last step to the newest message".to_owned()
        }
        None => "Estimation progress: processed log time of all runs, remaining wall-clock time".to_owned(),
    });
}

/// Shows that another log is being opened; returns true if that is cancelled.
fn opening_ui(ui: &mut Ui, text: &str) -> bool {
    let label = Label::new(RichText::new(text).small()).truncate();
    let cancel = Button::new(RichText::new("✖").small()).frame(false);
    let cancel = ui.add(cancel).on_hover_text("Cancel opening");
    cancel.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, true, "Cancel opening"));
    ui.add_sized([OPENING_WIDTH - 50.0, 14.0], label).on_hover_text(text);
    ui.add(egui::Spinner::new().size(12.0));
    cancel.clicked()
}

/// Memory of the recording relative to its budget, and the number of steps that are only summaries.
fn recorded(recording: &Recording) -> (String, String) {
    let steps: usize = recording.runs.iter().map(|run| run.steps.len()).sum();
    let summarized: usize = recording.runs.iter().map(|run| run.memory.summaries).sum();
    let fraction =
        format!("{} of {}", bytes(recording.memory_bytes() as u64), bytes(recording.memory_budget_bytes as u64));
    let text =
        if summarized > 0 { format!("{fraction}, {summarized} of {steps} steps summary only") } else { fraction };
    let hover = "Memory of all steps and estimator snapshots, of the budget in the settings. Over the budget, features and \
                 landmarks of older steps are evicted (summary only) and recomputed bit by bit from the nearest \
                 snapshot when the cursor moves there";
    (text, hover.to_owned())
}

/// Log time over computing time of the steps up to the cursor.
fn real_time_factor(run: &RunRecord, cursor_ns: i64) -> Option<f64> {
    let end = run.steps.partition_point(|step| step.report.stamp_ns <= cursor_ns);
    let steps = &run.steps[end.saturating_sub(STEPS_OF_MEAN)..end];
    let (first, last) = (steps.first()?, steps.last()?);
    let log_s = (last.report.stamp_ns - first.report.stamp_ns) as f64 * 1e-9;
    let computing_s = steps.iter().skip(1).map(|step| step.report.times.step_ms).sum::<f64>() * 1e-3;
    (log_s > 0.0 && computing_s > 0.0).then(|| log_s / computing_s)
}
