//! IMU of a camera beside the IMU of an autopilot: the offset of their clocks, and whether a gimbal moves between them.

mod force_clock;
#[cfg(test)]
mod tests;

use nalgebra::Vector3;

pub(super) use self::force_clock::clock_by_forces;
use super::recorded::{Recorded, RecordedImu, rate_hz};
use crate::geometry::{best_rotation, mean, seconds_from_ns};
use crate::sensors::AngularRates;

/// IMU of the autopilot that becomes the first of the log, or the only IMU of a camera; `None` without one.
pub(super) fn first_imu(recorded: &Recorded) -> Option<&RecordedImu> {
    let rate = |imu: &RecordedImu| rate_hz(&imu.combined).max(rate_hz(&imu.gyroscope));
    let own = recorded.imus.values().rev().filter(|imu| !imu.is_of_other_device);
    own.max_by(|one, other| rate(one).total_cmp(&rate(other)))
}

/// Angular rates at times in seconds since `origin_ns`.
fn rates(imu: &RecordedImu, origin_ns: i64) -> AngularRates {
    let since = |time_ns: i64| seconds_from_ns(time_ns.saturating_sub(origin_ns));
    let combined = imu.combined.iter().map(|(time_ns, [rate, _])| (since(*time_ns), *rate));
    let apart = imu.gyroscope.iter().map(|(time_ns, rate)| (since(*time_ns), *rate));
    if imu.combined.is_empty() { AngularRates::new(apart) } else { AngularRates::new(combined) }
}

/// Length of the averaged angular rates that are compared, in seconds, and their smallest number.
const RATE_S: f64 = 0.1;
const MIN_RATES: usize = 50;
/// Difference of the angular rates of two IMUs on one body, in rad/s: noise, and flexible mounts.
const RIGID_RAD_PER_S: f64 = 0.05;
/// Ratio of their squared difference to the squared rates up to which they are on one body.
const RIGID_RATIO: f64 = 0.2;

/// True if the camera rotates relative to the vehicle, false if both IMUs are on one body; `None` if they rotate too little
/// or overlap too briefly. Both have the times of the log.
pub(in crate::flight_log::convert::recording) fn camera_moves(
    vehicle: &RecordedImu,
    camera: &RecordedImu,
) -> Option<bool> {
    let origin_ns = vehicle.combined.first().map(|(time_ns, _)| *time_ns);
    let origin_ns = origin_ns.or_else(|| vehicle.gyroscope.first().map(|(time_ns, _)| *time_ns))?;
    let (vehicle, camera) = (rates(vehicle, origin_ns), rates(camera, origin_ns));
    let (from_s, to_s) = (vehicle.range_s()?.0.max(camera.range_s()?.0), vehicle.range_s()?.1.min(camera.range_s()?.1));
    let count = ((to_s - from_s) / RATE_S).floor().max(0.0) as usize;
    let pair = |place: usize| {
        let from_s = from_s + place as f64 * RATE_S;
        let mean = |rates: &AngularRates| Some(rates.angle_between(from_s, from_s + RATE_S)? / RATE_S);
        Some((mean(&vehicle)?, mean(&camera)?))
    };
    let pairs: Vec<(Vector3<f64>, Vector3<f64>)> = (0..count).filter_map(pair).collect();
    if pairs.len() < MIN_RATES {
        return None;
    }
    let (of_vehicle, of_camera): (Vec<_>, Vec<_>) = pairs.iter().copied().unzip();
    let (vehicle_mean, camera_mean) = (mean(&of_vehicle), mean(&of_camera));
    // Biases of both gyroscopes are no evidence.
    let centred: Vec<_> = pairs.iter().map(|pair| (pair.0 - vehicle_mean, pair.1 - camera_mean)).collect();
    let (camera_from_vehicle, _) = best_rotation(&centred)?;
    let mean_square = |sum: f64| sum / centred.len() as f64;
    let of_vehicle = mean_square(centred.iter().map(|pair| pair.0.norm_squared()).sum());
    let of_camera = mean_square(centred.iter().map(|pair| pair.1.norm_squared()).sum());
    let differences = centred.iter().map(|pair| (pair.1 - camera_from_vehicle * pair.0).norm_squared());
    let (largest, difference) = (of_vehicle.max(of_camera), mean_square(differences.sum()));
    let rotates = largest > RIGID_RAD_PER_S * RIGID_RAD_PER_S;
    rotates.then_some(difference > RIGID_RAD_PER_S * RIGID_RAD_PER_S && difference > RIGID_RATIO * largest)
}
