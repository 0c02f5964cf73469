//! Random numbers of the tests.

use nalgebra::Vector3;

use crate::geometry::SplitMix64;

pub(in crate::calibration) struct Random(SplitMix64);

impl Random {
    pub(in crate::calibration) fn new(seed: u64) -> Self {
        Self(SplitMix64::new(seed))
    }

    /// Uniform within ±1.
    pub(in crate::calibration) fn next(&mut self) -> f64 {
        2.0 * self.0.next_unit() - 1.0
    }

    pub(in crate::calibration) fn vector(&mut self, scale: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.next()) * scale
    }

    /// Approximately normal with this standard deviation.
    pub(in crate::calibration) fn normal(&mut self, sigma: f64) -> f64 {
        (0..12).map(|_| 0.5 * self.next()).sum::<f64>() * sigma
    }
}
