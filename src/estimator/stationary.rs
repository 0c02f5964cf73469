//! Stationary test of initialization and window: small spread of the IMU samples, and constant images.

use nalgebra::Vector3;

use crate::geometry::{mean, standard_deviation};
use crate::sensors::{ImuNoise, ImuSample};

/// Time for which a vehicle must be stationary.
pub(crate) const QUIET_NS: i64 = 1_000_000_000;
/// Largest rotation-compensated parallax of a stationary vehicle.
pub(crate) const MAX_PARALLAX_RAD: f64 = 0.004;
/// Largest standard deviation of the averaged angular velocity (worst axis), beyond the sensor noise.
const MAX_ANGULAR_RATE_SPREAD_RAD_PER_S: f64 = 0.002;
/// Largest standard deviation of the averaged specific force (worst axis), beyond the sensor noise.
const MAX_FORCE_SPREAD_M_PER_S2: f64 = 0.03;

/// Mean of the IMU samples of a short interval: vibration and white noise average out.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ImuAverage {
    pub(crate) angular_velocity_rad_per_s: Vector3<f64>,
    pub(crate) specific_force_m_per_s2: Vector3<f64>,
}

impl ImuAverage {
    /// Mean of at least one sample.
    pub(crate) fn of(samples: &[&ImuSample]) -> Self {
        let count = samples.len() as f64;
        let angular_velocity: Vector3<f64> = samples.iter().map(|sample| sample.angular_velocity_rad_per_s).sum();
        let force: Vector3<f64> = samples.iter().map(|sample| sample.specific_force_m_per_s2).sum();
        Self { angular_velocity_rad_per_s: angular_velocity / count, specific_force_m_per_s2: force / count }
    }
}

/// Mean of successive averages, and their standard deviations (worst axis) with the limits of a stationary vehicle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ImuSpread {
    pub(crate) mean: ImuAverage,
    pub(crate) angular_rate: f64,
    pub(crate) angular_rate_limit: f64,
    pub(crate) force: f64,
    pub(crate) force_limit: f64,
}

impl ImuSpread {
    /// Spread of averages over `averaged_s` each.
    pub(crate) fn of(averages: &[ImuAverage], averaged_s: f64, noise: &ImuNoise) -> Self {
        let rates: Vec<Vector3<f64>> = averages.iter().map(|average| average.angular_velocity_rad_per_s).collect();
        let forces: Vec<Vector3<f64>> = averages.iter().map(|average| average.specific_force_m_per_s2).collect();
        let of_sensor = |density: f64| 1.5 * density / averaged_s.max(1e-3).sqrt();
        Self {
            mean: ImuAverage { angular_velocity_rad_per_s: mean(&rates), specific_force_m_per_s2: mean(&forces) },
            angular_rate: standard_deviation(&rates).max(),
            angular_rate_limit: MAX_ANGULAR_RATE_SPREAD_RAD_PER_S.hypot(of_sensor(noise.gyroscope_noise_density)),
            force: standard_deviation(&forces).max(),
            force_limit: MAX_FORCE_SPREAD_M_PER_S2.hypot(of_sensor(noise.accelerometer_noise_density)),
        }
    }
}
