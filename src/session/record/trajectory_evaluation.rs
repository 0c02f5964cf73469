//! A trajectory evaluated against ground truth.

use serde::Serialize;

use super::trajectory_accuracy::TrajectoryAccuracy;
use crate::geometry::{RigidTransform, seconds_from_ns};
use crate::sensors::{PoseSample, PoseTrack};
use crate::session::accuracy::{StampedPose, TrajectoryAlignment, align};

/// Pairs of poses, their alignment and its errors.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TrajectoryEvaluation {
    /// Estimated and ground-truth poses with equal stamps, in seconds since the log began.
    #[serde(skip)]
    pub pairs: Vec<(StampedPose, StampedPose)>,
    /// `true_from_estimate`, a rotation about the vertical and a translation; `None` with too few pairs.
    #[serde(skip)]
    pub alignment: Option<RigidTransform>,
    /// Errors after this alignment.
    pub accuracy: Option<TrajectoryAccuracy>,
}

impl TrajectoryEvaluation {
    /// Distance between the aligned pose and the ground truth of a pair in metres, `None` without an alignment.
    pub fn error_m(&self, pair: usize) -> Option<f64> {
        let (estimate, actual) = self.pairs.get(pair)?;
        Some((self.alignment?.transform(&estimate.pose.translation_m) - actual.pose.translation_m).norm())
    }
}

/// Evaluates a trajectory against ground truth as a run is evaluated: ground truth interpolated at the stamps of the
/// trajectory, aligned by yaw and position.
pub fn evaluate_trajectory(estimate: &[PoseSample], ground_truth: &PoseTrack) -> TrajectoryEvaluation {
    let pair = |sample: &PoseSample| {
        let stamp_s = seconds_from_ns(sample.stamp_ns);
        let actual = ground_truth.at(sample.stamp_ns)?;
        Some((StampedPose { stamp_s, pose: sample.world_from_imu }, StampedPose { stamp_s, pose: actual }))
    };
    let pairs: Vec<_> = estimate.iter().filter_map(pair).collect();
    let alignment = align(&pairs, TrajectoryAlignment::YawPosition).map(|transform| transform.rigid);
    TrajectoryEvaluation { alignment, accuracy: TrajectoryAccuracy::of(&pairs), pairs }
}
