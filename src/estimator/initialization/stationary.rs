//! Detection of a stationary vehicle before the window exists: IMU samples of little variance and a constant image.

use super::bearing::fit_rotation;
use super::checks::{Checklist, Shown};
use super::input::{InitializationFrame, InitializationInput, StationaryEstimate};
use super::selection::shared_bearings;
use crate::estimator::stationary::{ImuAverage, ImuSpread, MAX_PARALLAX_RAD, QUIET_NS};
use crate::geometry::seconds_from_ns;
use crate::sensors::ImuSample;

/// Averaging time of the samples.
const BLOCK_NS: i64 = 100_000_000;
/// Largest slow rotation that cannot be separated from a bias within a second; floor of the bias' σ.
const HIDDEN_ANGULAR_RATE_RAD_PER_S: f64 = 0.001;
/// Largest mean angular velocity: above the usual turn-on bias, below a rotation.
const MAX_ANGULAR_RATE_RAD_PER_S: f64 = 0.15;

/// Checks the last [`QUIET_NS`]; the results go to `checklist`.
pub(super) fn detect(input: &InitializationInput<'_>, checklist: &mut Checklist) -> Option<StationaryEstimate> {
    let newest = input.frames.last()?;
    let begin = newest.stamp_ns - QUIET_NS;
    let frames: Vec<&InitializationFrame<'_>> = input.frames.iter().filter(|frame| frame.stamp_ns >= begin).collect();
    let samples: Vec<&ImuSample> =
        input.frames.iter().flat_map(|frame| frame.imu).filter(|sample| sample.stamp_ns >= begin).collect();
    let covered = samples.first().is_some_and(|first| first.stamp_ns < begin + 50_000_000);
    if samples.len() < 20 || !covered || frames.len() < 3 {
        return None;
    }
    let spread = ImuSpread::of(&block_averages(&samples), seconds_from_ns(BLOCK_NS), &input.imu_noise);
    let mean = spread.mean;
    let plain = Shown::Plain;
    let subject = "σ of the angular velocity";
    checklist.at_most("stationary gyroscope", subject, spread.angular_rate, spread.angular_rate_limit, plain(" rad/s"));
    checklist.at_most(
        "stationary angular rate",
        "mean angular velocity",
        mean.angular_velocity_rad_per_s.norm(),
        MAX_ANGULAR_RATE_RAD_PER_S,
        plain(" rad/s"),
    );
    let subject = "σ of the specific force";
    checklist.at_most("stationary accelerometer", subject, spread.force, spread.force_limit, plain(" m/s²"));
    if !checklist.all_passed() {
        return None;
    }
    let pairs = shared_bearings(frames.first()?.features, newest.features);
    let guess = frames.first()?.imu_from_camera.rotation;
    let fit = fit_rotation(&pairs, &(newest.imu_from_camera.rotation.inverse() * guess))?;
    let subject = "parallax within 1 s, rotation compensated";
    checklist.at_most("stationary image", subject, fit.median_parallax_rad, MAX_PARALLAX_RAD, Shown::Degrees);
    checklist.all_passed().then(|| StationaryEstimate {
        stamp_ns: newest.stamp_ns,
        gyroscope_bias_rad_per_s: mean.angular_velocity_rad_per_s,
        gyroscope_bias_sigma_rad_per_s: HIDDEN_ANGULAR_RATE_RAD_PER_S.hypot(spread.angular_rate),
        specific_force_m_per_s2: mean.specific_force_m_per_s2,
    })
}

/// Average of each block of [`BLOCK_NS`].
fn block_averages(samples: &[&ImuSample]) -> Vec<ImuAverage> {
    let begin = samples.first().map_or(0, |sample| sample.stamp_ns);
    samples
        .chunk_by(|a, b| (a.stamp_ns - begin) / BLOCK_NS == (b.stamp_ns - begin) / BLOCK_NS)
        .filter(|block| block.len() > 1)
        .map(ImuAverage::of)
        .collect()
}
