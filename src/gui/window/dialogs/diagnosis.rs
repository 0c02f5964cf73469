//! Window of a diagnosis: progress, the finding, and the causes, each with a fork that undoes it.

use std::time::Duration;

use egui::{Button, Id, Label, ProgressBar, RichText, ScrollArea, Ui};

use crate::gui::PanelContext;
use crate::gui::units::capitalized;
use crate::session::{Command, Diagnosis, RankedCause};

/// Place and width of the window in points at first.
const DEFAULT_POSITION: [f32; 2] = [40.0, 120.0];
const WIDTH: f32 = 560.0;
/// Period at which the window looks for progress.
const POLL_PERIOD: Duration = Duration::from_millis(100);
/// Causes that are listed beside those that explain the residuals.
const LISTED: usize = 4;

/// Draws the window; starts the diagnosis of the shown run unless it is there. Returns true if the window stays open.
pub(super) fn ui(ui: &Ui, ctx: &mut PanelContext<'_>) -> bool {
    let number = ctx.run_number();
    let Some(run) = ctx.selected_run() else { return false };
    let mut open = true;
    let window = egui::Window::new(format!("Diagnosis of {}", run.spec.label))
        .id(Id::unique("diagnosis"))
        .open(&mut open)
        .collapsible(false)
        .default_pos(DEFAULT_POSITION)
        .default_width(WIDTH);
    let shown = window.show(ui.ctx(), |ui| {
        ui.set_width(WIDTH);
        match (&ctx.playback.diagnosis, &run.diagnosis) {
            (Some(progress), _) if progress.run == run.id => {
                ui.add(ProgressBar::new(progress.ratio as f32).show_percentage());
                ui.label(RichText::new(&progress.label).monospace().color(ctx.theme.text_weak));
                if ui.button("Stop diagnosis").clicked() {
                    ctx.commands.push(Command::StopDiagnosis);
                }
            }
            (_, Some(found)) => return result_ui(ui, ctx, number, found),
            (_, None) => ctx.commands.push(Command::Diagnose { run: number }),
        }
        ui.ctx().request_repaint_after(POLL_PERIOD);
        true
    });
    open && shown.and_then(|shown| shown.inner).unwrap_or(true)
}

/// Draws the result. Returns true if the window stays open.
fn result_ui(ui: &mut Ui, ctx: &mut PanelContext<'_>, run: usize, found: &Diagnosis) -> bool {
    let theme = *ctx.theme;
    ui.add(Label::new(RichText::new(capitalized(&found.headline())).color(theme.text_strong)).wrap());
    for value in found.values.iter().filter(|value| !value.agrees()) {
        let text = format!("{}: {:.2} (limit {})", value.name, value.value, value.limit);
        ui.label(RichText::new(text).color(theme.text_weak));
    }
    for fault in &found.log_faults {
        let text = format!("Check of the log, {}: {}", fault.severity.label(), fault.title);
        ui.add(Label::new(text).wrap()).on_hover_text(format!("{}\n{}", fault.evidence, fault.remedy));
    }
    if let Some(text) = &found.ground_truth {
        ui.add(Label::new(format!("Ground truth {text}")).wrap());
    }
    ui.add_space(6.0);
    let mut is_forked = false;
    ScrollArea::vertical().max_height(420.0).show(ui, |ui| {
        for (place, cause) in found.causes.iter().take(found.explaining.max(LISTED)).enumerate() {
            is_forked |= cause_ui(ui, ctx, run, cause, place < found.explaining);
        }
    });
    if let Some(text) = found.trials_in_words() {
        ui.add(Label::new(RichText::new(capitalized(&text)).color(theme.text_weak)).wrap());
    }
    ui.add_space(6.0);
    let is_closed = ui.horizontal(|ui| {
        if ui.button("Diagnose again").clicked() {
            ctx.commands.push(Command::Diagnose { run });
        }
        ui.button("Close").clicked()
    });
    !is_forked && !is_closed.inner
}

/// Draws a cause with its remedy; its button forks the run with the change that undoes it. Returns true if it was clicked.
fn cause_ui(ui: &mut Ui, ctx: &mut PanelContext<'_>, run: usize, cause: &RankedCause, explains: bool) -> bool {
    let theme = *ctx.theme;
    let mut is_forked = false;
    ui.horizontal(|ui| {
        let hint = format!("Fork at {:.2} s: {}", cause.from_s, cause.changes);
        if ui.add(Button::new("Fork")).on_hover_text(hint).clicked() {
            ctx.commands.push(Command::Seek { stamp_ns: cause.from_ns });
            ctx.commands.push(Command::Fork { run, changes: cause.changes.clone(), label: None });
            is_forked = true;
        }
        let color = if explains { theme.text_strong } else { theme.text_weak };
        ui.add(Label::new(RichText::new(capitalized(&cause.statement)).color(color)).wrap());
    });
    if explains {
        ui.add(Label::new(RichText::new(capitalized(&cause.remedy)).color(theme.text_weak)).wrap());
    }
    is_forked
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use egui_kittest::kittest::Queryable as _;

    use crate::faults::{Area, FaultKind, Severity};
    use crate::gui::Dialog;
    use crate::gui::window::tests::{SECOND_NS, bench, commands_of};
    use crate::log_check::{Basis, Finding, FindingInterval};
    use crate::session::{Command, Diagnosis, DiagnosisProgress, DiagnosisVerdict, ForkChanges, RankedCause};

    fn diagnosis() -> Diagnosis {
        let changes: ForkChanges = "correct=reversed:yaw".parse().unwrap();
        let cause = RankedCause {
            cause: FaultKind::JointReversed,
            statement: "joint 'yaw' counts in the other direction than in the rig".to_owned(),
            remedy: "reverse the sign of the readings of 'yaw' in the driver".to_owned(),
            changes,
            from_ns: 2 * SECOND_NS,
            from_s: 2.0,
            since_ns: None,
            parameters: 1,
            beyond_search: false,
            gain: 8000.0,
            values: Vec::new(),
            accuracy: None,
        };
        Diagnosis {
            log: "flight.mcap".to_owned(),
            run: "auto".to_owned(),
            verdict: DiagnosisVerdict::Cause,
            values: Vec::new(),
            log_faults: vec![Finding {
                severity: Severity::Warning,
                area: Area::Time,
                title: "the stamps of the joint angles are 81.0 ms later than the rig says".to_owned(),
                evidence: String::new(),
                remedy: "set gimbal.timeshift_gimbal_imu: -0.0810 in the rig, or run with timeshift=on".to_owned(),
                interval: FindingInterval::default(),
                basis: Basis::Measured,
                faults: Vec::new(),
            }],
            measured: false,
            onset_s: None,
            waiting: Vec::new(),
            accuracy: None,
            ground_truth: None,
            span_s: Some((2.0, 6.5)),
            explaining: 1,
            causes: vec![cause],
            trials: 40,
            interrupted: false,
            ended_after_s: Some(61.0),
            not_tried: vec![FaultKind::ImuNoise],
        }
    }

    #[test]
    fn the_dialog_starts_a_diagnosis_and_opens_the_fork_of_its_cause() {
        let mut harness = bench();
        let started = commands_of(&mut harness, |_| ());
        assert_eq!(started, []);
        harness.state_mut().window.dialogs.show(Dialog::Diagnosis);
        let started = commands_of(&mut harness, |_| ());
        assert_eq!(started.first(), Some(&Command::Diagnose { run: 0 }));
        let run = harness.state().recording.runs[0].id;
        let progress = DiagnosisProgress { run, ratio: 0.3, label: "correct=focal:0.7".to_owned() };
        harness.state_mut().playback.diagnosis = Some(progress);
        harness.run_steps(3);
        // Bar and window have the progress; the window does not cover the bar.
        for stop in ["Stop", "Stop diagnosis"] {
            let stopped = commands_of(&mut harness, |harness| harness.get_by_label(stop).click());
            assert_eq!(stopped, [Command::StopDiagnosis]);
        }
        harness.state_mut().playback.diagnosis = None;
        harness.state_mut().recording.runs[0].diagnosis = Some(Arc::new(diagnosis()));
        harness.run_steps(3);
        assert!(harness.query_all_by_label("Joint 'yaw' counts in the other direction than in the rig").count() > 0);
        assert!(
            harness
                .query_all_by_label(
                    "Check of the log, warning: the stamps of the joint angles are 81.0 ms later than the rig says"
                )
                .count()
                > 0
        );
        let ended =
            "Tried 40 changes from 2.00 to 6.50 s; ended after about 61 s of processor time; not tried: imu noise";
        assert!(harness.query_all_by_label(ended).count() > 0);
        let pushed = commands_of(&mut harness, |harness| harness.get_by_label("Fork").click());
        let changes = diagnosis().causes[0].changes.clone();
        let expected = [Command::Seek { stamp_ns: 2 * SECOND_NS }, Command::Fork { run: 0, changes, label: None }];
        assert_eq!(pushed, expected);
    }
}
