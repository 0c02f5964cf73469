//! Ranking of trials by what they explain against their number of parameters, and the verdict.
//!
//! The score of a trial is −2·ln of its likelihood plus `ln(n)` for each parameter (BIC), n observations. A larger assumed
//! noise lowers every χ²; its score has the logarithm of the density in addition, `2·ln(factor)` for each row. A half of the
//! image that is not used is compared on the other half.

use super::hypotheses::TrialHypothesis;
use super::trial::TrialResult;
use crate::faults::{Choice, Explanation, Fault, FaultKind, MOST_REMAINING, criterion};
use crate::geometry::quantile;
use crate::session::misfit::agreement::disagreement;
use crate::session::misfit::{Misfit, Scale};
use crate::session::record::DiagnosisVerdict;

/// Trial of a hypothesis with its averages over the scored steps.
#[derive(Clone, Debug)]
pub(super) struct RankedTrial {
    pub(super) hypothesis: TrialHypothesis,
    pub(super) result: TrialResult,
    pub(super) misfit: Misfit,
    /// Score of the trial; the lowest one is the best.
    pub(super) score: f64,
    /// True if the search has found no value of the cause.
    pub(super) beyond_search: bool,
}

impl Explanation for RankedTrial {
    fn criterion(&self) -> f64 {
        self.score
    }

    fn contains(&self, other: &Self) -> bool {
        let (cause, special) = (self.hypothesis.cause, other.hypothesis.cause);
        cause == special || cause.contains(special)
    }
}

/// Smallest advantage of a cause over the next one, in units of −2·ln of a likelihood, and relative to the gain of the
/// best cause: residuals of neighbouring images are not independent, so that a formal advantage is not enough.
const MARGIN: f64 = 30.0;
const MARGIN_RATIO: f64 = 0.05;
/// Ratio of the disagreement that a cause may leave, unless it leaves none.
const REMAINING: f64 = 0.4;
/// Smallest gain of images without a half of them, relative to the score of the run: halves of sound images differ, too.
const REGION_RATIO: f64 = 0.2;
/// Quantile of the mean squares of a kind of factors over the steps, and its ratio to their median, from which residuals have
/// a structure in time; and the smallest number of steps.
const LARGE_QUANTILE: f64 = 0.95;
const STRUCTURED_RATIO: f64 = 3.0;
const MIN_STEPS: usize = 20;

/// Score of a trial.
pub(super) fn score(hypothesis: &TrialHypothesis, misfit: &Misfit, given: &Misfit, scale: &Scale) -> f64 {
    let observations = (scale.observations * scale.windows).max(2.0);
    let mut cost = misfit.cost(scale);
    if let [Fault { choice: Some(Choice::Half(half)), .. }] = hypothesis.changes.corrections.as_slice() {
        let [visual, ..] = given.parts(scale);
        let [_, rest @ ..] = misfit.parts(scale);
        cost = misfit.calibration
            + scale.windows * (visual - misfit.gain_outside(given, *half, scale) + rest.iter().sum::<f64>());
    }
    let rows = |factor: usize| misfit.factors[factor].rows * scale.frames / misfit.frames.max(1) as f64;
    let noise = rows(0) * hypothesis.changes.imu_noise.ln() + rows(1) * hypothesis.changes.encoder_noise.ln();
    criterion(cost + 2.0 * scale.windows * noise, hypothesis.parameters as f64, observations)
}

impl RankedTrial {
    /// Value that the search varies; `None` for a cause without one.
    fn searched_value(&self) -> Option<f64> {
        let changes = &self.hypothesis.changes;
        match self.hypothesis.cause {
            FaultKind::ImuNoise => Some(changes.imu_noise),
            FaultKind::EncoderNoise => Some(changes.encoder_noise),
            FaultKind::Focal | FaultKind::Zoom | FaultKind::CameraClock | FaultKind::EncoderClock => {
                changes.corrections.first().map(|fault| fault.value(0))
            }
            _ => None,
        }
    }

    /// True for a larger noise with residuals that are larger at some times than at others: they have a structure that white
    /// noise does not have.
    fn is_structured_noise(&self) -> bool {
        let factor = match self.hypothesis.cause {
            FaultKind::ImuNoise => 0,
            FaultKind::EncoderNoise => 1,
            _ => return false,
        };
        let tracking = self.result.steps.iter().filter(|step| step.tracking);
        let squares: Vec<f64> = tracking.map(|step| step.factors[factor].mean_square()).collect();
        let [usual, large] = [0.5, LARGE_QUANTILE].map(|fraction| quantile(&squares, fraction).unwrap_or(0.0));
        squares.len() >= MIN_STEPS && large > STRUCTURED_RATIO * usual
    }

    /// True if the search has found no value of the cause: its best value is one of the coarse ones, no refined one lies
    /// between the neighbours of this value, and it is the smallest or the largest, or a focal length of the whole run, which
    /// the columns of the intrinsics refine wherever they can.
    pub(super) fn is_beyond_search(&self, all: &[Self]) -> bool {
        let Some(value) = self.searched_value() else { return false };
        let (cause, coarse) = (self.hypothesis.cause, self.hypothesis.cause.row().trials);
        let below = coarse.iter().copied().filter(|other| *other < value).max_by(f64::total_cmp);
        let above = coarse.iter().copied().filter(|other| *other > value).min_by(f64::total_cmp);
        let is_near = |other: f64| below.is_none_or(|below| other > below) && above.is_none_or(|above| other < above);
        let of_cause = all.iter().filter(|it| it.hypothesis.cause == cause).filter_map(Self::searched_value);
        let is_refined = |other: f64| !coarse.contains(&other) && is_near(other);
        let is_edge =
            below.is_none() || above.is_none() || (cause == FaultKind::Focal && self.hypothesis.from.is_none());
        coarse.contains(&value) && is_edge && !of_cause.into_iter().any(is_refined)
    }
}

/// The best candidate of each cause, the best cause first; a special case that is about as good precedes the general cause
/// if it has a value, else it follows.
pub(super) fn by_cause(given: &RankedTrial, mut candidates: Vec<RankedTrial>) -> Vec<RankedTrial> {
    for place in 0..candidates.len() {
        candidates[place].beyond_search = candidates[place].is_beyond_search(&candidates);
    }
    let is_slight = |it: &RankedTrial| {
        it.hypothesis.cause == FaultKind::ImageRegion && given.score - it.score < REGION_RATIO * given.score
    };
    candidates.retain(|candidate| !is_slight(candidate) && !candidate.is_structured_noise());
    RankedTrial::sort(&mut candidates);
    let mut kept: Vec<RankedTrial> = Vec::new();
    for candidate in candidates {
        if kept.iter().all(|known| known.hypothesis.cause != candidate.hypothesis.cause) {
            kept.push(candidate);
        }
    }
    if let Some(best) = kept.first() {
        let preferred = RankedTrial::preferred(&kept, margin(given.score - best.score), |it| !it.beyond_search);
        kept[..=preferred].rotate_right(1);
    }
    if let Some(first) = kept.first().filter(|first| first.beyond_search) {
        let limit = first.score + margin(given.score - first.score);
        let has_value = |it: &RankedTrial| !it.beyond_search && !first.contains(it) && it.contains(first);
        let general = kept.iter().position(|it| has_value(it) && it.score < limit).unwrap_or(0);
        kept[..=general].rotate_right(1);
    }
    kept
}

/// Smallest difference of two scores that tells causes apart, for a gain of the best one.
fn margin(gain: f64) -> f64 {
    MARGIN.max(MARGIN_RATIO * gain)
}

/// Verdict about ranked causes, and the number of those that explain the residuals; `given` is the run without a change.
pub(super) fn decide(given: &RankedTrial, ranked: &[RankedTrial]) -> (DiagnosisVerdict, usize) {
    const UNEXPLAINED: (DiagnosisVerdict, usize) = (DiagnosisVerdict::Unexplained, 0);
    let Some(best) = ranked.first() else { return UNEXPLAINED };
    let gain = given.score - best.score;
    let (before, after) = (disagreement(&given.misfit), disagreement(&best.misfit));
    if gain < MARGIN || (after > 1.0 && after > REMAINING * before) {
        return UNEXPLAINED;
    }
    // A cause that leaves a disagreement does not compete with one that leaves none.
    let as_good = |it: &&RankedTrial| after > 1.0 || disagreement(&it.misfit) <= 1.0;
    // The general cause has estimated the value that its special case lacks.
    let has_value = |it: &&RankedTrial| !it.beyond_search || !best.contains(it);
    match best.rivals(ranked, margin(gain)).filter(as_good).filter(has_value).count() {
        0 => (DiagnosisVerdict::Cause, 1),
        rivals => (DiagnosisVerdict::Several, (rivals + 1).min(MOST_REMAINING)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::misfit::StepMisfit;
    use crate::session::plan::ForkChanges;

    const SCALE: Scale = Scale { sigma_px: 0.1, observations: 800.0, frames: 11.0, rows: [0.0; 3], windows: 4.0 };

    fn misfit(length_px: f64) -> Misfit {
        let steps: Vec<StepMisfit> = (0..100)
            .map(|number| {
                let mut step = StepMisfit {
                    stamp_ns: number * 50_000_000,
                    tracking: true,
                    frames: 11,
                    window_s: 1.0,
                    ..StepMisfit::default()
                };
                (0..800).for_each(|_| step.pixels.add(length_px));
                step
            })
            .collect();
        Misfit::of(&steps, 0)
    }

    fn candidate(cause: FaultKind, changes: ForkChanges, length_px: f64, given: &Misfit) -> RankedTrial {
        let hypothesis = TrialHypothesis::change(cause, changes, 1);
        let misfit = misfit(length_px);
        let score = score(&hypothesis, &misfit, given, &SCALE);
        RankedTrial { hypothesis, result: TrialResult::default(), misfit, score, beyond_search: false }
    }

    fn decision(given_px: f64, causes: &[(FaultKind, f64)]) -> ((DiagnosisVerdict, usize), Vec<FaultKind>) {
        let given = misfit(given_px);
        let all = causes.iter().map(|(cause, px)| candidate(*cause, ForkChanges::default(), *px, &given)).collect();
        let given = candidate(FaultKind::Focal, ForkChanges::default(), given_px, &given);
        let ranked = by_cause(&given, all);
        let decision = decide(&given, &ranked);
        (decision, ranked.iter().map(|it| it.hypothesis.cause).collect())
    }

    #[test]
    fn one_cause_several_or_none() {
        let (focal, shutter, chain) = (FaultKind::Focal, FaultKind::Shutter, FaultKind::Chain);
        let (found, order) = decision(1.5, &[(shutter, 0.9), (focal, 0.1), (focal, 0.4), (chain, 1.5)]);
        assert_eq!((found, order), ((DiagnosisVerdict::Cause, 1), vec![focal, shutter, chain]));
        assert_eq!(decision(1.5, &[(shutter, 0.1), (focal, 0.1), (chain, 1.5)]).0, (DiagnosisVerdict::Several, 2));
        assert_eq!(decision(1.5, &[(shutter, 1.4), (focal, 1.5)]).0, (DiagnosisVerdict::Unexplained, 0));
        // A more general cause does not compete with its special case.
        let (found, order) = decision(1.5, &[(FaultKind::Intrinsics, 0.1), (focal, 0.1)]);
        assert_eq!((found, order), ((DiagnosisVerdict::Cause, 1), vec![focal, FaultKind::Intrinsics]));
        assert_eq!(decision(1.5, &[]).0, (DiagnosisVerdict::Unexplained, 0));
    }

    #[test]
    fn a_coarse_value_without_refined_ones_beside_it_is_no_value() {
        let given = misfit(1.5);
        let focal = |factor: f64, length_px: f64| {
            let corrections = vec![Fault::new(FaultKind::Focal, &[factor])];
            candidate(FaultKind::Focal, ForkChanges { corrections, ..ForkChanges::default() }, length_px, &given)
        };
        let lens = candidate(FaultKind::Intrinsics, ForkChanges::default(), 0.1, &given);
        let of_run = candidate(FaultKind::Focal, ForkChanges::default(), 1.5, &given);
        let found = |trials: Vec<RankedTrial>| {
            let ranked = by_cause(&of_run, trials);
            let named = ranked.iter().map(|it| (it.hypothesis.cause, it.beyond_search)).collect::<Vec<_>>();
            (decide(&of_run, &ranked), named)
        };
        let (refined, one) = (focal(0.74, 0.1), (DiagnosisVerdict::Cause, 1));
        let expected = (one, vec![(FaultKind::Focal, false)]);
        assert_eq!(found(vec![focal(0.7, 0.11), refined]), expected);
        assert_eq!(found(vec![focal(0.7, 0.1), focal(0.74, 0.11)]), expected);
        // The estimate goes elsewhere: the general cause, which has a value, is named.
        let all = vec![focal(0.7, 0.1), focal(1.03, 1.4), lens];
        assert_eq!(found(all), (one, vec![(FaultKind::Intrinsics, false), (FaultKind::Focal, true)]));
        assert_eq!(found(vec![focal(1.8, 0.1)]), (one, vec![(FaultKind::Focal, true)]));
    }

    #[test]
    fn a_larger_assumed_noise_is_no_free_explanation() {
        let given = misfit(0.1);
        let mut wide = misfit(0.1);
        wide.factors[1].rows = 33.0 * wide.tracked as f64;
        let changes = ForkChanges { encoder_noise: 10.0, ..ForkChanges::default() };
        let hypothesis = TrialHypothesis::change(FaultKind::EncoderNoise, changes, 1);
        let plain = TrialHypothesis::change(FaultKind::EncoderNoise, ForkChanges::default(), 1);
        let difference = score(&hypothesis, &wide, &given, &SCALE) - score(&plain, &wide, &given, &SCALE);
        assert!((difference - 4.0 * 33.0 * 2.0 * 10.0_f64.ln()).abs() < 1e-6, "{difference}");
    }
}
