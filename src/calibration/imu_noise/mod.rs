//! Fit of the noise densities of an IMU to a flight.
//!
//! The estimator runs over the tracked images; the densities of gyroscope and accelerometer are scaled until the
//! squared residuals of their factors (NIS) equal their degrees of freedom ([`innovations`]), by Fisher scoring on the
//! logarithm of each variance: `Δ ln σ² = (χ² − dof) / tr(R R)`. This is the estimation of variance components by
//! restricted maximum likelihood (Förstner 1979; Koch 1986), and `tr(R R)/2` the information of `ln σ²`.

mod innovations;
#[cfg(test)]
mod tests;

use std::ops::ControlFlow;

pub use self::innovations::NoiseDensity;
use self::innovations::{InnovationSums, Innovations};
use super::input::TrackedView;
use crate::estimator::{Estimator, EstimatorConfig, StepInput, VisualLoss};
use crate::geometry::seconds_from_ns;
use crate::optimization::RobustLoss;
use crate::sensors::ImuNoise;
use crate::text::Named as _;

const MAX_RUNS: usize = 12;
/// First run in which random walks are fitted too.
const FIRST_WALK_RUN: usize = 4;
/// Convergence threshold: change of each density relative to its standard deviation.
const CONVERGED_SIGMAS: f64 = 0.2;
/// Convergence threshold: relative change of the noise of the observations.
const PIXEL_CONVERGED: f64 = 0.02;
/// Largest change of the logarithm of a variance in one run.
const LARGEST_STEP: f64 = 2.8;
/// Relative standard deviation below which a density is fitted.
const LARGEST_RELATIVE_SIGMA: f64 = 0.5;
/// Deviation of χ² above which a density is inconsistent, in standard deviations.
const CONTRADICTION_SIGMAS: f64 = 3.0;
/// Loss of the observations: quadratic for noise, so that their information matches their noise, which is fitted too.
const LOSS: RobustLoss = RobustLoss::Huber(3.0);
/// Interval of the steps whose residuals are used; an IMU interval stays in the window for longer.
const STRIDE: usize = 3;
/// Smallest number of intervals for a fit.
const FEWEST_INTERVALS: usize = 20;

/// Noise density before and after the fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FittedDensity {
    pub density: NoiseDensity,
    pub given: f64,
    /// Value at which the residuals agree with their degrees of freedom; the given one if the flight does not constrain
    /// it.
    pub found: f64,
    /// Standard deviation of `found`; `None` if the flight does not constrain it.
    pub sigma: Option<f64>,
    /// Squared whitened residuals per degree of freedom with the given density.
    pub nis_before: f64,
    /// Squared whitened residuals per degree of freedom with the fitted density.
    pub nis_after: f64,
    /// Degrees of freedom of the residuals after the fit.
    pub degrees_of_freedom: f64,
}

#[derive(Clone, Debug, PartialEq)]
pub struct FlightNoise {
    /// Densities in the order of [`NoiseDensity::NAMES`].
    pub densities: [FittedDensity; 4],
    /// Start and end of the used intervals, in nanoseconds since the start of the log.
    pub span_ns: (i64, i64),
    /// Number of intervals between two keyframes.
    pub intervals: usize,
    /// Mean length of the intervals.
    pub mean_interval_s: f64,
    /// Standard deviation of an observation with which the residuals agree, in pixels.
    pub pixel_sigma_px: f64,
    pub runs: usize,
    /// True if the last change was smaller than a fifth of each standard deviation.
    pub converged: bool,
}

/// Reason for the failure of a fit.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ImuNoiseError {
    #[error(
        "the estimator has {intervals} intervals between keyframes with images on both sides, {FEWEST_INTERVALS} are needed"
    )]
    TooShort { intervals: usize },
    #[error("interrupted")]
    Interrupted,
}

/// Fits the noise densities to a flight, starting from the densities of `config`; calls `on_progress` with a fraction
/// from 0 to 1.
///
/// # Errors
/// If the flight is too short, or if `on_progress` breaks.
pub fn fit_imu_noise(
    config: &EstimatorConfig,
    views: &[TrackedView],
    on_progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<FlightNoise, ImuNoiseError> {
    let mut noise = config.imu_noise;
    let mut config = config.clone();
    config.options.loss = VisualLoss::Fixed(LOSS);
    let mut before = None;
    let mut converged = false;
    let mut run = 0;
    let last = loop {
        let found =
            measure(&config, noise, views, &mut |fraction| on_progress((run as f64 + fraction) / MAX_RUNS as f64))?;
        if found.intervals < FEWEST_INTERVALS {
            return Err(ImuNoiseError::TooShort { intervals: found.intervals });
        }
        before.get_or_insert(found.sums);
        run += 1;
        if converged || run == MAX_RUNS {
            break found;
        }
        let pixel_ratio = (found.visual.0 / found.visual.1.max(1.0)).clamp(0.05, 20.0).sqrt();
        config.options.pixel_sigma_px *= pixel_ratio;
        converged = (pixel_ratio - 1.0).abs() < PIXEL_CONVERGED && run >= FIRST_WALK_RUN;
        for (density, sums) in NoiseDensity::all().zip(&found.sums) {
            // White noise that is far too small would be fitted as a random walk.
            let waits = density.is_random_walk() && run < FIRST_WALK_RUN;
            if waits || !is_shown(sums) && (density.is_random_walk() || !is_wrong(sums)) {
                continue;
            }
            let step = ((sums.chi2 - sums.freedom) / sums.information.max(1e-9)).clamp(-LARGEST_STEP, LARGEST_STEP);
            converged &= step.abs() < CONVERGED_SIGMAS * variance_sigma(sums);
            *value(&mut noise, density) *= (0.5 * step).exp();
        }
    };
    let before = before.unwrap_or_default();
    let mut given = config.imu_noise;
    let densities = [0, 1, 2, 3].map(|index| {
        let density = NoiseDensity::NAMES[index].0;
        let (sums, found, given) = (&last.sums[index], *value(&mut noise, density), *value(&mut given, density));
        FittedDensity {
            density,
            given,
            found,
            sigma: (is_shown(sums) || found != given).then(|| 0.5 * variance_sigma(sums) * found),
            nis_before: before[index].chi2 / before[index].freedom,
            nis_after: sums.chi2 / sums.freedom,
            degrees_of_freedom: sums.freedom,
        }
    });
    Ok(FlightNoise {
        densities,
        span_ns: last.span_ns.unwrap_or_default(),
        intervals: last.intervals,
        mean_interval_s: seconds_from_ns(last.length_ns) / last.intervals as f64,
        pixel_sigma_px: config.options.pixel_sigma_px,
        runs: run,
        converged,
    })
}

/// Standard deviation of the logarithm of a variance.
fn variance_sigma(sums: &InnovationSums) -> f64 {
    (2.0 / sums.information.max(1e-9)).sqrt()
}

/// True if the flight constrains a density to better than half its value.
fn is_shown(sums: &InnovationSums) -> bool {
    0.5 * variance_sigma(sums) < LARGEST_RELATIVE_SIGMA
}

/// True if the residuals are inconsistent with a density that the flight hardly constrains, for instance a much too
/// small one.
fn is_wrong(sums: &InnovationSums) -> bool {
    (sums.chi2 - sums.freedom).abs() > CONTRADICTION_SIGMAS * (2.0 * sums.information).sqrt()
}

fn value(noise: &mut ImuNoise, density: NoiseDensity) -> &mut f64 {
    match density {
        NoiseDensity::Gyroscope => &mut noise.gyroscope_noise_density,
        NoiseDensity::Accelerometer => &mut noise.accelerometer_noise_density,
        NoiseDensity::GyroscopeWalk => &mut noise.gyroscope_random_walk,
        NoiseDensity::AccelerometerWalk => &mut noise.accelerometer_random_walk,
    }
}

fn measure(
    config: &EstimatorConfig,
    imu_noise: ImuNoise,
    views: &[TrackedView],
    on_progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Innovations, ImuNoiseError> {
    let mut estimator = Estimator::new(EstimatorConfig { imu_noise, ..config.clone() });
    estimator.set_keep_factor_rows();
    let mut innovations = Innovations::default();
    for (index, view) in views.iter().enumerate() {
        if on_progress(index as f64 / views.len() as f64).is_break() {
            return Err(ImuNoiseError::Interrupted);
        }
        estimator.set_keep_linearization(index % STRIDE == 0);
        let report = estimator.step(&StepInput {
            frame_index: view.frame_index,
            stamp_ns: view.stamp_ns,
            imu: &view.imu,
            imu_after: &[],
            image_times_s: &[],
            gimbal_imu: &[],
            joint_angles: view.joint_angles.as_ref(),
            tracks: &view.tracks,
            further_tracks: &[],
        });
        innovations.take(&report);
    }
    Ok(innovations)
}
