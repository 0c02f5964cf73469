use std::fmt;
use std::str::FromStr;

use nalgebra::Vector3;

use crate::geometry::RigidTransform;

/// Largest distance in nanoseconds between a stamp and the nearest pose of a track for interpolation.
pub const NEAREST_POSE_NS: i64 = 100_000_000;

/// Largest coordinate of an antenna on the vehicle; a larger one is given in millimetres by mistake.
pub const MAX_LEVER_ARM_M: f64 = 100.0;

/// Ground-truth pose, or pose of a trajectory of another program.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseSample {
    /// Header stamp in nanoseconds since the start of the log.
    pub stamp_ns: i64,
    pub world_from_imu: RigidTransform,
}

/// Ground-truth position of an antenna.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositionSample {
    /// Header stamp in nanoseconds since the start of the log.
    pub stamp_ns: i64,
    /// In the world frame.
    pub position_m: Vector3<f64>,
}

/// Position of an antenna on the vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LeverArm {
    /// In the IMU frame, in metres.
    Known(Vector3<f64>),
    /// Estimated together with the alignment of a trajectory.
    Estimated,
}

impl FromStr for LeverArm {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "estimate" {
            return Ok(Self::Estimated);
        }
        let numbers: Option<Vec<f64>> = text
            .split(',')
            .map(|number| number.trim().parse().ok().filter(|value: &f64| value.abs() <= MAX_LEVER_ARM_M))
            .collect();
        let numbers = numbers.and_then(|numbers| <[f64; 3]>::try_from(numbers).ok());
        numbers
            .map(|numbers| Self::Known(numbers.into()))
            .ok_or_else(|| "expected metres along x, y and z of the IMU, as in 0.1,0,0.25, or estimate".to_owned())
    }
}

impl fmt::Display for LeverArm {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Known(at_m) => write!(formatter, "{:?},{:?},{:?}", at_m.x, at_m.y, at_m.z),
            Self::Estimated => formatter.write_str("estimate"),
        }
    }
}

/// Poses in time order, interpolated between their stamps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PoseTrack(Vec<PoseSample>);

impl PoseTrack {
    /// Sorts the poses by stamp; of several with one stamp the first is kept.
    pub fn new(mut samples: Vec<PoseSample>) -> Self {
        samples.sort_by_key(|sample| sample.stamp_ns);
        samples.dedup_by_key(|sample| sample.stamp_ns);
        Self(samples)
    }

    pub fn samples(&self) -> &[PoseSample] {
        &self.0
    }

    /// Pose at a stamp, interpolated between the poses before and after it; `None` before the first, after the last,
    /// and if the nearest of the two is further than [`NEAREST_POSE_NS`] away.
    pub fn at(&self, stamp_ns: i64) -> Option<RigidTransform> {
        let after = self.0.partition_point(|sample| sample.stamp_ns <= stamp_ns);
        let from = self.0.get(after.checked_sub(1)?)?;
        if from.stamp_ns == stamp_ns {
            return Some(from.world_from_imu);
        }
        let to = self.0.get(after)?;
        if (stamp_ns - from.stamp_ns).min(to.stamp_ns - stamp_ns) > NEAREST_POSE_NS {
            return None;
        }
        let fraction = (stamp_ns - from.stamp_ns) as f64 / (to.stamp_ns - from.stamp_ns) as f64;
        Some(from.world_from_imu.interpolate(&to.world_from_imu, fraction))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};

    use super::*;

    #[test]
    fn poses_are_interpolated_near_their_stamps() {
        let sample = |stamp_ms: i64, x_m: f64| PoseSample {
            stamp_ns: stamp_ms * 1_000_000,
            world_from_imu: RigidTransform::new(
                UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.1 * x_m),
                Vector3::new(x_m, 0.0, 0.0),
            ),
        };
        let track = PoseTrack::new(vec![sample(100, 1.0), sample(0, 0.0), sample(100, 9.0), sample(600, 2.0)]);
        assert_eq!(track.samples().len(), 3);
        let x_m = |stamp_ms: i64| track.at(stamp_ms * 1_000_000).map(|pose| pose.translation_m.x);
        assert_eq!((x_m(-1), x_m(0), x_m(601)), (None, Some(0.0), None));
        assert!((x_m(25).unwrap() - 0.25).abs() < 1e-12);
        assert!((track.at(25_000_000).unwrap().rotation.angle() - 0.025).abs() < 1e-12);
        assert!(x_m(199).is_some() && x_m(350).is_none() && x_m(550).is_some());
    }
}
