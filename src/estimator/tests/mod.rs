//! Tests of the estimator.

mod clocks;
mod cluster;
mod consistency;

mod factors;
mod fixture;
mod flight;
mod gain;
mod gimbal_imu;
mod jacobian;
mod keyframes;
mod packed;
mod preintegration;
mod sensors;
mod sliding;
mod stationary;
mod stereo;
mod trouble;
mod window;

use nalgebra::Vector3;

use crate::geometry::SplitMix64;

/// Seeded uniform and normal numbers (Box–Muller).
pub(super) struct Noise(SplitMix64);

impl Noise {
    pub(super) fn new(seed: u64) -> Self {
        Self(SplitMix64::new(seed))
    }

    /// Uniform in (0, 1).
    pub(super) fn uniform(&mut self) -> f64 {
        self.0.next_unit() + 1e-17
    }

    /// Standard normal.
    pub(super) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * self.uniform().ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }

    /// Three standard normal numbers.
    pub(super) fn vector(&mut self) -> Vector3<f64> {
        Vector3::new(self.normal(), self.normal(), self.normal())
    }
}
