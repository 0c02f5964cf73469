use serde::Serialize;

use crate::geometry::median;

/// Statistics of a series of lengths.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Statistics {
    /// How many.
    pub count: usize,
    /// Mean.
    pub mean: f64,
    /// Median.
    pub median: f64,
    /// Standard deviation about the mean.
    pub std: f64,
    /// Root of the mean square.
    pub rms: f64,
}

impl Statistics {
    /// Of the values, `None` of none.
    pub fn of(values: &[f64]) -> Option<Self> {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let mean_square = values.iter().map(|value| value * value).sum::<f64>() / count;
        let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count;
        let median = median(values.iter().copied())?;
        Some(Self { count: values.len(), mean, median, std: variance.sqrt(), rms: mean_square.sqrt() })
    }
}
