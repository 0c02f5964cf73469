//! Repeated passes over the same measurements: calibration and biases of one pass are the prior of the next.

use nalgebra::{DMatrix, Vector3};

use super::estimator::{Estimator, PhaseState};
use super::preintegration::ImuBias;
use super::window::solver;
use crate::gimbal::{ClassicalChain, ParameterId, Parameterization};

/// Factor on the standard deviations of a pass when they become the prior of the next.
///
/// Each pass uses the measurements again. With a factor k the information of the last pass is that of the measurements
/// times 1 + 1/k² + 1/k⁴ + …: at most 4/3 for k = 2, so its standard deviations are too small by at most 13 %.
const SIGMA_FACTOR: f64 = 2.0;

/// Result of a pass over the measurements, as prior of the next pass.
#[derive(Clone, Debug)]
pub struct EarlierPass {
    /// Cameras, main camera first.
    pub(super) cameras: Vec<FoundCamera>,
    /// Biases of the IMU at the start of the log.
    pub(super) bias: BiasPrior,
}

/// Calibration of one camera at the end of a pass.
#[derive(Clone, Debug)]
pub(crate) struct FoundCamera {
    pub(crate) chain: ClassicalChain,
    pub(crate) parameterization: Parameterization,
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
    /// Prior after (or before) a duration of random walk, with noise densities in rad/s²/√Hz and
    /// m/s³/√Hz.
    fn after(self, duration_s: f64, gyroscope_random_walk: f64, accelerometer_random_walk: f64) -> Self {
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

impl Estimator {
    /// Prior of another pass over the measurements from the current estimate: calibration with its covariance, and
    /// biases at
    /// the start of the log, `duration_s` before the newest image. Standard deviations are doubled.
    /// `None` before the first window, and if the information is not positive definite.
    ///
    /// The intrinsics of the IMU are not included: they restart at the rig's prior.
    pub fn findings(&self, duration_s: f64) -> Option<EarlierPass> {
        let PhaseState::Tracking(window) = &self.phase else { return None };
        let covariances = solver::covariances(&self.setup, &window.state)?;
        let calibrations = &window.state.calibration;
        let cameras = (0..calibrations.cameras()).map(|camera| {
            let columns = calibrations.columns(camera);
            let covariance = covariances.calibration.view_range(columns.clone(), columns).into_owned();
            calibrations.of(camera).next_pass_prior(&covariance, SIGMA_FACTOR.powi(-2))
        });
        let mean = window.state.frames.newest().state.navigation.bias;
        let sigma = covariances.newest_bias.diagonal().map(|variance| SIGMA_FACTOR * variance.max(0.0).sqrt());
        let bias = BiasPrior {
            mean,
            gyroscope_sigma_rad_per_s: sigma.fixed_rows::<3>(0).into_owned(),
            accelerometer_sigma_m_per_s2: sigma.fixed_rows::<3>(3).into_owned(),
        };
        let noise = &self.setup.imu_noise;
        Some(EarlierPass {
            cameras: cameras.collect::<Option<_>>()?,
            bias: bias.after(duration_s, noise.gyroscope_random_walk, noise.accelerometer_random_walk),
        })
    }
}
