//! Measurements of a recording in SI units, in recorder time.

use std::collections::BTreeMap;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::candidates::{Candidates, Samples};
use crate::flight_log::trajectory::geodesy::Geodetic;
use crate::geometry::seconds_from_ns;

/// IMU of a recording: angular velocities in rad/s and specific forces in m/s², in the IMU frame.
#[derive(Clone, Debug, Default)]
pub(super) struct RecordedImu {
    /// True for the IMU of another device than the autopilot, such as a gimbal.
    pub(super) is_of_other_device: bool,
    /// Angular velocity and specific force of one record.
    pub(super) combined: Samples<[Vector3<f64>; 2]>,
    /// Angular velocities (rad/s) of a separate gyroscope.
    pub(super) gyroscope: Samples<Vector3<f64>>,
    /// Specific forces (m/s²) of a separate accelerometer.
    pub(super) accelerometer: Samples<Vector3<f64>>,
}

/// Frame of a gimbal's attitude (`MAVLink` gimbal protocol v2), with axes forward, right and down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum GimbalFrame {
    /// Levelled, with the heading of the vehicle.
    Vehicle,
    /// Axes north, east and down.
    Earth,
}

/// Attitude of a gimbal: the rotation from the camera's axes (forward, right, down) to the axes of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct GimbalAttitude {
    pub(super) frame: GimbalFrame,
    pub(super) frame_from_camera: UnitQuaternion<f64>,
}

fn map_times<T>(samples: &mut Samples<T>, map: &impl Fn(i64) -> i64) {
    for (time_ns, _) in samples {
        *time_ns = map(*time_ns);
    }
}

/// Records that are left out of the log.
#[derive(Clone, Debug, Default)]
pub(super) struct Left {
    pub(super) count: u64,
    pub(super) reason: String,
}

/// Measurements of a recording, without its video.
#[derive(Clone, Debug, Default)]
pub(super) struct Recorded {
    /// Name of the format, such as `PX4 ULog`.
    pub(super) format: &'static str,
    /// Prefix of the topic names: empty, or `/camera`.
    pub(super) prefix: &'static str,
    /// IMUs by the name of their record.
    pub(super) imus: BTreeMap<String, RecordedImu>,
    /// Rotations from the vehicle's body (forward, right, down) to the earth (north, east, down).
    pub(super) attitudes: Candidates<UnitQuaternion<f64>>,
    pub(super) gimbal: Candidates<GimbalAttitude>,
    /// Positions in a local frame (north, east, down), in metres.
    pub(super) positions: Candidates<Vector3<f64>>,
    pub(super) fixes: Candidates<Geodetic>,
    /// UTC in nanoseconds since the epoch.
    pub(super) utc: Samples<i64>,
    /// Unused records by name.
    pub(super) left: BTreeMap<String, Left>,
    pub(super) notes: Vec<String>,
}

impl Recorded {
    pub(super) fn new(format: &'static str, prefix: &'static str) -> Self {
        Self { format, prefix, ..Self::default() }
    }

    pub(super) fn imu(&mut self, record: &str) -> &mut RecordedImu {
        self.imus.entry(record.to_owned()).or_default()
    }

    pub(super) fn leave(&mut self, record: &str, reason: &str) {
        self.leave_many(record, 1, reason);
    }

    pub(super) fn leave_many(&mut self, record: &str, count: u64, reason: &str) {
        if let Some(left) = self.left.get_mut(record) {
            left.count = left.count.saturating_add(count);
        } else {
            self.left.insert(record.to_owned(), Left { count, reason: reason.to_owned() });
        }
    }

    /// Adds an offset to all times.
    pub(super) fn shift(&mut self, offset_ns: i64) {
        self.map_times(|time_ns| time_ns.saturating_add(offset_ns));
    }

    pub(super) fn map_times(&mut self, map: impl Fn(i64) -> i64) {
        for imu in self.imus.values_mut() {
            map_times(&mut imu.combined, &map);
            map_times(&mut imu.gyroscope, &map);
            map_times(&mut imu.accelerometer, &map);
        }
        self.attitudes.samples_mut().for_each(|samples| map_times(samples, &map));
        self.gimbal.samples_mut().for_each(|samples| map_times(samples, &map));
        self.positions.samples_mut().for_each(|samples| map_times(samples, &map));
        self.fixes.samples_mut().for_each(|samples| map_times(samples, &map));
        map_times(&mut self.utc, &map);
    }

    /// Adds measurements of another recorder with the same clock.
    pub(super) fn append(&mut self, other: Self) {
        for (record, mut imu) in other.imus {
            let merged = self.imu(&record);
            merged.is_of_other_device |= imu.is_of_other_device;
            merged.combined.append(&mut imu.combined);
            merged.gyroscope.append(&mut imu.gyroscope);
            merged.accelerometer.append(&mut imu.accelerometer);
        }
        self.attitudes.append(other.attitudes);
        self.gimbal.append(other.gimbal);
        self.positions.append(other.positions);
        self.fixes.append(other.fixes);
        self.utc.extend(other.utc);
        self.notes.extend(other.notes);
        other.left.into_iter().for_each(|(record, left)| self.leave_many(&record, left.count, &left.reason));
    }

    pub(super) fn count(&self) -> u64 {
        let imu = |imu: &RecordedImu| imu.combined.len() + imu.gyroscope.len() + imu.accelerometer.len();
        let imus: usize = self.imus.values().map(imu).sum();
        let others = self.attitudes.count() + self.gimbal.count() + self.positions.count() + self.fixes.count();
        (imus + others) as u64
    }

    /// UTC minus recorder time: the median of the recorded values, `None` without UTC.
    pub(super) fn utc_offset_ns(&self) -> Option<i64> {
        let mut offsets: Vec<i64> = self.utc.iter().map(|(time_ns, utc_ns)| utc_ns.saturating_sub(*time_ns)).collect();
        offsets.sort_unstable();
        offsets.get(offsets.len() / 2).copied()
    }

    /// First and last time of the IMUs, or of all measurements without an IMU.
    pub(super) fn span_ns(&self) -> Option<(i64, i64)> {
        let mut times: Vec<i64> = Vec::new();
        for imu in self.imus.values() {
            ends(&imu.combined, &mut times);
            ends(&imu.gyroscope, &mut times);
            ends(&imu.accelerometer, &mut times);
        }
        if times.is_empty() {
            self.attitudes.samples().for_each(|samples| ends(samples, &mut times));
            self.gimbal.samples().for_each(|samples| ends(samples, &mut times));
            self.positions.samples().for_each(|samples| ends(samples, &mut times));
            self.fixes.samples().for_each(|samples| ends(samples, &mut times));
        }
        Some((*times.iter().min()?, *times.iter().max()?))
    }
}

fn ends<T>(samples: &Samples<T>, times: &mut Vec<i64>) {
    times.extend(samples.first().into_iter().chain(samples.last()).map(|(time_ns, _)| *time_ns));
}

/// Converts a time in units of `unit_ns` to nanoseconds; `None` for invalid times such as negative numbers.
pub(super) fn nanoseconds(time: f64, unit_ns: f64) -> Option<i64> {
    // 9e18 ns are the year 2255.
    let time_ns = time * unit_ns;
    (time_ns >= 0.0 && time_ns < 9e18).then(|| time_ns.round() as i64)
}

/// Converts to a vector; `None` unless all components are finite.
pub(super) fn finite(components: [f64; 3]) -> Option<Vector3<f64>> {
    components.iter().all(|value| value.is_finite()).then(|| Vector3::from(components))
}

/// Rotation of a quaternion with the scalar part first; `None` for numbers that are no rotation.
pub(super) fn rotation([w, x, y, z]: [f64; 4]) -> Option<UnitQuaternion<f64>> {
    let quaternion = Quaternion::new(w, x, y, z);
    let norm = quaternion.norm();
    (norm > 0.9 && norm < 1.1).then(|| UnitQuaternion::new_normalize(quaternion))
}

/// Rotation of roll, pitch and yaw in radians (`Rz Ry Rx`); `None` for numbers that are not finite.
pub(super) fn from_euler(angles_rad: [f64; 3]) -> Option<UnitQuaternion<f64>> {
    let [roll_rad, pitch_rad, yaw_rad] = finite(angles_rad)?.into();
    Some(UnitQuaternion::from_euler_angles(roll_rad, pitch_rad, yaw_rad))
}

/// Measurements per second, 0 for less than two.
pub(super) fn rate_hz<T>(samples: &Samples<T>) -> f64 {
    let (Some((first_ns, _)), Some((last_ns, _))) = (samples.first(), samples.last()) else { return 0.0 };
    let duration_s = seconds_from_ns(last_ns.saturating_sub(*first_ns));
    if duration_s > 0.0 { (samples.len() - 1) as f64 / duration_s } else { 0.0 }
}
