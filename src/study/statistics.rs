//! Intervals of paired differences.

use crate::geometry::t_quantile;

/// Mean of paired differences with its confidence interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeanInterval {
    pub pairs: usize,
    pub mean: f64,
    /// Lower limit of the two-sided 95 % interval of the mean.
    pub low: f64,
    /// Upper limit of the same interval.
    pub high: f64,
}

/// Probability beyond each end of a two-sided interval.
const TAIL: f64 = 0.025;

impl MeanInterval {
    /// Student's t interval of the mean, for independent differences with a normally distributed mean. `None` for fewer
    /// than two.
    pub fn of(differences: &[f64]) -> Option<Self> {
        let pairs = differences.len();
        if pairs < 2 {
            return None;
        }
        let count = pairs as f64;
        let mean = differences.iter().sum::<f64>() / count;
        let square = differences.iter().map(|difference| (difference - mean).powi(2)).sum::<f64>();
        let half = t_quantile(1.0 - TAIL, count - 1.0) * (square / (count - 1.0) / count).sqrt();
        Some(Self { pairs, mean, low: mean - half, high: mean + half })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_hold_the_mean_in_95_of_100_cases() {
        let mut random = crate::geometry::SplitMix64::new(3);
        let mut normal = || (0..12).map(|_| random.next_unit()).sum::<f64>() - 6.0;
        let holds = |_: &usize| {
            let differences: Vec<f64> = (0..8).map(|_| 0.3 + 0.1 * normal()).collect();
            let interval = MeanInterval::of(&differences).unwrap();
            interval.low <= 0.3 && 0.3 <= interval.high
        };
        let held = (0..1000).filter(holds).count();
        assert!((925..=970).contains(&held), "{held} of 1000");
        assert_eq!(MeanInterval::of(&[0.1]), None);
        let equal = MeanInterval::of(&[0.5; 3]).unwrap();
        assert_eq!((equal.low, equal.mean, equal.high), (0.5, 0.5, 0.5));
    }
}
