use serde::Serialize;

use crate::geometry::median;

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Statistics {
    pub count: usize,
    pub mean: f64,
    pub median: f64,
    /// Standard deviation about the mean.
    pub std: f64,
    pub rms: f64,
}

impl Statistics {
    /// Statistics of the values, `None` without values.
    pub fn of(values: &[f64]) -> Option<Self> {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let mean_square = values.iter().map(|value| value * value).sum::<f64>() / count;
        let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count;
        let median = median(values.iter().copied())?;
        Some(Self { count: values.len(), mean, median, std: variance.sqrt(), rms: mean_square.sqrt() })
    }
}
