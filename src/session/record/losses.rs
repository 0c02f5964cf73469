//! Losses of rank over the steps of a run: those known in closed form, and the time since which a direction is lost.

use std::fmt;
use std::sync::Arc;

use serde::Serialize;

use super::StepRecord;
use super::run::RunRecord;
use crate::geometry::seconds_from_ns;
use crate::gimbal::ParameterNames;
use crate::observability::{KnownLoss, steps_lost};

/// A null direction known in closed form, compared with the measured response in every step of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct KnownLossSummary {
    /// The cause in one sentence with its equation.
    pub reason: String,
    /// Number of steps with a parameterization that has this null direction.
    pub steps: usize,
    /// Number of these steps in which the measured response is null.
    pub agreeing: usize,
    /// Largest response of the window to the direction, relative to the reference of the rank rule.
    pub largest_response: f64,
    /// Largest spurious information of the priors along the direction (1 corresponds to σ of 10° or 3 cm); zero with
    /// first-estimate Jacobians.
    #[serde(rename = "largest_false_gain")]
    pub largest_spurious_gain: f64,
}

/// Known losses of a run in the order of their first step.
pub(in crate::session) fn known_losses(run: &RunRecord, names: &ParameterNames) -> Vec<KnownLossSummary> {
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

/// Time since which the least observable direction of a step has been null or uninformed without interruption.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LostSince {
    /// Stamp of the first such step, in nanoseconds since the log began.
    pub stamp_ns: i64,
    /// True for a structural null direction, false for an uninformed direction.
    pub structural: bool,
}

impl LostSince {
    /// Time since which the least observable direction of `step` has been lost; `earlier` are the run's steps before
    /// it.
    ///
    /// Returns `None` for a step without a rank, and for a full informed rank.
    pub fn of(earlier: &[Arc<StepRecord>], step: &StepRecord) -> Option<Self> {
        let rank = step.rank.as_ref()?;
        let direction = rank.least_observable_direction()?;
        let ranks = earlier.iter().rev().map(|step| step.rank.as_ref());
        let lost = steps_lost(&rank.parameters, &direction.weights, ranks);
        let first = earlier.get(earlier.len() - lost).map_or(step, |first| first);
        Some(Self { stamp_ns: first.report.stamp_ns, structural: direction.structural })
    }
}

impl LostSince {
    /// Kind for texts: `unobservable` or `uninformed`.
    pub fn kind(self) -> &'static str {
        if self.structural { "unobservable" } else { "uninformed" }
    }
}

impl fmt::Display for LostSince {
    /// For example `uninformed since 5.55 s`.
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{} since {:.2} s", self.kind(), seconds_from_ns(self.stamp_ns))
    }
}
