//! Bar under the menu: the answer of the shown run in one sentence, and what can be done about it.

use std::time::Duration;

use egui::{Align, Button, Label, Layout as UiLayout, RichText, Role, Sense, Ui, WidgetInfo};

use super::actions::Action;
use crate::gimbal::ParameterId;
use crate::gui::theme::{MAX_RUNS, Theme};
use crate::gui::{Dialog, PanelContext, PanelName, findings};
use crate::log_check::Trust;
use crate::observability::laboratory::SufficientMotion;
use crate::session::{
    Answer, Command, DiagnosisProgress, FindingSource, Recording, RunFinding, RunRecord, motion_text, short_motion_text,
};

/// Height of the bar in points.
pub(super) const HEIGHT: f32 = 30.0;
/// Size of the sentence in points: the largest text of the window.
const SENTENCE_SIZE: f32 = 17.0;
/// Width in points that the remedy needs beside the sentence; it is left out where there is less.
const LEAST_REMEDY_WIDTH: f32 = 160.0;

/// Width of the progress of a diagnosis in points.
const PROGRESS_WIDTH: f32 = 220.0;
/// Period at which the progress of a diagnosis is drawn.
const PROGRESS_PERIOD: Duration = Duration::from_millis(250);

/// Draws the answer of the shown run.
pub(super) fn ui(ui: &mut Ui, ctx: &mut PanelContext<'_>, actions: &mut Vec<Action>) {
    let Some(run) = ctx.selected_run() else { return };
    let answer = ctx.answer(run);
    let theme = *ctx.theme;
    ui.with_layout(UiLayout::right_to_left(Align::Center), |ui| {
        let pending = pending(ctx.recording, run, &answer);
        if let Some(progress) = &ctx.playback.diagnosis {
            progress_ui(ui, ctx.commands, progress, &theme);
        }
        moved_chain_ui(ui, ctx);
        let motion = if pending.is_none() { ctx.motion(ui, run).map(|needed| needed.motion) } else { None };
        if let Some(motion) = &motion {
            motion_ui(ui, ctx, motion);
        }
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
            let shown = if pending.is_none() { Subject::of(&answer) } else { None };
            let sense = if shown.is_some() { Sense::click() } else { Sense::hover() };
            let label = ui.add(Label::new(sentence.color(color).strong()).truncate().sense(sense));
            let label = label.on_hover_text(hover_text(&answer));
            if shown.is_some() {
                label.widget_info(|| WidgetInfo::labeled(Role::Button, true, format!("{of_run}{text}")));
            }
            if let Some(shown) = shown.filter(|_| label.clicked()) {
                shown.show(ctx);
            }
            let rig = &ctx.recording.rig;
            let (remedy, whole) = match &motion {
                Some(motion) => (short_motion_text(motion, rig), motion_text(motion, rig)),
                None => (answer.remedy.clone(), answer.remedy.clone()),
            };
            if pending.is_none() && !remedy.is_empty() && ui.available_width() > LEAST_REMEDY_WIDTH {
                ui.add(Label::new(RichText::new(&remedy).color(theme.text)).truncate()).on_hover_text(whole);
            }
        });
    });
}

/// Subject of a sentence, which a click on it shows.
enum Subject<'a> {
    Finding(&'a RunFinding),
    /// The parameter that is farthest from the required accuracy.
    Parameter(ParameterId),
}

impl<'a> Subject<'a> {
    fn of(answer: &'a Answer) -> Option<Self> {
        let worst = || answer.requirement.as_ref()?.worst_parameter.map(Self::Parameter);
        answer.findings.first().map(Self::Finding).or_else(worst)
    }

    fn show(&self, ctx: &mut PanelContext<'_>) {
        match self {
            Self::Finding(finding) => findings::show(ctx, finding),
            Self::Parameter(parameter) => {
                ctx.selection.parameter = Some(*parameter);
                ctx.selection.wanted_panel = Some(PanelName::Calibration);
            }
        }
    }
}

/// Sentence in place of an answer that is still going to change: the check may name a cause of what the run shows, and the
/// number of accurate parameters grows with every step. Residuals that disagree are said as soon as the check has ended.
/// While the log is being written, the pilot needs the numbers so far.
fn pending(recording: &Recording, run: &RunRecord, answer: &Answer) -> Option<&'static str> {
    if recording.is_being_checked {
        return Some("… Checking the log beside the runs");
    }
    if recording.is_being_written && answer.requirement.is_some() {
        return None;
    }
    let is_computing = !run.has_ended() && answer.trust == Trust::Trusted;
    is_computing.then_some("… Computing; so far nothing speaks against this run")
}

/// Draws the progress of a diagnosis with the button that stops it.
fn progress_ui(ui: &mut Ui, commands: &mut Vec<Command>, progress: &DiagnosisProgress, theme: &Theme) {
    if ui.button("Stop").on_hover_text("End the diagnosis with what is known so far").clicked() {
        commands.push(Command::StopDiagnosis);
    }
    let text = format!("diagnosing, {:.0} %: {}", 100.0 * progress.ratio, progress.label);
    ui.scope(|ui| {
        ui.set_max_width(PROGRESS_WIDTH);
        ui.add(Label::new(RichText::new(&text).small().color(theme.text_weak)).truncate()).on_hover_text(&text);
    });
    ui.ctx().request_repaint_after(PROGRESS_PERIOD);
}

/// Draws the button that opens the motion which the parameters still need.
fn motion_ui(ui: &mut Ui, ctx: &mut PanelContext<'_>, motion: &SufficientMotion) {
    if ui.button("Open motion").on_hover_text("Show its curves and the predicted σ in the laboratory").clicked() {
        ctx.selection.planned = Some(motion.motion.prescribed(ctx.recording.rig.joint_names()));
        ctx.selection.wanted_panel = Some(PanelName::Laboratory);
    }
}

/// Says that the chain of the run is shown moved, with a button that moves it back.
fn moved_chain_ui(ui: &mut Ui, ctx: &mut PanelContext<'_>) {
    if ctx.selection.slide.is_none_or(|slide| slide.amount == 0.0) {
        return;
    }
    let text = RichText::new("Chain moved: reset").color(ctx.theme.warn);
    let hint = "Scene and image show the chain moved along a direction of the rank panel; a click shows the estimate";
    if ui.button(text).on_hover_text(hint).clicked() {
        ctx.selection.slide = None;
    }
}

/// Draws the buttons of the first finding, from right to left.
fn buttons_ui(ui: &mut Ui, ctx: &mut PanelContext<'_>, answer: &Answer, actions: &mut Vec<Action>) {
    let Some(first) = answer.findings.first() else { return };
    let is_running = ctx.playback.diagnosis.is_some();
    let (name, hint) = match ctx.selected_run().and_then(|run| run.diagnosis.as_ref()) {
        Some(_) => ("Causes", "All causes that the diagnosis tried (D)"),
        None => ("Diagnose", "Find the cause (D)"),
    };
    if first.source != FindingSource::GroundTruth && !is_running && ui.button(name).on_hover_text(hint).clicked() {
        actions.push(Action::Dialog(Dialog::Diagnosis));
    }
    let named = answer.named();
    for (place, finding) in named.iter().enumerate().rev() {
        let Some((changes, from_ns)) = finding.correction(&ctx.recording.rig) else { continue };
        let name =
            if named.len() == 1 { "Apply and run again".to_owned() } else { format!("Apply cause {}", place + 1) };
        let button = ui.add_enabled(ctx.recording.runs.len() < MAX_RUNS, Button::new(name));
        if button.on_hover_text(format!("{}\nFork with {changes}", finding.statement)).clicked() {
            ctx.commands.push(Command::Seek { stamp_ns: from_ns });
            ctx.commands.push(Command::Fork { run: ctx.run_number(), changes, label: None });
        }
    }
    let agreement = &ctx.recording.agreement;
    let hint = "Which sources of measurements agree, and since when others disagree (U)";
    if !agreement.isolated.is_empty() && ui.button("Sources").on_hover_text(hint).clicked() {
        actions.push(Action::Dialog(Dialog::Sources));
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

    use egui_kittest::Harness;
    use egui_kittest::kittest::Queryable as _;

    use crate::faults::{Area, Fault, FaultKind, Severity};
    use crate::gui::PanelName;
    use crate::gui::window::tests::{Bench, SECOND_NS, bench, bench_of, commands_of, sample};
    use crate::log_check::{Basis, Finding, FindingInterval};
    use crate::session::{Answer, Command};

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
    fn in_flight_the_bar_says_how_accurate_the_calibration_is_and_the_motion_that_is_needed() {
        let mut recording = sample();
        recording.runs.truncate(1);
        (recording.is_being_written, recording.runs[0].finished) = (true, false);
        let harness = bench_of(recording.clone(), [1600.0, 900.0]);
        assert!(harness.query_all_by_label_contains(", worst ").next().is_some());
        assert!(harness.query_all_by_label_contains("Fly ").next().is_some());
        assert!(harness.query_all_by_label_contains("s behind").next().is_some());
        // Before the first window there is no calibration to speak of.
        recording.runs[0].steps.clear();
        let harness = bench_of(recording, [1600.0, 900.0]);
        assert!(harness.query_all_by_label_contains("… Computing").next().is_some());
    }

    #[test]
    fn a_click_on_a_finding_of_the_timeline_moves_the_cursor_to_its_start_and_shows_its_panel() {
        let label = "Finding from 2.000 to 3.500 s: stamps of cam0 run backwards";
        assert!(bench().query_by_label(label).is_none());
        let mut recording = sample();
        recording.check = Some(Arc::new(vec![Finding {
            severity: Severity::Error,
            area: Area::Time,
            title: "stamps of cam0 run backwards".to_owned(),
            evidence: String::new(),
            remedy: String::new(),
            interval: FindingInterval { since_s: Some(2.0), until_s: Some(3.5) },
            basis: Basis::Measured,
            faults: Vec::new(),
        }]));
        let mut harness = bench_of(recording, [1600.0, 900.0]);
        let is_shown = |harness: &Harness<'_, Bench>| harness.state().window.tiles.focus == Some(PanelName::Residuals);
        assert!(!is_shown(&harness));
        let pushed = commands_of(&mut harness, |harness| harness.get_by_label(label).click());
        assert_eq!(pushed, [Command::Seek { stamp_ns: 2 * SECOND_NS }]);
        assert!(is_shown(&harness));
    }

    #[test]
    fn a_click_on_the_sentence_selects_the_parameter_that_is_farthest_from_the_requirement() {
        let mut recording = sample();
        recording.runs.truncate(1);
        let requirement = Answer::of_run(&recording, &recording.runs[0]).requirement.expect("a calibration");
        assert!(requirement.worst.is_some());
        let mut harness = bench_of(recording, [1600.0, 900.0]);
        harness.query_all_by_label_contains(", worst ").next().expect("the sentence names it").click();
        harness.run_steps(3);
        assert_eq!(harness.state().selection.parameter, requirement.worst_parameter);
        assert!(harness.state().window.tiles.layout.is_visible(PanelName::Calibration));
    }

    #[test]
    fn a_motion_that_reaches_the_requirement_is_opened_with_one_click() {
        let mut recording = sample();
        recording.runs.truncate(1);
        let mut harness = bench_of(recording, [1600.0, 900.0]);
        assert!(harness.query_all_by_label_contains("Fly ").next().is_some());
        harness.get_by_label("Open motion").click();
        harness.run_steps(4);
        assert!(harness.state().window.tiles.layout.is_visible(PanelName::Laboratory));
        assert!(harness.state().selection.planned.is_none(), "the laboratory has taken it");
        assert!(harness.query_by_label("Save motion").is_some(), "the planned motion is shown");
        // With a requirement that the run reaches, nothing is asked for.
        let mut recording = sample();
        let required = &mut Arc::make_mut(&mut recording.rig).required_accuracy;
        (required.translation_m, required.rotation_rad) = (10.0, 10.0);
        assert!(bench_of(recording, [1600.0, 900.0]).query_by_label("Open motion").is_none());
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
            basis: Basis::Measured,
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
