//! Values and steps around the values and steps of the best trials.

use super::hypotheses::TrialHypothesis;
use super::ranking::RankedTrial;
use super::scoring::Trials;
use crate::faults::{Explanation as _, Fault, FaultKind};

/// Steps relative to the step of the best change that are tried.
const MOVES: [isize; 8] = [-16, -8, -4, -2, -1, 1, 2, 4];
/// Ratios of the first and the second value of a fault that are tried before a parabola has three points.
const SPREADS: [[f64; 2]; 2] = [[0.94, 1.06], [0.6, 1.6]];

/// The best change that begins at a step, at other steps around it.
pub(super) fn moved(trials: &Trials) -> Vec<TrialHypothesis> {
    let later = trials.others.iter().filter(|it| it.hypothesis.from.is_some());
    let Some(best) = RankedTrial::best(later).filter(|best| trials.is_promising(best)) else { return Vec::new() };
    let hypothesis = &best.hypothesis;
    let steps = MOVES.map(|by| hypothesis.from.and_then(|from| from.checked_add_signed(by)));
    steps.into_iter().flatten().map(|step| TrialHypothesis { from: Some(step), ..hypothesis.clone() }).collect()
}

/// Hypotheses with values around the best offset of a joint and around the best zoom.
pub(super) fn tuned(trials: &Trials) -> Vec<TrialHypothesis> {
    let candidates = &trials.others;
    let mut all = Vec::new();
    for cause in [FaultKind::JointOffset, FaultKind::Zoom] {
        let best = RankedTrial::best(candidates.iter().filter(|it| it.hypothesis.cause == cause));
        let Some(best) = best.filter(|best| trials.is_promising(best)) else { continue };
        let hypothesis = &best.hypothesis;
        let [fault] = hypothesis.changes.corrections.as_slice() else { continue };
        for (number, (value, spread)) in fault.values.iter().zip(&SPREADS).enumerate() {
            for tuned in around(*value, spread, &known(candidates, hypothesis, fault, number)) {
                let mut changed = hypothesis.clone();
                changed.changes.corrections = vec![with_value(fault, number, tuned)];
                all.push(changed);
            }
        }
    }
    all
}

fn with_value(fault: &Fault, number: usize, value: f64) -> Fault {
    let mut changed = fault.clone();
    changed.values[number] = value;
    changed
}

/// Values with a number, and scores, of trials that differ from the fault of a hypothesis in this value only.
fn known(candidates: &[RankedTrial], hypothesis: &TrialHypothesis, fault: &Fault, number: usize) -> Vec<(f64, f64)> {
    let alike = candidates.iter().filter(|it| it.hypothesis.from == hypothesis.from);
    alike
        .filter_map(|it| match it.hypothesis.changes.corrections.as_slice() {
            [other] if other.kind == fault.kind => {
                let value = other.values[number];
                (*other == with_value(fault, number, value)).then_some((value, it.score))
            }
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
        assert_eq!(around(2.0, &SPREADS[0], &[(2.0, 5.0)]), [1.88, 2.12]);
        let score = |value: f64| 3.0 + 10.0 * (value - 1.5).powi(2);
        let known = [1.2, 1.4, 1.7].map(|value| (value, score(value)));
        assert_eq!(around(1.4, &SPREADS[0], &known), [1.5]);
        assert_eq!(rounded(0.769_488_888), 0.7695);
        assert_eq!(rounded(-0.014_654_139), -0.014_65);
        assert_eq!(rounded(0.0), 0.0);
    }
}
