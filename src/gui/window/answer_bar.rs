//! Bar under the menu: the answer of the shown run in one sentence, and what can be done about it.

use egui::{Align, Button, Label, Layout as UiLayout, RichText, Ui};

use super::actions::Action;
use crate::gui::theme::{MAX_RUNS, Theme};
use crate::gui::{Dialog, PanelContext, findings};
use crate::log_check::Trust;
use crate::session::{Answer, Command, FindingSource, Recording, RunRecord};

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
        let pending = pending(ctx.recording, run, &answer);
        if pending.is_none() {
            buttons_ui(ui, ctx, &answer, actions);
        }
        ui.with_layout(UiLayout::left_to_right(Align::Center), |ui| {
            let several = ctx.recording.runs.len() > 1;
            let of_run = if several { format!("{}  ", run.spec.label) } else { String::new() };
            let (text, color) = match pending {
                Some(pending) => (pending, theme.text_weak),
                None => (answer.sentence.as_str(), color(&answer, &theme)),
            };
            let sentence = RichText::new(format!("{of_run}{text}")).size(SENTENCE_SIZE);
            let label = ui.add(Label::new(sentence.color(color).strong()).truncate());
            label.on_hover_text(hover_text(&answer));
            if pending.is_none() && !answer.remedy.is_empty() && ui.available_width() > LEAST_REMEDY_WIDTH {
                let remedy = RichText::new(&answer.remedy).color(theme.text);
                ui.add(Label::new(remedy).truncate()).on_hover_text(&answer.remedy);
            }
        });
    });
}

/// Sentence in place of an answer that is still going to change: the check may name a cause of what the run shows, and the
/// number of accurate parameters grows with every step. Residuals that disagree are said as soon as the check has ended.
fn pending(recording: &Recording, run: &RunRecord, answer: &Answer) -> Option<&'static str> {
    if recording.is_being_checked {
        return Some("… Checking the log beside the runs");
    }
    let is_computing = !run.has_ended() && answer.trust == Trust::Trusted;
    is_computing.then_some("… Computing; so far nothing speaks against this run")
}

/// Draws the buttons of the first finding, from right to left.
fn buttons_ui(ui: &mut Ui, ctx: &mut PanelContext<'_>, answer: &Answer, actions: &mut Vec<Action>) {
    let Some(first) = answer.findings.first() else { return };
    if first.source != FindingSource::GroundTruth && ui.button("Diagnose").on_hover_text("Find the cause (D)").clicked()
    {
        actions.push(Action::Dialog(Dialog::Diagnosis));
    }
    if let Some((changes, from_ns)) = first.correction(&ctx.recording.rig) {
        let button = ui.add_enabled(ctx.recording.runs.len() < MAX_RUNS, Button::new("Apply and run again"));
        if button.on_hover_text(format!("Fork with {changes}")).clicked() {
            ctx.commands.push(Command::Seek { stamp_ns: from_ns });
            ctx.commands.push(Command::Fork { run: ctx.run_number(), changes, label: None });
        }
    }
    if ui.button("Show").on_hover_text("Move the cursor to its start and show what it is about").clicked() {
        findings::show(ctx, first);
    }
}

fn color(answer: &Answer, theme: &Theme) -> egui::Color32 {
    let is_met = answer.requirement.as_ref().is_some_and(|it| it.met == it.parameters);
    match answer.trust {
        Trust::NotUsable => theme.error,
        Trust::Doubtful => theme.warn,
        Trust::Trusted if is_met => theme.ok,
        Trust::Trusted => theme.text_strong,
    }
}

/// All findings with their evidence.
fn hover_text(answer: &Answer) -> String {
    let mut lines = vec![answer.sentence.clone()];
    for finding in &answer.findings {
        lines.push(format!("{} {}", finding.trust.mark(), finding.sentence()));
        lines.extend((!finding.evidence.is_empty()).then(|| format!("    {}", finding.evidence)));
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use egui_kittest::kittest::Queryable as _;

    use crate::faults::{Area, Fault, FaultKind, Severity};
    use crate::gui::window::tests::{bench, bench_of, commands_of, sample};
    use crate::log_check::{Finding, FindingInterval};
    use crate::session::Command;

    #[test]
    fn an_answer_that_is_going_to_change_is_not_said() {
        let sentence = |checked: bool, finished: bool| {
            let mut recording = sample();
            recording.is_being_checked = !checked;
            recording.runs[0].finished = finished;
            let harness = bench_of(recording, [1600.0, 900.0]);
            let starts = ["… Checking the log", "… Computing; so far", "⚠ "];
            let label = |start: &&str| harness.query_all_by_label_contains(&format!("  {start}")).next().is_some();
            starts.iter().position(label)
        };
        let all = [(false, false), (false, true), (true, false), (true, true)];
        assert_eq!(all.map(|(checked, finished)| sentence(checked, finished)), [Some(0), Some(0), Some(1), Some(2)]);
    }

    #[test]
    fn the_bar_names_the_fault_and_its_button_corrects_it() {
        assert!(bench().query_by_label("Apply and run again").is_none());
        let mut recording = sample();
        let title = "joint 'yaw' counts in the other direction than in the rig";
        recording.check = Some(Arc::new(vec![Finding {
            severity: Severity::Error,
            area: Area::Encoders,
            title: title.to_owned(),
            evidence: "rotations differ by 2.6°".to_owned(),
            remedy: "reverse the sign of the readings of 'yaw' in the driver".to_owned(),
            interval: FindingInterval::default(),
            is_assumption: false,
            faults: vec![Fault::from(FaultKind::JointReversed).of_joints(&["yaw".to_owned()])],
        }]));
        let label = format!("{}  ✖ Not usable: {title}", recording.runs[0].spec.label);
        let mut harness = bench_of(recording, [1600.0, 900.0]);
        assert!(harness.query_by_label(&label).is_some(), "{label}");
        let pushed = commands_of(&mut harness, |harness| harness.get_by_label("Apply and run again").click());
        let changes = "correct=reversed:yaw".parse().unwrap();
        assert_eq!(pushed, [Command::Seek { stamp_ns: 0 }, Command::Fork { run: 0, changes, label: None }]);
        // The list of warnings has it, too.
        harness.state_mut().window.notices.list_open = true;
        harness.run_steps(3);
        let row = format!("{title}; reverse the sign of the readings of 'yaw' in the driver");
        assert!(harness.query_by_label(&row).is_some(), "{row}");
    }
}
