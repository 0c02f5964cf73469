//! Options of the estimator that a run specification changes, to study their effect.

use std::ops::RangeInclusive;

use crate::estimator::EstimatorConfig;
use crate::optimization::RobustLoss;

/// Range of a factor on a standard deviation.
const FACTORS: RangeInclusive<f64> = 1e-3..=1e3;
/// Range of the scale of a robust loss, in standard deviations.
const LOSS_SCALES: RangeInclusive<f64> = 0.05..=100.0;
/// Range of the iterations of a solve.
const ITERATIONS: RangeInclusive<usize> = 1..=100;

/// Deviations from the estimator's default options. Keys of a specification; a fork uses the same keys where it has
/// them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EstimatorTuning {
    /// Factor on the standard deviation of a tracked pixel (`pixel-noise=2`).
    pub pixel_noise: f64,
    /// Factor on the noise densities of the IMU (`imu-noise=2`).
    pub imu_noise: f64,
    /// Factor on the standard deviation of the encoders (`encoder-noise=2`).
    pub encoder_noise: f64,
    /// Robust loss of the visual residuals, `None` for the default (`loss=none`, `loss=huber-1.5`, `loss=cauchy-2`).
    pub loss: Option<RobustLoss>,
    /// Largest number of iterations of a solve, `None` for the default (`iterations=12`).
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
    pub(super) const KEYS: [&'static str; 5] = ["pixel-noise", "imu-noise", "encoder-noise", "loss", "iterations"];

    /// Parses and sets the value of one of [`Self::KEYS`]; the error states the expected value.
    pub(super) fn set(&mut self, key: &str, value: &str) -> Result<(), String> {
        let factor = || {
            let factor = value.parse::<f64>().ok().filter(|factor| FACTORS.contains(factor));
            factor.ok_or_else(|| format!("{key} is '{value}', expected a factor from 0.001 to 1000"))
        };
        match key {
            "pixel-noise" => self.pixel_noise = factor()?,
            "imu-noise" => self.imu_noise = factor()?,
            "encoder-noise" => self.encoder_noise = factor()?,
            "loss" => self.loss = Some(read_loss(value)?),
            _ => self.iterations = Some(read_count(key, value, &ITERATIONS)?),
        }
        Ok(())
    }

    /// Keys with their values, without defaults.
    pub(super) fn options(&self) -> impl Iterator<Item = String> {
        let factors =
            [("pixel-noise", self.pixel_noise), ("imu-noise", self.imu_noise), ("encoder-noise", self.encoder_noise)];
        let factors = factors.into_iter().filter(|(_, factor)| *factor != 1.0);
        let factors = factors.map(|(key, factor)| format!("{key}={factor}"));
        let loss = self.loss.map(|loss| format!("loss={}", loss_text(loss)));
        factors.chain(loss).chain(self.iterations.map(|count| format!("iterations={count}")))
    }

    /// Applies the options to a configuration.
    pub(in crate::session) fn apply(&self, config: &mut EstimatorConfig) {
        let options = &mut config.options;
        options.pixel_sigma_px *= self.pixel_noise;
        options.imu_noise_factor *= self.imu_noise;
        options.loss = self.loss.unwrap_or(options.loss);
        options.iterations = self.iterations.unwrap_or(options.iterations);
        config.encoder_sigma_rad = config.encoder_sigma_rad.map(|sigma_rad| sigma_rad * self.encoder_noise);
    }
}

/// Parses the value of a key as an integer within a range; the error states the expected value.
pub(super) fn read_count(key: &str, value: &str, range: &RangeInclusive<usize>) -> Result<usize, String> {
    value.parse().ok().filter(|count| range.contains(count)).ok_or_else(|| {
        let (low, high) = (range.start(), range.end());
        format!("{key} is '{value}', expected a number from {low} to {high}")
    })
}

fn read_loss(value: &str) -> Result<RobustLoss, String> {
    let scaled = |text: &str| text.parse::<f64>().ok().filter(|scale| LOSS_SCALES.contains(scale));
    let loss = match value.split_once('-') {
        None if value == "none" => Some(RobustLoss::None),
        Some(("huber", scale)) => scaled(scale).map(RobustLoss::Huber),
        Some(("cauchy", scale)) => scaled(scale).map(RobustLoss::Cauchy),
        _ => None,
    };
    loss.ok_or_else(|| {
        format!("loss is '{value}', expected none, huber-K or cauchy-K with K from 0.05 to 100 σ, as in huber-1.5")
    })
}

fn loss_text(loss: RobustLoss) -> String {
    match loss {
        RobustLoss::None => "none".to_owned(),
        RobustLoss::Huber(scale) => format!("huber-{scale}"),
        RobustLoss::Cauchy(scale) => format!("cauchy-{scale}"),
    }
}
