//! Known losses of rank over all steps of a run.

use serde::Serialize;

use super::run::RunRecord;
use crate::gimbal::ParameterNames;
use crate::observability::KnownLoss;

/// A null direction known in closed form, compared with the measured response in every step of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct KnownLossSummary {
    /// The cause in one sentence with its equation.
    pub reason: String,
    /// Number of steps whose parameterization has it.
    pub steps: usize,
    /// Number of these steps in which the measured response is null.
    pub agreeing: usize,
    /// The window's largest response to it, relative to the reference of the rank rule.
    pub largest_response: f64,
    /// Largest spurious information of the priors along it (1 corresponds to σ of 10° or 3 cm); zero with
    /// first-estimate Jacobians.
    #[serde(rename = "largest_false_gain")]
    pub largest_spurious_gain: f64,
}

/// The known losses of a run in the order of their first step.
pub(super) fn known_losses(run: &RunRecord, names: &ParameterNames) -> Vec<KnownLossSummary> {
    let mut found: Vec<(KnownLoss, KnownLossSummary)> = Vec::new();
    for rank in run.steps.iter().filter_map(|step| step.rank.as_ref()) {
        for known in &rank.known {
            let place = found.iter().position(|(loss, _)| *loss == known.loss).unwrap_or_else(|| {
                let reason = known.loss.reason(rank.joint_count, names);
                let (largest_response, largest_spurious_gain) = (0.0, 0.0);
                let summary =
                    KnownLossSummary { reason, steps: 0, agreeing: 0, largest_response, largest_spurious_gain };
                found.push((known.loss, summary));
                found.len() - 1
            });
            let summary = &mut found[place].1;
            summary.steps += 1;
            summary.agreeing += usize::from(known.agrees);
            summary.largest_response = summary.largest_response.max(known.response);
            summary.largest_spurious_gain = summary.largest_spurious_gain.max(known.spurious_gain);
        }
    }
    found.into_iter().map(|(_, summary)| summary).collect()
}
