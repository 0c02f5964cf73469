//! Success rates with their intervals.

use serde::Serialize;

/// Success rate of a number of runs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SuccessRate {
    pub successes: usize,
    pub runs: usize,
    /// Rate in 0 to 1, 0 without runs.
    pub rate: f64,
    /// Lower end of the 95 % interval.
    pub low: f64,
    /// Upper end of the 95 % interval.
    pub high: f64,
}

/// Two-sided 95 % quantile of the normal distribution.
const Z: f64 = 1.959_963_984_540_054;

/// The rate with Wilson's score interval (Wilson 1927), which stays within 0 and 1 and is valid for few runs and for
/// rates near 0 or 1.
pub fn success_rate(successes: usize, runs: usize) -> SuccessRate {
    if runs == 0 {
        return SuccessRate { successes, runs, rate: 0.0, low: 0.0, high: 1.0 };
    }
    let (count, rate) = (runs as f64, successes as f64 / runs as f64);
    let scale = 1.0 / (1.0 + Z * Z / count);
    let center = scale * (rate + Z * Z / (2.0 * count));
    let half = scale * Z * (rate * (1.0 - rate) / count + Z * Z / (4.0 * count * count)).sqrt();
    // The ends are set exactly where rounding would miss 0 or 1.
    let low = if successes == 0 { 0.0 } else { (center - half).max(0.0) };
    let high = if successes == runs { 1.0 } else { (center + half).min(1.0) };
    SuccessRate { successes, runs, rate, low, high }
}
