//! Small statistics over plain numbers.

use crate::geometry::{self, wrap_angle};

/// Number of standard deviations from which a deviation is reported: 0.3 % of sound values exceed it.
pub(super) const SIGNIFICANT_SIGMAS: f64 = 3.0;
/// Median magnitude of a normal number, in standard deviations.
const MEDIAN_PER_SIGMA: f64 = 0.6745;

/// Quantile at `fraction` (0 to 1) of the values, nearest rank; 0 without values.
pub(super) fn percentile(values: &[f64], fraction: f64) -> f64 {
    geometry::quantile(values, fraction).unwrap_or(0.0)
}

/// Length of the range of the middle 80 % of the values.
pub(super) fn middle_range(values: &[f64]) -> f64 {
    percentile(values, 0.9) - percentile(values, 0.1)
}

/// Median; 0 without values.
pub(super) fn median(values: &[f64]) -> f64 {
    geometry::median(values.iter().copied()).unwrap_or(0.0)
}

/// Slope and standard error of `y` over `x` by least squares; zeros for fewer than three points.
pub(super) fn slope(points: &[(f64, f64)]) -> (f64, f64) {
    let count = points.len() as f64;
    if count < 3.0 {
        return (0.0, 0.0);
    }
    let mean_x = points.iter().map(|(x, _)| x).sum::<f64>() / count;
    let mean_y = points.iter().map(|(_, y)| y).sum::<f64>() / count;
    let spread = points.iter().map(|(x, _)| (x - mean_x).powi(2)).sum::<f64>();
    let slope = points.iter().map(|(x, y)| (x - mean_x) * (y - mean_y)).sum::<f64>() / spread.max(f64::MIN_POSITIVE);
    let rest = points.iter().map(|(x, y)| (y - mean_y - slope * (x - mean_x)).powi(2)).sum::<f64>();
    (slope, (rest / (count - 2.0) / spread.max(f64::MIN_POSITIVE)).sqrt())
}

/// Standard deviation of the white part of the readings, from second differences, in their unit; angles in radians
/// repeat after 2π. The median of the differences is insensitive to jumps.
pub(super) fn white_sigma(values: &[f64], wraps: bool) -> f64 {
    let difference = |from: f64, to: f64| if wraps { wrap_angle(to - from) } else { to - from };
    let second: Vec<f64> = values
        .windows(3)
        .map(|three| (difference(three[1], three[2]) - difference(three[0], three[1])).abs())
        .collect();
    // A second difference has six times the variance of a reading.
    percentile(&second, 0.5) / MEDIAN_PER_SIGMA / 6.0_f64.sqrt()
}
