//! The verdict at the top of a report, before any figure.

use serde::Serialize;

use crate::calibration::ChainDistance;
use crate::geometry::{Dimension, seconds_from_ns};
use crate::log_check::{CheckReport, Severity};
use crate::observability::laboratory::{Situation, advise};
use crate::observability::{Determination, RankReport, parameters_of};
use crate::sensors::RequiredAccuracy;
use crate::session::{
    FlightParameter, LostSince, PoseError, Recording, RunRecord, RunSummary, StepRecord, flight_headline,
    least_determined, run_warning_lines,
};
use crate::table::Medium::Page;
use crate::table::Shown;

/// Largest trajectory error, in percent of the path length, with a good mark.
const MAX_ATE_PERCENT: f64 = 1.0;
/// Number of parameters by which a direction is named.
const NAMED: usize = 4;

/// Topic of the statement about ranks, which the page has with each run.
pub(super) const OBSERVABILITY: &str = "Observability";

/// Severity of a statement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum StatementLevel {
    Good,
    Note,
    /// The use of the result is limited.
    Warning,
    /// The result is missing or invalid.
    Error,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(super) struct Statement {
    /// Subject in one word.
    pub(super) topic: &'static str,
    pub(super) mark: StatementLevel,
    /// The statement in one sentence.
    pub(super) text: String,
    /// Underlying values and reasons, one sentence each.
    pub(super) details: Vec<String>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct RunVerdict {
    /// Statements in the order of the page.
    pub(super) statements: Vec<Statement>,
}

impl RunVerdict {
    pub(super) fn new(recording: &Recording, run: &RunRecord, summary: &RunSummary) -> Self {
        let mut statements = vec![accuracy(recording, run, summary)];
        statements.push(calibration(summary, &recording.rig.required_accuracy));
        statements.extend(observability(recording, run));
        statements.push(estimation(run, summary));
        Self { statements }
    }
}

fn statement(topic: &'static str, mark: StatementLevel, text: String, details: Vec<String>) -> Statement {
    Statement { topic, mark, text, details }
}

/// Last step with a covariance of its pose.
fn last_with_covariance(run: &RunRecord) -> Option<&StepRecord> {
    run.steps.iter().rev().map(AsRef::as_ref).find(|step| step.report.newest_pose_covariance.is_some())
}

/// Standard deviation of the last position with a covariance, in metres.
pub(super) fn last_position_sigma_m(run: &RunRecord) -> Option<f64> {
    Some(last_with_covariance(run)?.report.newest_pose_covariance?.position_sigma_m())
}

/// Errors against the ground truth, or the covariance of the last pose if there is none.
fn accuracy(recording: &Recording, run: &RunRecord, summary: &RunSummary) -> Statement {
    let nees = PoseError::mean_nees(&run.pose_errors());
    let last = last_with_covariance(run).and_then(|last| Some((last, last.report.newest_pose_covariance?)));
    let uncertainty = last.map(|(last, covariance)| {
        let text = format!(
            "at {} s position ±{}, attitude ±{}° (1σ, relative to the first estimated frame)",
            Page.fixed(seconds_from_ns(last.report.stamp_ns), 2),
            length(covariance.position_sigma_m()),
            Page.fixed(covariance.attitude_sigma_rad().to_degrees(), 2)
        );
        match nees {
            Some(nees) => format!(
                "{text}; squared error over covariance {} on average (NEES, 6 when consistent)",
                Page.fixed(nees, 1)
            ),
            None => text,
        }
    });
    match (&summary.accuracy, uncertainty) {
        (Some(found), uncertainty) => {
            let relative = found.rpe.iter().map(|over| {
                format!(
                    "over {} m {}, {}°",
                    over.delta_m,
                    length(over.translation_rmse_m),
                    Page.fixed(over.rotation_rmse_deg, 2)
                )
            });
            let relative: Vec<String> = relative.collect();
            let mut details = Vec::new();
            if recording.truth_is_batch {
                let of = "The errors are distances to the batch reference (dcvins calibrate --trajectory), which uses the same measurements and is not an independent ground truth.";
                details.push(of.to_owned());
            }
            if !relative.is_empty() {
                details.push(format!("Relative pose error (RPE, RMSE): {}.", relative.join("; ")));
            }
            details.extend(uncertainty.map(|text| format!("Uncertainty of the estimator: {text}.")));
            let mark = if found.ate_percent_of_length <= MAX_ATE_PERCENT {
                StatementLevel::Good
            } else {
                StatementLevel::Warning
            };
            statement("Accuracy", mark, format!("{found}."), details)
        }
        (None, Some(uncertainty)) => {
            let missing = summary.accuracy_missing.clone().unwrap_or_default();
            let text = format!("No error against ground truth; uncertainty of the estimator {uncertainty}.");
            statement("Accuracy", StatementLevel::Note, text, vec![capitalized(&missing)])
        }
        (None, None) => {
            let missing = summary.accuracy_missing.clone().unwrap_or_else(|| "no estimated pose".to_owned());
            statement("Accuracy", StatementLevel::Error, capitalized(&missing), Vec::new())
        }
    }
}

/// Verdicts of the flight on the parameters, with the reason for the least determined one.
fn calibration(summary: &RunSummary, required: &RequiredAccuracy) -> Statement {
    let parameters = &summary.calibration.estimability;
    let estimated = summary.frames.estimated > 0;
    if parameters.is_empty() || !estimated {
        let text = if estimated { "Calibration fixed at the values of the rig." } else { "Not calibrated." };
        return statement("Calibration", StatementLevel::Note, text.to_owned(), Vec::new());
    }
    let meets =
        |verdict: Determination| verdict.is_met() || matches!(verdict, Determination::Redundant | Determination::Fixed);
    let all = parameters.iter().all(|parameter| meets(parameter.verdict));
    let required = required.text_for(parameters.iter().map(|parameter| parameter.parameter));
    let text = format!("{}, from the whole flight; required: {required}.", flight_headline(parameters));
    let mut details = Vec::new();
    if let Some(least) = least_determined(parameters) {
        details.push(format!("Least determined: {}, {}.", with_sigma(least), least.verdict_text()));
        details.push(format!("Reason: {}.", least.reason));
        if !least.remedy.is_empty() {
            details.push(format!("Suggested for it: {}.", least.remedy));
        }
    }
    let errors = (&summary.calibration.chain_error_initial, &summary.calibration.chain_error);
    if let (Some(first), Some(last)) = errors {
        details.push(format!(
            "Extrinsics error of the camera, mean over the joint angles of the run: {} with the rig's values, {} with \
             the final calibration.",
            chain_error(first),
            chain_error(last)
        ));
    }
    statement("Calibration", if all { StatementLevel::Good } else { StatementLevel::Warning }, text, details)
}

/// For example `yaw.alpha ±0.12°`.
fn with_sigma(parameter: &FlightParameter) -> String {
    let sigma =
        parameter.sigma.map_or_else(String::new, |sigma| format!(" ±{}", sigma_text(parameter.dimension, sigma)));
    format!("{}{sigma}", parameter.name)
}

/// Ranks at the end of the run: the least observable direction, since when, the cause, and suggested excitation.
fn observability(recording: &Recording, run: &RunRecord) -> Option<Statement> {
    let place = run.steps.iter().rposition(|step| step.rank.is_some())?;
    let (earlier, step) = (&run.steps[..place], run.steps.get(place)?);
    let rank = step.rank.as_ref().filter(|rank| !rank.parameters.is_empty())?;
    let names = recording.rig.parameter_names();
    let columns = rank.parameters.len();
    let text = format!(
        "Last window, at {} s: structural rank {} of {columns}, informed rank {}.",
        Page.fixed(seconds_from_ns(step.report.stamp_ns), 2),
        rank.rank_structural,
        rank.rank_informed
    );
    let mut details = Vec::new();
    if let Some(direction) = rank.least_observable_direction() {
        let since = LostSince::of(earlier, step).map_or_else(String::new, |lost| format!(", {lost}"));
        let along = parameters_of(&names, &rank.parameters, direction, NAMED);
        details.push(format!("Least observable direction of this window: {along}{since}."));
    }
    details.extend(why(rank, step));
    let best = run.steps.iter().filter_map(|step| Some((step.rank.as_ref()?.rank_informed, step.report.stamp_ns)));
    if let Some((most, stamp_ns)) = best.max_by_key(|(informed, stamp_ns)| (*informed, std::cmp::Reverse(*stamp_ns)))
        && most > rank.rank_informed
    {
        let at_s = Page.fixed(seconds_from_ns(stamp_ns), 2);
        details.push(format!("Largest informed rank of the run: {most} at {at_s} s."));
    }
    if let Some((parameter, motion)) = rank.sensor_excitation() {
        details.push(format!("Suggested excitation for {}: {motion}.", names.name(parameter)));
    }
    if rank.rank_informed < columns
        && let Some(advice) =
            Situation::of_step(&step.report, rank, &recording.rig, &run.camera_key).as_ref().and_then(advise)
        && let Some(sentence) = advice.sentence()
    {
        details.push(format!("Suggested excitation: {}.", in_words(&sentence)));
    }
    let mark = if rank.rank_structural == columns && rank.rank_informed == columns {
        StatementLevel::Good
    } else {
        StatementLevel::Warning
    };
    Some(statement(OBSERVABILITY, mark, text, details))
}

/// Causes of null and of uninformed directions.
fn why(rank: &RankReport, step: &StepRecord) -> Vec<String> {
    let causes = [
        (rank.deficit_parameterization, "redundant in the parameterization"),
        (rank.deficit_joints, "lost to stationary joints"),
        (rank.deficit_absorbed, "absorbed by free joint angles"),
        (rank.deficit_motion, "lost to the vehicle's motion"),
    ];
    let named = causes.iter().filter(|(count, _)| *count > 0).map(|(count, cause)| format!("{count} {cause}"));
    let named: Vec<String> = named.collect();
    let mut reasons = Vec::new();
    if !named.is_empty() {
        reasons.push(format!("Unobservable directions: {}.", named.join(", ")));
    }
    let uninformed = rank.rank_structural.saturating_sub(rank.rank_informed);
    if let (Some(first), Some(last), true) = (step.report.window.first(), step.report.window.last(), uninformed > 0) {
        let window_s = seconds_from_ns(last.stamp_ns - first.stamp_ns);
        reasons.push(format!(
            "{} because the motion in the window ({} frames, {} s) constrains {} less than a prior of 10° or 3 cm.",
            if uninformed == 1 { "1 direction is uninformed" } else { "Directions are uninformed" },
            step.report.window.len(),
            Page.fixed(window_s, 1),
            if uninformed == 1 { "it".to_owned() } else { format!("{uninformed} of them") }
        ));
    }
    reasons
}

/// Frames, restarts and warnings of the run.
fn estimation(run: &RunRecord, summary: &RunSummary) -> Statement {
    let (frames, warnings) = (&summary.frames, run_warning_lines(run).len());
    let initialized = frames
        .initialized_at_s
        .map_or_else(|| "never initialized".to_owned(), |at_s| format!("initialized at {} s", Page.fixed(at_s, 2)));
    let text = format!(
        "{} of {} images have an estimated pose; {initialized}; {}; {}.",
        frames.estimated,
        frames.total,
        count(frames.restarts, "restart"),
        count(warnings, "warning")
    );
    let mark = match (frames.estimated, frames.restarts, warnings, &run.error) {
        (0, ..) | (_, _, _, Some(_)) => StatementLevel::Error,
        (_, 0, 0, None) => StatementLevel::Good,
        (_, 0, _, None) => StatementLevel::Note,
        _ => StatementLevel::Warning,
    };
    statement("Estimation", mark, text, run.error.iter().cloned().collect())
}

/// Problems of the log and the rig found by `check`, and warnings of the reader.
pub(super) fn log_statement(check: Option<&CheckReport>, reader_warnings: &[String]) -> Statement {
    let of = |severity: Severity| {
        let findings = check.into_iter().flat_map(|check| &check.findings);
        findings.filter(move |finding| finding.severity == severity).collect::<Vec<_>>()
    };
    let (errors, warnings, notes) = (of(Severity::Error), of(Severity::Warning), of(Severity::Note));
    let others = warnings.len() + reader_warnings.len();
    let mark = match (errors.len(), others, notes.len()) {
        (0, 0, 0) => StatementLevel::Good,
        (0, 0, _) => StatementLevel::Note,
        (0, ..) => StatementLevel::Warning,
        _ => StatementLevel::Error,
    };
    let text = if mark == StatementLevel::Good {
        "No problems found in the log and the rig.".to_owned()
    } else {
        let counts = [(errors.len(), "error"), (others, "warning"), (notes.len(), "note")];
        let [errors, warnings, notes] = counts.map(|(number, noun)| count(number, noun));
        format!("{}, {warnings} and {notes} about the log and the rig.", capitalized(&errors))
    };
    let line = |finding: &crate::log_check::Finding| {
        let remedy = if finding.remedy.is_empty() { String::new() } else { format!(" Remedy: {}", finding.remedy) };
        format!("{}: {}.{remedy}", capitalized(&finding.title), finding.evidence)
    };
    // What matters most comes first.
    let first = check.map(|check| check.verdict().first).unwrap_or_default();
    let (named, others): (Vec<_>, Vec<_>) =
        errors.iter().chain(&warnings).chain(&notes).copied().partition(|it| first.contains(it));
    let named = first.iter().filter(|it| named.contains(it));
    let details = named.chain(others).map(line).chain(reader_warnings.iter().cloned()).collect();
    statement("Log and rig", mark, text, details)
}

/// A length in millimetres below a decimetre, else in metres.
fn length(value_m: f64) -> String {
    if value_m < 0.1 { format!("{} mm", Page.fixed(1e3 * value_m, 1)) } else { format!("{} m", Page.fixed(value_m, 2)) }
}

pub(super) fn chain_error(error: &ChainDistance) -> String {
    format!(
        "{} mm, {}°",
        Page.fixed(error.translation_mean_m * 1e3, 1),
        Page.fixed(error.rotation_mean_rad.to_degrees(), 2)
    )
}

/// A standard deviation with two digits and its unit.
fn sigma_text(dimension: Dimension, sigma: f64) -> String {
    let Shown { factor, unit } = Shown::of(dimension);
    let shown = sigma * factor;
    let decimals = if shown > 0.0 { (1.0 - shown.log10().floor()).clamp(0.0, 6.0) as usize } else { 0 };
    format!("{}{unit}", Page.fixed(shown, decimals))
}

fn count(number: usize, noun: &str) -> String {
    match number {
        0 => format!("no {noun}s"),
        1 => format!("1 {noun}"),
        _ => format!("{number} {noun}s"),
    }
}

fn capitalized(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// `σ(yaw.d) 1.68 → 1.26 mm` without the arrow, which some fonts lack.
fn in_words(sentence: &str) -> String {
    let mut parts = sentence.splitn(2, " → ");
    match (parts.next(), parts.next()) {
        (Some(motion), Some(effect)) => format!("{motion} changes {}", effect.replace(" → ", " to ")),
        _ => sentence.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sigmas_have_two_digits() {
        assert_eq!(sigma_text(Dimension::Length, 0.00123), "1.2 mm");
        assert_eq!(sigma_text(Dimension::Angle, 0.002), "0.11°");
        assert_eq!(sigma_text(Dimension::Length, 0.0), "0 mm");
    }

    #[test]
    fn advice_is_a_sentence_without_arrows() {
        let text = in_words("roll gimbal ±15°, hover for 4 s → σ(L3.d, with L3.a) 1.68 → 1.26 mm");
        assert_eq!(text, "roll gimbal ±15°, hover for 4 s changes σ(L3.d, with L3.a) 1.68 to 1.26 mm");
    }

    #[test]
    fn a_log_without_findings_is_in_order_and_warnings_are_counted() {
        let good = log_statement(None, &[]);
        assert_eq!((good.mark, good.details.len()), (StatementLevel::Good, 0));
        let warned = log_statement(None, &["1.000 s: gap".to_owned()]);
        assert_eq!(
            (warned.mark, warned.text.as_str()),
            (StatementLevel::Warning, "No errors, 1 warning and no notes about the log and the rig.")
        );
    }

    #[test]
    fn lengths_have_sensible_digits() {
        assert_eq!(length(0.00824), "8.2 mm");
        assert_eq!(length(0.2449), "0.24 m");
    }
}
