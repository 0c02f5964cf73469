//! Absolute and relative errors of a trajectory.

use crate::session::accuracy::{
    Alignment, ErrorStatistics, RelativeDelta, StampedPose, absolute_errors_m, align, path_length_m, relative_errors,
};
use crate::session::antenna::{AntennaAlignment, AntennaPair, antenna_statistics};

/// Largest age of a position of the antenna beside a pose, in nanoseconds.
pub(super) const MAX_POSITION_AGE_NS: i64 = 500_000_000;

/// Path lengths of the relative errors, in metres.
pub const RELATIVE_LENGTHS_M: [f64; 3] = [5.0, 10.0, 25.0];

/// Relative errors over sub-trajectories of one path length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativeAccuracy {
    /// Path length of a sub-trajectory in metres.
    pub delta_m: f64,
    /// Translation errors in metres.
    pub translation_m: ErrorStatistics,
    /// Rotation errors in radians.
    pub rotation_rad: ErrorStatistics,
}

/// Errors of a trajectory that is aligned with the ground truth by yaw and position.
#[derive(Clone, Debug, PartialEq)]
pub struct TrajectoryAccuracy {
    /// Length of the ground-truth path over the estimated frames, in metres.
    pub length_m: f64,
    /// Absolute position errors in metres.
    pub absolute_m: ErrorStatistics,
    /// Relative errors by path length, for lengths that the trajectory has; none against positions of an antenna.
    pub relative: Vec<RelativeAccuracy>,
    /// The lever arm of the antenna whose positions the ground truth is, `None` of poses of the IMU.
    pub antenna: Option<AntennaAlignment>,
}

impl TrajectoryAccuracy {
    /// Errors of estimated poses against ground truth, `None` with too few pairs to align them.
    pub fn of(pairs: &[(StampedPose, StampedPose)]) -> Option<Self> {
        let transform = align(pairs, Alignment::YawPosition)?;
        let relative = RELATIVE_LENGTHS_M.into_iter().filter_map(|delta_m| {
            let (translations, rotations) = relative_errors(pairs, &transform, RelativeDelta::Metres(delta_m));
            Some(RelativeAccuracy {
                delta_m,
                translation_m: ErrorStatistics::of(&translations)?,
                rotation_rad: ErrorStatistics::of(&rotations)?,
            })
        });
        Some(Self {
            length_m: path_length_m(pairs.iter().map(|(_, ground_truth)| &ground_truth.pose.translation_m)),
            absolute_m: ErrorStatistics::of(&absolute_errors_m(pairs, &transform))?,
            relative: relative.collect(),
            antenna: None,
        })
    }

    /// Errors of the position of an antenna, `None` without a pair.
    pub fn of_antenna(pairs: &[AntennaPair], alignment: &AntennaAlignment) -> Option<Self> {
        let (absolute_m, length_m) = antenna_statistics(pairs, alignment)?;
        Some(Self { length_m, absolute_m, relative: Vec::new(), antenna: Some(*alignment) })
    }
}
