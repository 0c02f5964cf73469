use nalgebra::{Quaternion, UnitQuaternion};

use super::recorded::{GimbalAttitude, GimbalFrame, rotation};

/// Attitudes further apart are not interpolated.
const MAX_GAP_NS: i64 = 1_000_000_000;

/// Rotation from north, east, down to east, north, up.
pub(super) fn enu_from_ned() -> UnitQuaternion<f64> {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    UnitQuaternion::new_unchecked(Quaternion::new(0.0, half, half, 0.0))
}

/// Rotation from the levelled frame with a body's heading to the earth (both forward or north, right or east, down).
pub(super) fn earth_from_heading(earth_from_body: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    let (_, _, yaw_rad) = earth_from_body.euler_angles();
    UnitQuaternion::from_euler_angles(0.0, 0.0, yaw_rad)
}

/// Rotations from the vehicle's body to the earth in time order.
pub(super) struct AttitudeTrack<'a>(&'a [(i64, UnitQuaternion<f64>)]);

impl<'a> AttitudeTrack<'a> {
    pub(super) fn new(samples: &'a [(i64, UnitQuaternion<f64>)]) -> Self {
        Self(samples)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Rotation at a time, interpolated between the two around it; `None` before, after and in gaps of over a second.
    pub(super) fn at(&self, time_ns: i64) -> Option<UnitQuaternion<f64>> {
        let behind = self.0.partition_point(|(at, _)| *at <= time_ns);
        let (before_ns, before) = self.0.get(behind.checked_sub(1)?)?;
        if *before_ns == time_ns {
            return Some(*before);
        }
        let (after_ns, after) = self.0.get(behind)?;
        let gap_ns = after_ns.saturating_sub(*before_ns);
        let fraction = time_ns.saturating_sub(*before_ns) as f64 / gap_ns as f64;
        // Opposite rotations have no shortest rotation between them.
        (gap_ns <= MAX_GAP_NS).then(|| before.try_slerp(after, fraction, 1e-9).unwrap_or(*before))
    }
}

/// Flags of a gimbal device's attitude (`MAVLink`'s `GIMBAL_DEVICE_FLAGS`).
mod flag {
    /// Yaw is locked to the earth.
    pub(super) const YAW_LOCK: u32 = 16;
    /// Yaw of the attitude is relative to the vehicle's heading.
    pub(super) const YAW_IN_VEHICLE_FRAME: u32 = 32;
    /// Yaw of the attitude is relative to north.
    pub(super) const YAW_IN_EARTH_FRAME: u32 = 64;
}

/// Attitude of a gimbal device in the frame of its flags; without a frame flag, a locked yaw is relative to north.
pub(super) fn gimbal_attitude(flags: u32, quaternion: [f64; 4]) -> Option<GimbalAttitude> {
    let has = |bit: u32| flags & bit != 0;
    let is_earth = has(flag::YAW_IN_EARTH_FRAME) || (!has(flag::YAW_IN_VEHICLE_FRAME) && has(flag::YAW_LOCK));
    let frame = if is_earth { GimbalFrame::Earth } else { GimbalFrame::Vehicle };
    Some(GimbalAttitude { frame, frame_from_camera: rotation(quaternion)? })
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn axes_are_those_of_the_frames() {
        let enu = |ned: [f64; 3]| enu_from_ned() * Vector3::from(ned);
        assert!((enu([1.0, 2.0, 3.0]) - Vector3::new(2.0, 1.0, -3.0)).norm() < 1e-15);
        let tilted = UnitQuaternion::from_euler_angles(0.3, -0.5, 1.2);
        assert!(earth_from_heading(&tilted).angle_to(&UnitQuaternion::from_euler_angles(0.0, 0.0, 1.2)) < 1e-12);
    }

    #[test]
    fn attitudes_are_interpolated_across_small_gaps() {
        let yaw = |angle_rad: f64| UnitQuaternion::from_euler_angles(0.0, 0.0, angle_rad);
        let samples = [(0, yaw(0.0)), (100_000_000, yaw(0.1)), (5_000_000_000, yaw(0.2))];
        let track = AttitudeTrack::new(&samples);
        assert!(track.at(25_000_000).unwrap().angle_to(&yaw(0.025)) < 1e-9);
        assert_eq!(track.at(5_000_000_000), Some(yaw(0.2)));
        assert!(track.at(-1).is_none() && track.at(300_000_000).is_none() && track.at(5_000_000_001).is_none());
        assert!(AttitudeTrack::new(&[]).at(0).is_none());
    }
}
