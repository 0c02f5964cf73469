//! Trials of one span on one scale.

use super::cost_bound::LEAST_GAIN;
use super::hypotheses::TrialHypothesis;
use super::ranking::{RankedTrial, score};
use super::trial::TrialResult;
use crate::faults::{Explanation as _, FaultKind};
use crate::session::misfit::{Misfit, Scale};
use crate::session::plan::ForkChanges;

/// Ratio of the steps with a window below which a run is lost.
pub(super) const LOST: f64 = 0.5;
/// Standard deviation of an observation in pixels if no trial has a window.
const DEFAULT_SIGMA_PX: f64 = 0.25;

/// Scored trials of one span; `given` is the run without a change.
pub(super) struct Trials {
    pub(super) given: RankedTrial,
    pub(super) others: Vec<RankedTrial>,
}

impl Trials {
    /// True for a trial with an appreciable part of the gain of the best one: better values of the others explain no more.
    pub(super) fn is_promising(&self, trial: &RankedTrial) -> bool {
        let best = RankedTrial::best(&self.others).map_or(0.0, |best| self.given.score - best.score);
        self.given.score - trial.score >= LEAST_GAIN * best
    }
}

/// Trials on one scale: the observations and windows of the run itself, or of the trial with the most steps if the run has no
/// window, and the noise of the trial with the smallest residuals.
pub(super) fn scored(given: TrialResult, done: Vec<(TrialHypothesis, TrialResult)>) -> Trials {
    let started = given.initialized_ns().or_else(|| done.iter().filter_map(|(_, it)| it.initialized_ns()).min());
    let from_ns = started.unwrap_or_default();
    let averages = |result: &TrialResult| Misfit::of(&result.steps, from_ns);
    let given_misfit = averages(&given);
    let misfits: Vec<Misfit> = done.iter().map(|(_, result)| averages(result)).collect();
    let tracking = || misfits.iter().chain([&given_misfit]).filter(|misfit| misfit.tracked_ratio() > LOST);
    let reference = if given_misfit.tracked_ratio() > LOST {
        given_misfit.clone()
    } else {
        tracking().max_by_key(|misfit| misfit.tracked).cloned().unwrap_or_default()
    };
    let sigma_px = tracking().filter_map(Misfit::sigma_px).min_by(f64::total_cmp).unwrap_or(DEFAULT_SIGMA_PX);
    let end_ns = given.steps.last().map_or(from_ns, |step| step.stamp_ns);
    let scale = Scale::of(&reference, sigma_px, end_ns - from_ns);
    let candidate = |hypothesis: TrialHypothesis, result: TrialResult, misfit: Misfit| {
        let score = score(&hypothesis, &misfit, &given_misfit, &scale);
        RankedTrial { hypothesis, result, misfit, score, beyond_search: false }
    };
    let unchanged = TrialHypothesis::change(FaultKind::Chain, ForkChanges::default(), 0);
    let others = done.into_iter().zip(misfits).map(|((it, result), misfit)| candidate(it, result, misfit)).collect();
    Trials { given: candidate(unchanged, given, given_misfit.clone()), others }
}
