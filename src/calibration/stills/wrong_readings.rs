//! Readings that contradict the images: the next one by a test against the spread of all others.

use crate::geometry::{SIGMA_PER_MEDIAN, f_survival, median};

/// Probability that any reading of a set of stills is called wrong although all are normally distributed.
const LEVEL: f64 = 0.01;
/// Correction in robust standard deviations from which a reading is wrong before the spread is estimated.
const WRONG_AT_FIRST: f64 = 8.0;

/// Robust standard deviation of the corrections of a joint, in rad; `None` without sets.
pub(super) fn robust_sigma_rad(corrections_rad: &[Vec<f64>], joint: usize) -> Option<f64> {
    Some(SIGMA_PER_MEDIAN * median(corrections_rad.iter().map(|set| set[joint].abs()))?)
}

/// True for each set with a correction far beyond robust standard deviations.
pub(super) fn wrong_at_first(corrections_rad: &[Vec<f64>], sigmas_rad: &[f64]) -> Vec<bool> {
    let far = |(correction, sigma): (&f64, &f64)| correction.abs() > WRONG_AT_FIRST * sigma;
    corrections_rad.iter().map(|set| set.iter().zip(sigmas_rad).any(far)).collect()
}

/// Set with the least probable correction among those whose readings are right so far, if its probability is below
/// [`LEVEL`] over all readings.
///
/// `determined` is the number of corrections of each joint that the data determine, so that the sum of their squares over
/// it is a variance. Each correction is compared with the variance of all others of its joint (externally studentized).
/// Half of the sets stay.
pub(super) fn next_wrong(corrections_rad: &[Vec<f64>], wrong: &[bool], determined: &[f64]) -> Option<usize> {
    let right: Vec<usize> = (0..wrong.len()).filter(|place| !wrong[*place]).collect();
    if 2 * right.len() <= wrong.len() {
        return None;
    }
    let mut least: Option<(f64, usize)> = None;
    for (joint, determined) in determined.iter().enumerate() {
        let squares: f64 = right.iter().map(|place| corrections_rad[*place][joint].powi(2)).sum();
        let others = determined - 1.0;
        for &place in &right {
            let square = corrections_rad[place][joint].powi(2);
            let variance = (squares - square) / others;
            if others >= 1.0 && variance > 0.0 {
                let probability = f_survival(square / variance, 1, others as usize);
                if least.is_none_or(|(least, _)| probability < least) {
                    least = Some((probability, place));
                }
            }
        }
    }
    let tests = right.len() * determined.len();
    least.filter(|(probability, _)| *probability < LEVEL / tests.max(1) as f64).map(|(_, place)| place)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::SplitMix64;

    #[test]
    fn a_gross_error_is_found_and_normal_ones_are_not() {
        let mut false_alarms = 0;
        for seed in 0..100 {
            let mut random = SplitMix64::new(seed);
            // Sum of twelve uniform numbers, close to a normal one.
            let mut normal = || (0..12).map(|_| random.next_unit()).sum::<f64>() - 6.0;
            let mut corrections: Vec<Vec<f64>> = (0..40).map(|_| vec![normal(), normal()]).collect();
            let determined = [39.0, 39.0];
            let none = vec![false; corrections.len()];
            false_alarms += usize::from(next_wrong(&corrections, &none, &determined).is_some());
            corrections[7][1] = 8.0;
            assert_eq!(next_wrong(&corrections, &none, &determined), Some(7), "seed {seed}");
        }
        assert!(false_alarms <= 5, "{false_alarms} false alarms in 100, 1 expected");
    }
}
