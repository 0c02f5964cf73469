//! Bar under the menu: the answer of the shown run in one sentence, and what can be done about it.

use egui::{Align, Button, Label, Layout as UiLayout, RichText, Ui};

use super::actions::Action;
use crate::gui::theme::{MAX_RUNS, Theme};
use crate::gui::{Dialog, PanelContext};
use crate::log_check::Trust;
use crate::session::{Answer, Command, FindingSource};

/// Height of the bar in points.
pub(super) const HEIGHT: f32 = 30.0;
/// Size of the sentence in points: the largest text of the window.
const SENTENCE_SIZE: f32 = 17.0;
/// Width in points that the remedy needs beside the sentence; it is left out where there is less.
const LEAST_REMEDY_WIDTH: f32 = 160.0;

/// Draws the answer of the shown run.
pub(super) fn ui(ui: &mut Ui, ctx: &mut PanelContext<'_>, actions: &mut Vec<Action>) {
    let Some(run) = ctx.selected_run() else { return };
    let answer = ctx.answer(run);
    let theme = *ctx.theme;
    ui.with_layout(UiLayout::right_to_left(Align::Center), |ui| {
        if ctx.recording.check.is_none() && ctx.recording.is_computing() {
            ui.label(RichText::new("checking the log…").small().color(theme.text_weak));
        }
        buttons_ui(ui, ctx, &answer, actions);
        ui.with_layout(UiLayout::left_to_right(Align::Center), |ui| {
            let several = ctx.recording.runs.len() > 1;
            let of_run = if several { format!("{}  ", run.spec.label) } else { String::new() };
            let sentence = RichText::new(format!("{of_run}{}", answer.sentence)).size(SENTENCE_SIZE);
            let label = ui.add(Label::new(sentence.color(color(&answer, &theme)).strong()).truncate());
            label.on_hover_text(hover_text(&answer));
            if !answer.remedy.is_empty() && ui.available_width() > LEAST_REMEDY_WIDTH {
                let remedy = RichText::new(&answer.remedy).color(theme.text);
                ui.add(Label::new(remedy).truncate()).on_hover_text(&answer.remedy);
            }
        });
    });
}

/// Draws the buttons of the first finding, from right to left.
fn buttons_ui(ui: &mut Ui, ctx: &mut PanelContext<'_>, answer: &Answer, actions: &mut Vec<Action>) {
    let Some(first) = answer.findings.first() else { return };
    if first.source != FindingSource::GroundTruth && ui.button("Diagnose").on_hover_text("Find the cause (D)").clicked()
    {
        actions.push(Action::Dialog(Dialog::Diagnosis));
    }
    if let Some((changes, from_ns)) = first.correction() {
        let button = ui.add_enabled(ctx.recording.runs.len() < MAX_RUNS, Button::new("Apply and run again"));
        if button.on_hover_text(format!("Fork with {changes}")).clicked() {
            ctx.commands.push(Command::Seek { stamp_ns: from_ns });
            ctx.commands.push(Command::Fork { run: ctx.run_number(), changes, label: None });
        }
    }
    if let Some(stamp_ns) = first.since_ns
        && ui.button("Show").on_hover_text("Move the cursor to the time from which on it holds").clicked()
    {
        ctx.commands.push(Command::Seek { stamp_ns });
    }
}

fn color(answer: &Answer, theme: &Theme) -> egui::Color32 {
    let unmet = answer.requirement.as_ref().is_some_and(|it| it.met < it.parameters);
    match answer.trust {
        Trust::NotUsable => theme.error,
        Trust::Doubtful => theme.warn,
        Trust::Trusted if unmet => theme.text_strong,
        Trust::Trusted => theme.ok,
    }
}

/// All findings with their evidence.
fn hover_text(answer: &Answer) -> String {
    let mut lines = vec![answer.sentence.clone()];
    for finding in &answer.findings {
        lines.push(format!("{} {}", finding.trust.mark(), finding.statement));
        lines.extend(
            [&finding.evidence, &finding.remedy].into_iter().filter(|it| !it.is_empty()).map(|it| format!("    {it}")),
        );
    }
    lines.join("\n")
}
