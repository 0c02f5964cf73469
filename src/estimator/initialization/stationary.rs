//! Detection of a stationary vehicle before the window exists: IMU samples of little variance and a constant image.

use nalgebra::Vector3;

use super::bearing::fit_rotation;
use super::checks::{Checklist, Shown};
use super::input::{InitializationFrame, InitializationInput, StationaryEstimate};
use super::selection::shared_bearings;
use crate::sensors::ImuSample;

/// Required duration of the stationary phase.
const QUIET_S: f64 = 1.0;
/// Averaging time of the samples, so that vibration and white noise do not prevent detection.
const BLOCK_NS: i64 = 100_000_000;
/// Largest standard deviation of the averaged angular velocity (worst axis), beyond the sensor noise.
const MAX_GYROSCOPE_STD_RAD_PER_S: f64 = 0.002;
/// Largest standard deviation of the averaged specific force (worst axis), beyond the sensor noise.
const MAX_ACCELEROMETER_STD_M_PER_S2: f64 = 0.03;
/// Largest slow rotation that cannot be separated from a bias within a second; floor of the bias' σ.
const HIDDEN_ANGULAR_RATE_RAD_PER_S: f64 = 0.001;
/// Largest mean angular velocity: above the usual turn-on bias, below a rotation.
const MAX_ANGULAR_RATE_RAD_PER_S: f64 = 0.15;
/// Largest rotation-compensated parallax over the stationary phase.
const MAX_PARALLAX_RAD: f64 = 0.004;

/// Checks the last [`QUIET_S`] seconds; the results go to `checklist`.
pub(super) fn detect(input: &InitializationInput<'_>, checklist: &mut Checklist) -> Option<StationaryEstimate> {
    let newest = input.frames.last()?;
    let begin = newest.stamp_ns - (QUIET_S * 1e9) as i64;
    let frames: Vec<&InitializationFrame<'_>> = input.frames.iter().filter(|frame| frame.stamp_ns >= begin).collect();
    let samples: Vec<&ImuSample> =
        input.frames.iter().flat_map(|frame| frame.imu).filter(|sample| sample.stamp_ns >= begin).collect();
    let covered = samples.first().is_some_and(|first| first.stamp_ns < begin + 50_000_000);
    if samples.len() < 20 || !covered || frames.len() < 3 {
        return None;
    }
    let blocks = block_means(&samples);
    let (gyroscope, gyroscope_std) = mean_and_std(blocks.iter().map(|block| block.0));
    let (force, force_std) = mean_and_std(blocks.iter().map(|block| block.1));
    let own = |density: f64| 1.5 * density / (BLOCK_NS as f64 * 1e-9).sqrt();
    let gyroscope_limit = MAX_GYROSCOPE_STD_RAD_PER_S.hypot(own(input.imu_noise.gyroscope_noise_density));
    let force_limit = MAX_ACCELEROMETER_STD_M_PER_S2.hypot(own(input.imu_noise.accelerometer_noise_density));
    let plain = Shown::Plain;
    let subject = "σ of the angular velocity";
    checklist.at_most("stationary gyroscope", subject, gyroscope_std, gyroscope_limit, plain(" rad/s"));
    checklist.at_most(
        "stationary angular rate",
        "mean angular velocity",
        gyroscope.norm(),
        MAX_ANGULAR_RATE_RAD_PER_S,
        plain(" rad/s"),
    );
    let subject = "σ of the specific force";
    checklist.at_most("stationary accelerometer", subject, force_std, force_limit, plain(" m/s²"));
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
        gyroscope_bias_rad_per_s: gyroscope,
        gyroscope_bias_sigma_rad_per_s: HIDDEN_ANGULAR_RATE_RAD_PER_S.hypot(gyroscope_std),
        specific_force_m_per_s2: force,
    })
}

/// Mean angular velocity and specific force of each block of [`BLOCK_NS`].
fn block_means(samples: &[&ImuSample]) -> Vec<(Vector3<f64>, Vector3<f64>)> {
    let begin = samples.first().map_or(0, |sample| sample.stamp_ns);
    samples
        .chunk_by(|a, b| (a.stamp_ns - begin) / BLOCK_NS == (b.stamp_ns - begin) / BLOCK_NS)
        .filter(|block| block.len() > 1)
        .map(|block| {
            let count = block.len() as f64;
            let angular_velocity_sum: Vector3<f64> = block.iter().map(|sample| sample.angular_velocity_rad_per_s).sum();
            let force: Vector3<f64> = block.iter().map(|sample| sample.specific_force_m_per_s2).sum();
            (angular_velocity_sum / count, force / count)
        })
        .collect()
}

/// Mean, and largest standard deviation of the components.
fn mean_and_std(values: impl Iterator<Item = Vector3<f64>> + Clone) -> (Vector3<f64>, f64) {
    let count = values.clone().count().max(1) as f64;
    let mean = values.clone().sum::<Vector3<f64>>() / count;
    let squares: Vector3<f64> = values.map(|value| (value - mean).component_mul(&(value - mean))).sum();
    (mean, (squares / count).max().sqrt())
}
