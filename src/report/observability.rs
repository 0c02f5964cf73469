//! Statement of a report about the ranks at the end of a run.

use serde::Serialize;

use crate::geometry::seconds_from_ns;
use crate::log_check::Severity;
use crate::observability::laboratory::{Situation, advise};
use crate::observability::{RankReport, parameters_of};
use crate::session::{Answer, LostSince, Recording, RunRecord, StepRecord};
use crate::table::Medium::Page;

/// Number of parameters by which a direction is named.
const NAMED: usize = 4;

#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Observability {
    /// A warning if a direction is unobservable or uninformed.
    pub(super) severity: Severity,
    /// The ranks in one sentence.
    pub(super) text: String,
    /// Underlying values and reasons, one sentence each.
    pub(super) details: Vec<String>,
}

/// Ranks at the end of the run: the least observable direction, since when, the cause, and suggested excitation if the run
/// is trusted.
pub(super) fn observability(recording: &Recording, run: &RunRecord, answer: &Answer) -> Option<Observability> {
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
    let is_trusted = answer.withheld().is_none();
    if let Some((parameter, motion)) = rank.sensor_excitation().filter(|_| is_trusted) {
        details.push(format!("Suggested excitation for {}: {motion}.", names.name(parameter)));
    }
    if is_trusted
        && rank.rank_informed < columns
        && let Some(advice) =
            Situation::of_step(&step.report, rank, &recording.rig, &run.camera_key).as_ref().and_then(advise)
        && let Some(sentence) = advice.sentence()
    {
        details.push(format!("Suggested excitation: {}.", in_words(&sentence)));
    }
    let severity = if rank.rank_structural == columns && rank.rank_informed == columns {
        Severity::Good
    } else {
        Severity::Warning
    };
    Some(Observability { severity, text, details })
}

/// Causes of null and of uninformed directions.
fn why(rank: &RankReport, step: &StepRecord) -> Vec<String> {
    let named = rank.deficit_texts();
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
    fn advice_is_a_sentence_without_arrows() {
        let text = in_words("roll gimbal ±15°, hover for 4 s → σ(L3.d, with L3.a) 1.68 → 1.26 mm");
        assert_eq!(text, "roll gimbal ±15°, hover for 4 s changes σ(L3.d, with L3.a) 1.68 to 1.26 mm");
    }
}
