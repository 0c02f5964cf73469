//! Stamps that are rounded to multiples of a time, as by a clock with a coarse tick.

use std::collections::BTreeMap;

use crate::flight_log::stamps::spacing::Spacing;

/// Smallest reported tick in seconds, and its largest ratio to the period: a sensor whose stamps are multiples of its own
/// period is not rounded.
const MIN_TICK_S: f64 = 2e-3;
const LARGEST_TICK_RATIO: f64 = 0.7;
/// Difference of steps that count as equal, in seconds.
const SAME_S: f64 = 5e-5;
/// Rest of a division that counts as none, in seconds.
const NO_REST_S: f64 = 4.0 * SAME_S;
/// Part of the steps that are multiples of the tick, and most different lengths that they have.
const EXPLAINED_RATIO: f64 = 0.98;
const MOST_LENGTHS: usize = 8;
/// Minimum number of steps.
const MIN_STEPS: usize = 20;

/// Tick in seconds of the clock to which stamps are rounded; `None` for stamps that are not.
pub(super) fn tick_s(spacing: &Spacing) -> Option<f64> {
    let steps = &spacing.steps_s;
    let mut counts: BTreeMap<i64, usize> = BTreeMap::new();
    for step in steps {
        *counts.entry((step / SAME_S).round() as i64).or_default() += 1;
    }
    let mut lengths: Vec<(usize, i64)> = counts.into_iter().map(|(length, count)| (count, length)).collect();
    lengths.sort_unstable_by(|one, other| other.cmp(one));
    lengths.truncate(MOST_LENGTHS);
    // Single steps beside the usual ones say nothing about the clock.
    lengths.retain(|(count, _)| count * MIN_STEPS > steps.len());
    let coarse = lengths.iter().map(|(_, length)| *length as f64 * SAME_S).reduce(common_divisor_s)?;
    let unit = steps.iter().sum::<f64>() / steps.iter().map(|step| (step / coarse).round()).sum::<f64>();
    let is_multiple = |step: &&f64| (*step - unit * (*step / unit).round()).abs() < SAME_S;
    let explained = steps.iter().filter(is_multiple).count() as f64;
    let mean_s = steps.iter().sum::<f64>() / steps.len() as f64;
    // Times of equal spacing are rounded to one of the two multiples beside them.
    let beside = steps.iter().filter(|step| (*step - mean_s).abs() < unit).count() as f64;
    let is_rounded = steps.len() >= MIN_STEPS
        && lengths.len() > 1
        && (MIN_TICK_S..LARGEST_TICK_RATIO * mean_s).contains(&unit)
        && explained.min(beside) > EXPLAINED_RATIO * steps.len() as f64;
    is_rounded.then_some(unit)
}

/// Largest common divisor of two lengths, within the tolerance of a length.
fn common_divisor_s(one: f64, other: f64) -> f64 {
    let (mut large, mut small) = (one.max(other), one.min(other));
    while small > NO_REST_S {
        let rest = large - small * (large / small).round();
        (large, small) = (small, rest.abs());
    }
    large
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tick_of(stamp_s: impl Fn(f64) -> f64) -> Option<f64> {
        tick_s(&Spacing::of((0..400).map(|number| (1e9 * stamp_s(f64::from(number))).round() as i64), None))
    }

    #[test]
    fn stamps_on_a_grid_have_its_tick() {
        let tick = tick_of(|number| (0.05 * number * 64.0).round() / 64.0).unwrap();
        assert!((tick - 1.0 / 64.0).abs() < 1e-5, "{tick}");
        let tick = tick_of(|number| (number / 30.0 * 100.0).floor() / 100.0).unwrap();
        assert!((tick - 0.01).abs() < 1e-5, "{tick}");
        // Milliseconds, a regular camera, one that loses images, and jitter.
        assert_eq!(tick_of(|number| (number / 30.0 * 1000.0).round() / 1000.0), None);
        assert_eq!(tick_of(|number| 0.05 * number), None);
        assert_eq!(tick_of(|number| 0.05 * number + 0.015 * (number % 2.0)), None);
        assert_eq!(tick_of(|number| 0.05 * (number + (number / 7.0).floor())), None);
        assert_eq!(tick_of(|number| 0.05 * number + 0.004 * (number * number * 0.37).sin()), None);
    }
}
