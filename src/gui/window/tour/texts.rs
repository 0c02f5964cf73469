//! Texts of the stops, with the numbers of the open recording.

use super::story::{self, Stop, Story};
use crate::geometry::seconds_from_ns;
use crate::gimbal::{ParameterId, ParameterNames};
use crate::gui::PanelContext;
use crate::gui::rank::verdict::{RankVerdict, verdict};
use crate::gui::theme::MAX_RUNS;
use crate::gui::units::{counted, fixed};
use crate::observability::{RankReport, parameters_of};
use crate::sensors::RequiredAccuracy;
use crate::session::{LostSince, RunRecord, StepRecord};
use crate::text::Named as _;

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct CardText {
    /// Question of the stop.
    pub(super) title: &'static str,
    pub(super) lines: Vec<String>,
    /// Result that is still being computed.
    pub(super) waiting: Option<String>,
}

/// Text of a stop; `excitation` is the suggestion of the rank panel at the stamp of the tour.
pub(super) fn of(stop: Stop, story: Story, ctx: &PanelContext<'_>, excitation: Option<&str>) -> CardText {
    let title = match stop {
        Stop::Log => "What is in the log?",
        Stop::Image => "What does one step contain?",
        Stop::Convergence => "Which parameters does the log calibrate?",
        Stop::Which => "Which parameter is degenerate, and since when?",
        Stop::Why => "Why?",
        Stop::Remedy => "Which motion fixes it?",
    };
    let runs = &ctx.recording.runs;
    let Some(run) = story.run(runs) else { return CardText { title, ..CardText::default() } };
    if stop == Stop::Log {
        return CardText { title, lines: log_lines(ctx, run), waiting: None };
    }
    let Some((step, _)) = story.step(runs).zip(story.instant_ns) else {
        return CardText { title, lines: Vec::new(), waiting: Some(progress(ctx, run)) };
    };
    let names = ctx.names();
    let (lines, waiting) = match stop {
        Stop::Log | Stop::Image => (image_lines(step), None),
        Stop::Convergence => (convergence_lines(step, &names, &ctx.recording.rig.required_accuracy), None),
        Stop::Which => (which_lines(run, step, &names), None),
        Stop::Why => why_lines(ctx, run, step),
        Stop::Remedy => remedy_lines(run, step, &names, excitation),
    };
    CardText { title, lines, waiting }
}

fn progress(ctx: &PanelContext<'_>, run: &RunRecord) -> String {
    let done_s = run.steps.last().map_or(0.0, |last| seconds_from_ns(last.report.stamp_ns));
    let end_s = seconds_from_ns(ctx.recording.duration_ns);
    format!("Computing run {}: {} s of {} s", run.spec.label, fixed(done_s, 1), fixed(end_s, 1))
}

fn log_lines(ctx: &PanelContext<'_>, run: &RunRecord) -> Vec<String> {
    let recording = ctx.recording;
    let joints = recording.rig.joint_names();
    let gimbal = match joints.len() {
        0 => String::new(),
        count => format!(", a gimbal with {} ({})", counted(count, "joint"), joints.join(", ")),
    };
    let log = recording.log_name();
    let length = fixed(seconds_from_ns(recording.duration_ns), 1);
    let contents = format!(
        "{log}: {length} s, {}{gimbal}. Each run estimates the trajectory and calibrates the chain from IMU to camera.",
        counted(recording.rig.cameras.len(), "camera")
    );
    let label = &run.spec.label;
    let tracking = run.steps.iter().find(|step| !step.report.window.is_empty());
    let phases = match tracking {
        Some(first) => format!(
            "Until {} s run {label} initializes (hatched in its lane): it waits for motion. Then it tracks, and small \
             ticks mark its keyframes.",
            fixed(seconds_from_ns(first.report.stamp_ns), 2)
        ),
        None => format!("Run {label} initializes (hatched in its lane): it waits for motion."),
    };
    let keys = "Space plays; Left and Right step by one frame. A step back shows exactly the step that was computed.";
    vec![contents, phases, keys.to_owned()]
}

fn image_lines(step: &StepRecord) -> Vec<String> {
    let report = &step.report;
    let [tracked, detected] = step.tracked_and_detected();
    vec![
        format!(
            "Frame {} at {} s: {tracked} features tracked, {detected} new, {} in the solve.",
            report.frame_name(),
            fixed(seconds_from_ns(report.stamp_ns), 2),
            report.counts.solved
        ),
        format!(
            "Reprojection RMS of the window: {} px before the solve, {} px after it. Lines are residuals (prediction \
             minus measurement), magnified; \"Before\" and \"After\" switch between both states.",
            fixed(report.reprojection_rms_before_px, 2),
            fixed(report.reprojection_rms_after_px, 2)
        ),
        "Hover a feature for its values; a click selects it in all panels.".to_owned(),
    ]
}

/// Ratio of posterior and prior standard deviation by parameter, the smallest first.
fn reductions(step: &StepRecord) -> Vec<(usize, f64)> {
    let calibration = &step.report.calibration;
    let ratios = calibration.sigmas.iter().zip(&calibration.prior_sigmas).map(|(sigma, prior)| sigma / prior);
    let mut ratios: Vec<(usize, f64)> = ratios.enumerate().filter(|(_, ratio)| ratio.is_finite()).collect();
    ratios.sort_by(|a, b| a.1.total_cmp(&b.1));
    ratios
}

/// The parameter with the smallest reduction of σ at a stamp.
pub(super) fn least_reduced(run: &RunRecord, instant_ns: i64) -> Option<ParameterId> {
    let step = run.step_at(instant_ns)?;
    let (index, _) = reductions(step).pop()?;
    step.report.calibration.parameters.get(index).copied()
}

fn convergence_lines(step: &StepRecord, names: &ParameterNames, required: &RequiredAccuracy) -> Vec<String> {
    let calibration = &step.report.calibration;
    let (reductions, verdicts) = (reductions(step), step.determinations(required));
    let line = |(index, ratio): (usize, f64)| {
        let parameter = calibration.parameters[index];
        let shown = parameter.shown();
        let [sigma, prior] = [&calibration.sigmas, &calibration.prior_sigmas].map(|column| shown.sigma(column[index]));
        let verdict = verdicts.get(index).map_or("", |(_, verdict)| verdict.name());
        format!("{}, σ {prior} → {sigma} ({} %: {verdict})", names.name(parameter), fixed(100.0 * ratio, 0))
    };
    let Some((best, worst)) = reductions.first().zip(reductions.last()) else {
        return vec!["This run estimates no calibration parameter.".to_owned()];
    };
    vec![
        format!(
            "{} at {} s. Reduced most: {}. Reduced least, selected here: {}.",
            counted(calibration.parameters.len(), "parameter"),
            fixed(seconds_from_ns(step.report.stamp_ns), 2),
            line(*best),
            line(*worst)
        ),
        "Each plot has the value, its ±3σ band and, dashed, the ground truth. The strip at its lower edge marks where \
         the flight has not determined the parameter, or only weakly."
            .to_owned(),
    ]
}

/// The parameter with the largest weight in the least observable direction.
pub(super) fn leading(run: &RunRecord, instant_ns: i64) -> Option<ParameterId> {
    let rank = run.step_at(instant_ns)?.rank.as_ref()?;
    let weights = &rank.least_observable_direction()?.weights;
    let largest = (0..weights.len()).max_by(|a, b| weights[*a].abs().total_cmp(&weights[*b].abs()))?;
    rank.parameters.get(largest).copied()
}

/// Start of the loss, such as `uninformed since 5.55 s`.
fn lost_since(run: &RunRecord, step: &StepRecord) -> Option<String> {
    let before = run.steps.partition_point(|other| other.report.stamp_ns < step.report.stamp_ns);
    LostSince::of(&run.steps[..before], step).map(|lost| lost.to_string())
}

fn direction_name(rank: &RankReport, names: &ParameterNames) -> Option<String> {
    Some(parameters_of(names, &rank.parameters, rank.least_observable_direction()?, 3))
}

fn which_lines(run: &RunRecord, step: &StepRecord, names: &ParameterNames) -> Vec<String> {
    let RankVerdict { headline, .. } = verdict(step, names);
    let mut lines =
        vec![format!("Run {} at {} s. {headline}.", run.spec.label, fixed(seconds_from_ns(step.report.stamp_ns), 2))];
    let Some(rank) = &step.rank else { return lines };
    if let (Some(direction), Some(since)) = (direction_name(rank, names), lost_since(run, step)) {
        lines.push(format!("Least observable: {direction}, {since} without interruption."));
        lines.push(
            "Uninformed: this window adds less information about the direction than a prior of 10° or 3 cm. Unobservable: \
             none at all."
                .to_owned(),
        );
    } else {
        lines.push("Every direction of the calibration is informed at this instant.".to_owned());
    }
    lines
}

fn why_lines(ctx: &PanelContext<'_>, run: &RunRecord, step: &StepRecord) -> (Vec<String>, Option<String>) {
    let mut lines = Vec::new();
    if let Some(rank) = &step.rank {
        lines.push(cause_line(run, step, rank));
    }
    let Some(other) = story::classical(&ctx.recording.runs).map(|number| &ctx.recording.runs[number]) else {
        let waiting = ctx.recording.runs.len() < MAX_RUNS && !ctx.recording.rig.joint_names().is_empty();
        return (lines, waiting.then(|| format!("Adding run {}", story::CLASSICAL)));
    };
    if other.id == run.id {
        return (lines, None);
    }
    let there = other.step_at(step.report.stamp_ns).filter(|there| there.report.stamp_ns == step.report.stamp_ns);
    let Some(rank) = there.and_then(|there| there.rank.as_ref()) else {
        let stopped = other.finished || other.error.is_some();
        return (lines, (!stopped).then(|| progress(ctx, other)));
    };
    let (columns, label) = (rank.parameters.len(), &other.spec.label);
    let lost = columns.saturating_sub(rank.rank_structural);
    lines.push(format!(
        "The other cause, for comparison: run {label}, shown now, has structural rank {} of {columns}. {} of its {} \
         redundant in the parameterization; \"Closed-form null directions\", further down in the panel, gives each reason.",
        rank.rank_structural,
        rank.deficit_parameterization,
        if lost == 1 {
            "1 unobservable direction is".to_owned()
        } else {
            format!("{lost} unobservable directions are")
        }
    ));
    let own = step.report.calibration.parameterization;
    if step.rank.as_ref().is_some_and(|rank| rank.deficit_parameterization == 0) {
        lines.push(format!(
            "No motion fixes those, another parameterization does: {own} of run {} has none.",
            run.spec.label
        ));
    }
    (lines, None)
}

/// Cause of the loss of the tour's direction, as text.
fn cause_line(run: &RunRecord, step: &StepRecord, rank: &RankReport) -> String {
    let label = &run.spec.label;
    let Some(direction) = rank.least_observable_direction() else {
        return format!("Run {label}: every direction is informed.");
    };
    let window = &step.report.window;
    let span_ns = window.first().zip(window.last()).map_or(0, |(first, last)| last.stamp_ns - first.stamp_ns);
    if direction.structural {
        return format!(
            "Run {label}: parameterization, stationary joints, free joint angles and vehicle motion cause {}, {}, {} and \
             {} of the unobservable directions.",
            rank.deficit_parameterization, rank.deficit_joints, rank.deficit_absorbed, rank.deficit_motion
        );
    }
    format!(
        "Run {label}: the motion in its window of {} s leaves the direction a singular value of {}; 1 would be the \
         information of a prior of 10° or 3 cm. The motion is the cause, not the parameterization.",
        fixed(seconds_from_ns(span_ns), 1),
        fixed(direction.singular_value, 2)
    )
}

fn remedy_lines(
    run: &RunRecord,
    step: &StepRecord,
    names: &ParameterNames,
    excitation: Option<&str>,
) -> (Vec<String>, Option<String>) {
    let mut lines = Vec::new();
    let found = step.rank.as_ref().and_then(|rank| Some((rank, direction_name(rank, names)?)));
    if let (Some((rank, direction)), Some(since)) = (found, lost_since(run, step)) {
        let cause = if rank.least_observable_direction().is_some_and(|direction| direction.structural) {
            "no measurement in the window depends on it"
        } else {
            "the motion in the window hardly separates these parameters"
        };
        lines.push(format!("The answer: {direction}, {since}, because {cause}."));
    }
    let waiting = match excitation {
        Some(sentence) => {
            lines.push(format!("Suggested excitation: {sentence}."));
            None
        }
        None if step.rank.is_some() => Some("Linearizing candidate motions".to_owned()),
        None => None,
    };
    lines.push(
        "From here: F forks the run with parameters fixed or another parameterization, 5 compares runs, and \
         \"dcvins report\" writes these results to a report. Shift+F1 opens the manual, with the tutorial."
            .to_owned(),
    );
    (lines, waiting)
}
