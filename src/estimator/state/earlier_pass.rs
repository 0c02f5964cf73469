//! Passes over the same measurements: what one finds of calibration and biases is the prior of the next.

use nalgebra::{DMatrix, Vector3};

use super::navigation::ImuBias;
use crate::gimbal::{Chain, ParameterId};

/// Result of a pass over the measurements, as prior of the next pass.
#[derive(Clone, Debug)]
pub struct EarlierPass {
    /// By camera, the main one first.
    pub(crate) cameras: Vec<FoundCamera>,
    /// Biases of the IMU at the start of the log.
    pub(crate) bias: BiasPrior,
}

/// Calibration of one camera at the end of a pass.
#[derive(Clone, Debug)]
pub(crate) struct FoundCamera {
    /// Chain with the columns of the covariance.
    pub(crate) chain: Chain,
    /// Prior covariance of all columns.
    pub(crate) covariance: DMatrix<f64>,
    /// Estimated time offsets, shutter and intrinsics, relative to the rig's values.
    pub(crate) sensors: Vec<(ParameterId, f64)>,
}

/// Prior of the IMU biases at one time of the log.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BiasPrior {
    pub mean: ImuBias,
    /// Standard deviation of the gyroscope bias by axis, in rad/s.
    pub gyroscope_sigma_rad_per_s: Vector3<f64>,
    /// Standard deviation of the accelerometer bias by axis, in m/s².
    pub accelerometer_sigma_m_per_s2: Vector3<f64>,
}

impl BiasPrior {
    /// The same biases after (or before) a time in which they walk at random, with noise densities in rad/s²/√Hz and
    /// m/s³/√Hz.
    pub(crate) fn after(self, duration_s: f64, gyroscope_random_walk: f64, accelerometer_random_walk: f64) -> Self {
        let walk = duration_s.abs().sqrt();
        Self {
            gyroscope_sigma_rad_per_s: self.gyroscope_sigma_rad_per_s.map(|it| it.hypot(gyroscope_random_walk * walk)),
            accelerometer_sigma_m_per_s2: self
                .accelerometer_sigma_m_per_s2
                .map(|sigma| sigma.hypot(accelerometer_random_walk * walk)),
            ..self
        }
    }
}

impl EarlierPass {
    /// Takes the bias prior of `other`, from another time of the same pass, if its accelerometer bias is more certain.
    #[must_use]
    pub fn with_best_bias(self, other: &Self) -> Self {
        let uncertainty = |bias: &BiasPrior| bias.accelerometer_sigma_m_per_s2.norm();
        let bias = if uncertainty(&other.bias) < uncertainty(&self.bias) { other.bias } else { self.bias };
        Self { bias, ..self }
    }
}
