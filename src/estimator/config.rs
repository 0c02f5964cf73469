//! What an estimator is made from.

use super::options::EstimatorOptions;
use crate::camera::CameraModel;
use crate::flight_log::rig::ImuNoise;
use crate::gimbal::{ClassicalChain, Parameterization};

/// What an estimator is told once.
#[derive(Clone, Debug)]
pub struct EstimatorConfig {
    /// The camera that it watches.
    pub camera: CameraModel,
    /// Noise of the inertial sensor.
    pub imu_noise: ImuNoise,
    /// Magnitude of gravity in m/s².
    pub gravity_m_per_s2: f64,
    /// The mount as given; without links a rigid camera.
    pub chain: ClassicalChain,
    /// The form in which the mount is estimated.
    pub parameterization: Parameterization,
    /// Whether the minimal form may change its chart when it comes near a lock.
    pub auto_chart: bool,
    /// Standard deviation of an encoder reading, `None` without encoders.
    pub encoder_sigma_rad: Option<f64>,
    /// Whether encoder readings are used.
    pub use_encoder: bool,
    /// Whether the mount's static parameters are estimated; joint angles always are.
    pub calibrate: bool,
    /// Standard deviations of the given chain's numbers, in metres and radians; `None` for [`DEFAULT_CHAIN_PRIOR`].
    pub chain_prior: Option<(f64, f64)>,
    /// Tunables.
    pub options: EstimatorOptions,
    /// Milliseconds of a clock that only runs forward, for the stage times of the reports.
    pub clock_ms: fn() -> f64,
}

/// What a calibration that says nothing about its quality is taken to be worth, per number: 5 mm and 0.5°.
pub const DEFAULT_CHAIN_PRIOR: (f64, f64) = (0.005, 0.0087);

impl EstimatorConfig {
    /// Whether encoder readings with a known noise are there to be used.
    pub(super) fn encoder_in_use(&self) -> Option<f64> {
        self.encoder_sigma_rad.filter(|_| self.use_encoder)
    }
}
