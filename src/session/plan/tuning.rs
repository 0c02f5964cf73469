//! Options of the estimator that a run specification changes, to study their effect.

use crate::estimator::{EstimatorConfig, VisualLoss};
use crate::optimization::RobustLoss;

/// Deviations from the estimator's standard options; meaning and range of each: its row of
/// [`super::run_spec::RunSpec::KEYS`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EstimatorTuning {
    pub pixel_noise: f64,
    pub imu_noise: f64,
    pub encoder_noise: f64,
    /// `None` for the standard loss.
    pub loss: Option<RobustLoss>,
    /// `None` for the standard number.
    pub iterations: Option<usize>,
}

/// Factors are finite, so that equality is reflexive.
impl Eq for EstimatorTuning {}

impl Default for EstimatorTuning {
    fn default() -> Self {
        Self { pixel_noise: 1.0, imu_noise: 1.0, encoder_noise: 1.0, loss: None, iterations: None }
    }
}

impl EstimatorTuning {
    pub(in crate::session) fn apply(&self, config: &mut EstimatorConfig) {
        let options = &mut config.options;
        options.pixel_sigma_px *= self.pixel_noise;
        options.imu_noise_factor *= self.imu_noise;
        options.loss = self.loss.map_or(options.loss, VisualLoss::Fixed);
        options.iterations = self.iterations.unwrap_or(options.iterations);
        config.encoder_sigma_rad = config.encoder_sigma_rad.map(|sigma_rad| sigma_rad * self.encoder_noise);
    }
}
