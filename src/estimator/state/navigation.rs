//! Pose, velocity and IMU biases of a frame, with their perturbation.
//!
//! Error vectors are ordered `[φ, p, v, b_g, b_a]` (15), with the perturbation rule of [`crate::geometry`].

use nalgebra::{SMatrix, SVector, Vector3};

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

    /// `self ⊟ origin`.
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
