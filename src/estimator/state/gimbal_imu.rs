//! Velocity and biases of the IMU on the gimbal.

use nalgebra::Vector3;

use super::layout::VELOCITY_BIAS;
use super::navigation::ImuBias;

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
