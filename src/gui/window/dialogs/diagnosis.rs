//! Dialog "Diagnose": progress, the finding, and the causes, each with a fork that undoes it.

use std::time::Duration;

use egui::{Button, Label, ProgressBar, RichText, ScrollArea, Ui};

use super::modal::Modal;
use crate::gui::PanelContext;
use crate::session::{Command, Diagnosis, RankedCause};

/// Period at which the dialog looks for progress.
const POLL_PERIOD: Duration = Duration::from_millis(100);
/// Causes that are listed beside those that explain the residuals.
const LISTED: usize = 4;

/// Draws the dialog; starts the diagnosis of the shown run unless it is there. Returns true if the dialog stays open.
pub(super) fn ui(ui: &Ui, ctx: &mut PanelContext<'_>) -> bool {
    let theme = *ctx.theme;
    let number = ctx.selection.run.min(ctx.recording.runs.len().saturating_sub(1));
    let Some(run) = ctx.recording.runs.get(number) else { return false };
    let progress = ctx.playback.diagnosis.clone().filter(|progress| progress.run == run.id);
    let title = format!("Diagnosis of {}", run.spec.label);
    let modal = Modal { name: "diagnosis", title: &title, width: 560.0 };
    let contents = modal.ui(ui, &theme, |ui| {
        ui.add_space(4.0);
        match progress.as_ref().map(|progress| (progress, &progress.result)) {
            None => ctx.commands.push(Command::Diagnose { run: number }),
            Some((_, Some(found))) => result_ui(ui, ctx, number, found),
            Some((progress, None)) => {
                ui.add(ProgressBar::new(progress.ratio as f32).show_percentage());
                ui.label(RichText::new(&progress.label).monospace().color(theme.text_weak));
                if ui.button("Stop").clicked() {
                    ctx.commands.push(Command::StopDiagnosis);
                }
            }
        }
        if progress.as_ref().is_none_or(|progress| progress.result.is_none()) {
            ui.ctx().request_repaint_after(POLL_PERIOD);
        }
    });
    contents.1
}

fn result_ui(ui: &mut Ui, ctx: &mut PanelContext<'_>, run: usize, found: &Diagnosis) {
    let theme = *ctx.theme;
    ui.add(Label::new(RichText::new(capitalized(&found.headline())).color(theme.text_strong)).wrap());
    for value in found.values.iter().filter(|value| !value.agrees()) {
        let text = format!("{}: {:.2} (limit {})", value.name, value.value, value.limit);
        ui.label(RichText::new(text).color(theme.text_weak));
    }
    if let Some(text) = &found.ground_truth {
        ui.add(Label::new(format!("Ground truth {text}")).wrap());
    }
    ui.add_space(6.0);
    ScrollArea::vertical().max_height(420.0).show(ui, |ui| {
        for (place, cause) in found.causes.iter().take(found.explaining.max(LISTED)).enumerate() {
            cause_ui(ui, ctx, run, cause, place < found.explaining);
        }
    });
    ui.add_space(6.0);
    ui.horizontal(|ui| {
        if ui.button("Diagnose again").clicked() {
            ctx.commands.push(Command::Diagnose { run });
        }
        if ui.button("Close").clicked() {
            ui.close();
        }
    });
}

/// Draws a cause with its remedy; its button forks the run with the change that undoes it.
fn cause_ui(ui: &mut Ui, ctx: &mut PanelContext<'_>, run: usize, cause: &RankedCause, explains: bool) {
    let theme = *ctx.theme;
    ui.horizontal(|ui| {
        let hint = format!("Fork at {:.2} s: {}", cause.from_s, cause.changes);
        if ui.add(Button::new("Fork")).on_hover_text(hint).clicked() {
            ctx.commands.push(Command::Seek { stamp_ns: cause.from_ns });
            ctx.commands.push(Command::Fork { run, changes: cause.changes.clone(), label: None });
            ui.close();
        }
        let color = if explains { theme.text_strong } else { theme.text_weak };
        ui.add(Label::new(RichText::new(capitalized(&cause.statement)).color(color)).wrap());
    });
    if explains {
        ui.add(Label::new(RichText::new(capitalized(&cause.remedy)).color(theme.text_weak)).wrap());
    }
}

fn capitalized(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
