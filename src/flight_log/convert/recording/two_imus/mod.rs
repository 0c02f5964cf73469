//! IMU of a camera beside the IMU of an autopilot: the offset of their clocks, and whether a gimbal moves between them.

mod camera_motion;
mod force_clock;
#[cfg(test)]
mod tests;

pub(super) use self::camera_motion::camera_moves;
pub(super) use self::force_clock::clock_by_forces;
use super::recorded::{Recorded, RecordedImu, rate_hz};
use crate::geometry::seconds_from_ns;
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
