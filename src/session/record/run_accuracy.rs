//! Errors of a run's trajectory and chain against ground truth.

use super::run::RunRecord;
use crate::geometry::{seconds_from_ns, so3};
use crate::gimbal::ClassicalChain;
use crate::session::accuracy::{
    Alignment, ErrorStatistics, RelativeDelta, StampedPose, absolute_errors_m, align, path_length_m, relative_errors,
};

/// Path lengths of the relative errors, in metres.
pub const RELATIVE_LENGTHS_M: [f64; 3] = [5.0, 10.0, 25.0];

/// Errors of a trajectory that is aligned with the ground truth by yaw and position.
#[derive(Clone, Debug, PartialEq)]
pub struct TrajectoryAccuracy {
    /// Length of the ground-truth path over the estimated frames, in metres.
    pub length_m: f64,
    /// Absolute position errors in metres.
    pub absolute_m: ErrorStatistics,
    /// Relative errors by path length, for lengths that the trajectory has.
    pub relative: Vec<RelativeAccuracy>,
}

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

/// Error of a chain against a reference chain over the joint angles of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChainDistance {
    /// Errors of the camera position in metres.
    pub translation_m: ErrorStatistics,
    /// Errors of the camera attitude in radians.
    pub rotation_rad: ErrorStatistics,
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
        })
    }
}

impl RunRecord {
    /// Estimated and ground-truth `world_from_imu` of each frame that has both.
    pub fn pairs_with_ground_truth(&self) -> Vec<(StampedPose, StampedPose)> {
        self.steps
            .iter()
            .filter_map(|step| {
                let newest = step.report.newest()?;
                let stamp_s = seconds_from_ns(newest.stamp_ns);
                Some((
                    StampedPose { stamp_s, pose: newest.world_from_imu },
                    StampedPose { stamp_s, pose: step.ground_truth? },
                ))
            })
            .collect()
    }

    /// Error of a chain against a reference over the joint angles of the run's frames, `None` before the first pose.
    pub fn chain_distance(&self, chain: &ClassicalChain, reference: &ClassicalChain) -> Option<ChainDistance> {
        let newest = self.steps.iter().filter_map(|step| step.report.newest());
        let (translations, rotations): (Vec<f64>, Vec<f64>) = newest
            .map(|newest| {
                let estimate = chain.imu_from_camera(&newest.joint_angles_rad);
                let reference = reference.imu_from_camera(&newest.joint_angles_rad);
                let reference_from_estimate = reference.rotation.inverse() * estimate.rotation;
                ((estimate.translation_m - reference.translation_m).norm(), so3::log(&reference_from_estimate).norm())
            })
            .unzip();
        Some(ChainDistance {
            translation_m: ErrorStatistics::of(&translations)?,
            rotation_rad: ErrorStatistics::of(&rotations)?,
        })
    }
}
