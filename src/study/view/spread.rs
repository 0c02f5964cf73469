//! Quantiles of a set of values.

use serde::Serialize;

/// Extremes, quartiles and median of values.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    pub count: usize,
    pub min: f64,
    /// First quartile, quantile 0.25.
    pub q1: f64,
    pub median: f64,
    /// Third quartile, quantile 0.75.
    pub q3: f64,
    pub max: f64,
}

impl Spread {
    /// Quantiles of finite values, interpolated linearly between order statistics (type 7 of Hyndman and Fan, the
    /// default of `NumPy` and R); `None` without values.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut sorted: Vec<f64> = values.into_iter().filter(|value| value.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        let (min, max) = (*sorted.first()?, *sorted.last()?);
        let quantile = |fraction: f64| {
            let place = fraction * (sorted.len() - 1) as f64;
            let (below, above) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
            below + (above - below) * place.fract()
        };
        Some(Self { count: sorted.len(), min, q1: quantile(0.25), median: quantile(0.5), q3: quantile(0.75), max })
    }
}
