//! Pose, velocity and IMU biases of a frame, and velocity and biases of the IMU on the gimbal, with their perturbation.
//!
//! Error vectors are ordered `[φ, p, v, b_g, b_a]` (15), with the perturbation rule of [`crate::geometry`].

use nalgebra::{SMatrix, SVector, Vector3};

use super::layout::VELOCITY_BIAS;
use crate::geometry::RigidTransform;

/// Matrix ordered `[φ, p, v, b_g, b_a]`.
pub type Matrix15 = SMatrix<f64, 15, 15>;

/// Vector ordered `[φ, p, v, b_g, b_a]`.
pub type Vector15 = SVector<f64, 15>;

/// Biases of the IMU: measured minus true.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImuBias {
    pub gyroscope_rad_per_s: Vector3<f64>,
    pub accelerometer_m_per_s2: Vector3<f64>,
}

/// Pose, velocity and IMU biases of the vehicle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NavigationState {
    pub world_from_imu: RigidTransform,
    /// Velocity in the world, in m/s.
    pub velocity_m_per_s: Vector3<f64>,
    pub bias: ImuBias,
}

impl NavigationState {
    /// `x ⊞ [φ, p, v, b_g, b_a]`.
    #[must_use]
    pub fn plus(&self, delta: &Vector15) -> Self {
        Self {
            world_from_imu: self.world_from_imu.plus(&delta.fixed_rows::<6>(0).into_owned()),
            velocity_m_per_s: self.velocity_m_per_s + delta.fixed_rows::<3>(6),
            bias: ImuBias {
                gyroscope_rad_per_s: self.bias.gyroscope_rad_per_s + delta.fixed_rows::<3>(9),
                accelerometer_m_per_s2: self.bias.accelerometer_m_per_s2 + delta.fixed_rows::<3>(12),
            },
        }
    }

    /// Difference `self ⊟ origin` (15 × 1), in the order of [`Vector15`].
    pub fn minus(&self, origin: &Self) -> Vector15 {
        let mut delta = Vector15::zeros();
        delta.fixed_rows_mut::<6>(0).copy_from(&self.world_from_imu.minus(&origin.world_from_imu));
        delta.fixed_rows_mut::<3>(6).copy_from(&(self.velocity_m_per_s - origin.velocity_m_per_s));
        delta.fixed_rows_mut::<3>(9).copy_from(&(self.bias.gyroscope_rad_per_s - origin.bias.gyroscope_rad_per_s));
        delta
            .fixed_rows_mut::<3>(12)
            .copy_from(&(self.bias.accelerometer_m_per_s2 - origin.bias.accelerometer_m_per_s2));
        delta
    }
}

/// Unknowns of the IMU on the gimbal at a frame, in the order `[v, b_g, b_a]`; its pose follows from vehicle, joints and
/// chain.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GimbalImuState {
    /// Velocity of the IMU in the world, in m/s.
    pub velocity_m_per_s: Vector3<f64>,
    pub bias: ImuBias,
}

impl GimbalImuState {
    /// `x + [v, b_g, b_a]`.
    pub(crate) fn plus(&self, delta: &[f64]) -> Self {
        let three = |from: usize| Vector3::from_column_slice(&delta[from..from + 3]);
        Self {
            velocity_m_per_s: self.velocity_m_per_s + three(0),
            bias: ImuBias {
                gyroscope_rad_per_s: self.bias.gyroscope_rad_per_s + three(3),
                accelerometer_m_per_s2: self.bias.accelerometer_m_per_s2 + three(6),
            },
        }
    }

    /// `self − origin` in the same order.
    pub(crate) fn minus(&self, origin: &Self) -> [f64; VELOCITY_BIAS] {
        let velocity = self.velocity_m_per_s - origin.velocity_m_per_s;
        let gyroscope = self.bias.gyroscope_rad_per_s - origin.bias.gyroscope_rad_per_s;
        let accelerometer = self.bias.accelerometer_m_per_s2 - origin.bias.accelerometer_m_per_s2;
        let mut all = velocity.iter().chain(&gyroscope).chain(&accelerometer);
        std::array::from_fn(|_| all.next().copied().unwrap_or(0.0))
    }
}
