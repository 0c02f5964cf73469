//! Values and steps around those of the best trials.

use super::hypotheses::{Cause, TrialHypothesis};
use super::ranking::{RankedTrial, best};
use super::scoring::Trials;
use crate::session::plan::MeasurementCorrection;

/// Steps around that of the best change which are tried.
const MOVES: [isize; 8] = [-16, -8, -4, -2, -1, 1, 2, 4];
/// Ratios of the values that are tried before a parabola has three points.
const SPREAD: [f64; 2] = [0.94, 1.06];
const SPREAD_S: [f64; 2] = [0.6, 1.6];

/// The best change that begins at a step, at other steps around it.
pub(super) fn moved(trials: &Trials) -> Vec<TrialHypothesis> {
    let later = trials.others.iter().filter(|it| it.hypothesis.from.is_some());
    let Some(best) = best(later) else { return Vec::new() };
    let hypothesis = &best.hypothesis;
    let steps = MOVES.map(|by| hypothesis.from.and_then(|from| from.checked_add_signed(by)));
    steps.into_iter().flatten().map(|step| TrialHypothesis { from: Some(step), ..hypothesis.clone() }).collect()
}

/// Values around those of the best offset of a joint and the best zoom.
pub(super) fn tuned(candidates: &[RankedTrial]) -> Vec<TrialHypothesis> {
    let mut all = Vec::new();
    for cause in [Cause::JointOffset, Cause::Zoom] {
        let of_cause = candidates.iter().filter(|it| it.hypothesis.cause == cause);
        let Some(best) = best(of_cause) else { continue };
        let hypothesis = &best.hypothesis;
        let with = |correction: MeasurementCorrection| {
            let mut changed = hypothesis.clone();
            changed.changes.corrections = vec![correction];
            changed
        };
        match hypothesis.changes.corrections.as_slice() {
            [MeasurementCorrection::Offset(joint, offset_rad)] => {
                let same = |it: &MeasurementCorrection| match it {
                    MeasurementCorrection::Offset(other, value) if other == joint => Some(*value),
                    _ => None,
                };
                let values = around(*offset_rad, &SPREAD, &known(candidates, hypothesis, same));
                all.extend(values.into_iter().map(|value| with(MeasurementCorrection::Offset(joint.clone(), value))));
            }
            [MeasurementCorrection::Zoom(factor, over_s)] => {
                let same_time = |it: &MeasurementCorrection| match it {
                    MeasurementCorrection::Zoom(value, other_s) if other_s == over_s => Some(*value),
                    _ => None,
                };
                let same_factor = |it: &MeasurementCorrection| match it {
                    MeasurementCorrection::Zoom(other, value_s) if other == factor => Some(*value_s),
                    _ => None,
                };
                let factors = around(*factor, &SPREAD, &known(candidates, hypothesis, same_time));
                all.extend(factors.into_iter().map(|value| with(MeasurementCorrection::Zoom(value, *over_s))));
                let times_s = around(*over_s, &SPREAD_S, &known(candidates, hypothesis, same_factor));
                all.extend(times_s.into_iter().map(|value_s| with(MeasurementCorrection::Zoom(*factor, value_s))));
            }
            _ => {}
        }
    }
    all
}

/// Values with their scores of trials that differ from a hypothesis in one value only.
fn known(
    candidates: &[RankedTrial],
    hypothesis: &TrialHypothesis,
    value: impl Fn(&MeasurementCorrection) -> Option<f64>,
) -> Vec<(f64, f64)> {
    let alike = candidates.iter().filter(|it| it.hypothesis.from == hypothesis.from);
    alike
        .filter_map(|it| match it.hypothesis.changes.corrections.as_slice() {
            [correction] => Some((value(correction)?, it.score)),
            _ => None,
        })
        .collect()
}

/// Values to try around the best one: the lowest point of the parabola through it and its neighbours, or values beside it.
fn around(best: f64, spread: &[f64; 2], known: &[(f64, f64)]) -> Vec<f64> {
    let score = known.iter().find(|(value, _)| *value == best).map(|(_, score)| *score);
    let below = known.iter().filter(|(value, _)| *value < best).max_by(|one, other| one.0.total_cmp(&other.0));
    let above = known.iter().filter(|(value, _)| *value > best).min_by(|one, other| one.0.total_cmp(&other.0));
    if let (Some(score), Some((low, low_score)), Some((high, high_score))) = (score, below, above) {
        let (left, right) = (best - low, best - high);
        let numerator = left * left * (score - high_score) - right * right * (score - low_score);
        let denominator = left * (score - high_score) - right * (score - low_score);
        let lowest = best - 0.5 * numerator / denominator;
        return if lowest.is_finite() && (*low..=*high).contains(&lowest) { vec![rounded(lowest)] } else { Vec::new() };
    }
    spread.iter().map(|ratio| rounded(best * ratio)).collect()
}

/// A value with four digits, as a person would write it.
pub(super) fn rounded(value: f64) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let scale = 10.0_f64.powf(3.0 - value.abs().log10().floor());
    (value * scale).round() / scale
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_go_to_the_lowest_point_of_a_parabola() {
        assert_eq!(around(2.0, &SPREAD, &[(2.0, 5.0)]), [1.88, 2.12]);
        let score = |value: f64| 3.0 + 10.0 * (value - 1.5).powi(2);
        let known = [1.2, 1.4, 1.7].map(|value| (value, score(value)));
        assert_eq!(around(1.4, &SPREAD, &known), [1.5]);
        assert_eq!(rounded(0.769_488_888), 0.7695);
        assert_eq!(rounded(-0.014_654_139), -0.014_65);
        assert_eq!(rounded(0.0), 0.0);
    }
}
