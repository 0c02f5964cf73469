//! Rank of a step in words.

use crate::estimator::{EventKind, Phase};
use crate::geometry::seconds_from_ns;
use crate::gimbal::{ParameterNames, SWITCH_MARGIN};
use crate::gui::help::terms::{Term, window};
use crate::gui::units::significant;
use crate::observability::{KnownDirection, RankReport, parameters_of};
use crate::session::StepRecord;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Level {
    Good,
    /// Some directions are uninformed.
    Uninformed,
    /// Some directions are unobservable.
    Lost,
    None,
}

/// Summary of a step's rank report.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct RankVerdict {
    pub(crate) level: Level,
    pub(crate) headline: String,
    /// Causes of the lost rank, or the condition of the initialization that is not met.
    pub(crate) reasons: Vec<Reason>,
    /// Cause of an uninformed direction.
    pub(crate) cause: Option<Reason>,
    /// The least observable direction by parameter name.
    pub(crate) direction: Option<Reason>,
    pub(crate) notes: Vec<Reason>,
}

impl RankVerdict {
    /// Verdict on a step without a rank.
    fn none(headline: &str, reasons: Vec<Reason>) -> Self {
        Self {
            level: Level::None,
            headline: headline.to_owned(),
            reasons,
            cause: None,
            direction: None,
            notes: Vec::new(),
        }
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Reason {
    /// Quantity of the reason.
    pub(crate) term: Term,
    pub(crate) text: String,
}

/// Verdict on the observability of the calibration in a step.
pub(crate) fn verdict(step: &StepRecord, names: &ParameterNames) -> RankVerdict {
    match &step.rank {
        Some(rank) if rank.parameters.is_empty() => RankVerdict::none("Calibration fixed in this run", Vec::new()),
        Some(rank) => of_rank(rank, step, names),
        None => {
            let initializing = step.report.phase == Phase::Initializing;
            let headline =
                if initializing { "Initializing: no rank yet" } else { "No linearization in this step: no rank" };
            let waits = step.report.events.iter().filter(|event| event.kind == EventKind::InitializationWaits);
            let reasons = waits.map(|event| Reason { term: window::INITIALIZATION, text: event.message.clone() });
            RankVerdict::none(headline, reasons.collect())
        }
    }
}

fn of_rank(rank: &RankReport, step: &StepRecord, names: &ParameterNames) -> RankVerdict {
    let columns = rank.parameters.len();
    let null = columns.saturating_sub(rank.rank_structural);
    let uninformed = rank.rank_structural.saturating_sub(rank.rank_informed);
    let (level, headline) = match (null, uninformed) {
        (0, 0) => (Level::Good, format!("Full rank: {columns} of {columns} directions informed")),
        (0, _) => (
            Level::Uninformed,
            format!(
                "Structural rank {columns} of {columns}, informed rank {}: {uninformed} uninformed",
                rank.rank_informed
            ),
        ),
        _ => {
            let kept = rank.rank_structural;
            let headline = format!("Structural rank {kept} of {columns}: {null} unobservable, {uninformed} uninformed");
            (Level::Lost, headline)
        }
    };
    let mut reasons = Vec::new();
    let causes = [
        (rank.deficit_parameterization, "redundant in the parameterization"),
        (rank.deficit_joints, "stationary joints"),
        (rank.deficit_absorbed, "absorbed by free joint angles"),
        (rank.deficit_motion, "vehicle motion"),
    ];
    let causes: Vec<String> =
        causes.iter().filter(|(count, _)| *count > 0).map(|(count, cause)| format!("{count} {cause}")).collect();
    if !causes.is_empty() {
        reasons.push(Reason { term: window::RANK_DEFICIT, text: format!("Rank deficit: {}", causes.join(", ")) });
    }
    let window = &step.report.window;
    let least = rank.directions.iter().find(|direction| !direction.structural);
    let ends = window.first().zip(window.last());
    let cause = ends.zip(least).map(|((first, last), least)| {
        let text = format!(
            "Why: motion in the window of {:.1} s, singular value {} (informed from 1)",
            seconds_from_ns(last.stamp_ns - first.stamp_ns),
            significant(least.singular_value)
        );
        Reason { term: window::LEAST_OBSERVABLE, text }
    });
    let mut notes = Vec::new();
    if rank.claimed() > 0 {
        notes.push(Reason {
            term: window::SPURIOUS,
            text: format!(
                "Spurious information in the priors on {} unobservable directions, up to {:.2} (1: σ of 10° or 3 cm)",
                rank.claimed(),
                rank.spurious_gain()
            ),
        });
    }
    let direction = rank.least_observable_direction().map(|direction| {
        let kind = if direction.structural { "Unobservable" } else { "Least observable" };
        let text = format!("{kind}: {}", parameters_of(names, &rank.parameters, direction, 3));
        Reason { term: window::LEAST_OBSERVABLE, text }
    });
    if let Some((singularity, margin)) =
        rank.margins.iter().min_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, m)| *m < SWITCH_MARGIN)
    {
        notes.push(Reason {
            term: window::SINGULARITY_MARGIN,
            text: format!(
                "Parameterization near a singularity: {}, margin {margin:.2} < {SWITCH_MARGIN:.2}",
                names.singularity(*singularity)
            ),
        });
    }
    RankVerdict { level, headline, reasons, cause, direction, notes }
}

/// Every known loss with its reason and the measured response, one line each.
pub(crate) fn structure_lines(rank: &RankReport, names: &ParameterNames) -> Vec<String> {
    let line = |known: &KnownDirection| {
        let mark = if known.agrees { "✔" } else { "✖" };
        let claimed = if known.is_claimed() {
            format!("; spurious information {:.2}", known.spurious_gain)
        } else {
            String::new()
        };
        format!("{mark} {}{claimed}", known.loss.reason(rank.joint_count, names))
    };
    rank.known.iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gui::samples::{first_tracked_frame, sample_recording_of};

    #[test]
    fn the_verdict_reports_what_is_lost_and_why() {
        let recording = sample_recording_of(first_tracked_frame() + 10, &["auto", "classical"]);
        let said = |run: usize, step: usize| verdict(&recording.runs[run].steps[step], &ParameterNames::default());
        let waiting = said(0, 3);
        assert_eq!((waiting.level, waiting.headline.as_str()), (Level::None, "Initializing: no rank yet"));
        assert_eq!(said(0, first_tracked_frame() + 5).level, Level::Uninformed);
        let classical = said(1, first_tracked_frame() + 5);
        assert_eq!(classical.level, Level::Lost);
        assert!(classical.headline.starts_with("Structural rank 18 of 24: 6 unobservable"), "{}", classical.headline);
        assert_eq!(classical.reasons[0].text, "Rank deficit: 6 redundant in the parameterization");
    }
}
