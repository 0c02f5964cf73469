//! Antenna positions as ground truth of a run that is still growing.

use nalgebra::{UnitQuaternion, Vector3};

use super::trajectory_accuracy::{TrajectoryAccuracy, TrajectoryEvaluation};
use crate::geometry::{RigidTransform, seconds_from_ns};
use crate::sensors::{LeverArm, NEAREST_POSE_NS, PoseSample, PoseTrack, PositionSample};
use crate::session::accuracy::{AlignmentSums, StampedPose, TrajectoryAlignment};
use crate::session::antenna::{AntennaAlignment, AntennaError, AntennaPair, align_antenna, antenna_pairs};

/// Ratio of new pairs to previous pairs after which the lever arm is estimated again.
const NEW_PAIRS_RATIO: f64 = 0.05;

/// Ground truth given as positions of an antenna, for example of a GNSS receiver.
#[derive(Clone, Debug, PartialEq)]
pub struct PositionTruth {
    /// The file or topic.
    pub source: String,
    /// Positions in the order of their stamps.
    pub samples: Vec<PositionSample>,
    pub lever_arm: LeverArm,
}

impl PositionTruth {
    /// Evaluates a trajectory against the antenna positions.
    ///
    /// # Errors
    /// If the positions do not determine the alignment, or the rotations do not determine the lever arm.
    pub fn evaluate(&self, estimate: &PoseTrack) -> Result<TrajectoryEvaluation, AntennaError> {
        let pairs = antenna_pairs(estimate, &self.samples);
        let alignment = align_antenna(&pairs, self.lever_arm)?;
        Ok(TrajectoryEvaluation {
            accuracy: TrajectoryAccuracy::of_antenna(&pairs, &alignment),
            alignment: Some(alignment.true_from_estimate),
            pairs: pairs.iter().map(|pair| stamped(pair, &alignment)).collect(),
        })
    }
}

/// Estimated antenna position (world of the estimate) and ground-truth position (world of the ground truth) as poses
/// without rotation.
fn stamped(pair: &AntennaPair, alignment: &AntennaAlignment) -> (StampedPose, StampedPose) {
    let stamp_s = seconds_from_ns(pair.stamp_ns);
    let at = |position_m| StampedPose { stamp_s, pose: RigidTransform::new(UnitQuaternion::identity(), position_m) };
    (at(pair.pose.transform(&alignment.lever_arm_m)), at(pair.antenna_m))
}

/// Pairs of a run and its alignment, updated with every pose.
#[derive(Clone, Debug, Default)]
pub(super) struct AntennaRecord {
    pub(super) pairs: Vec<AntennaPair>,
    pub(super) alignment: Option<AntennaAlignment>,
    sums: AlignmentSums,
    last: Option<PoseSample>,
    /// Number of pairs at which the lever arm is estimated again.
    next_estimate: usize,
}

impl AntennaRecord {
    /// Adds the next pose of the run; stamps must increase.
    pub(super) fn push(&mut self, truth: &PositionTruth, stamp_ns: i64, world_from_imu: RigidTransform) {
        let next = PoseSample { stamp_ns, world_from_imu };
        let Some(last) = self.last.replace(next) else { return };
        // Poses further apart are not interpolated.
        if stamp_ns - last.stamp_ns > 2 * NEAREST_POSE_NS {
            return;
        }
        let samples = &truth.samples;
        let [from, to] =
            [last.stamp_ns, stamp_ns].map(|at_ns| samples.partition_point(|sample| sample.stamp_ns <= at_ns));
        let span_ns = (stamp_ns - last.stamp_ns).max(1) as f64;
        let before = self.pairs.len();
        self.pairs.extend(samples[from..to].iter().map(|sample| {
            AntennaPair {
                stamp_ns: sample.stamp_ns,
                pose: last
                    .world_from_imu
                    .interpolate(&next.world_from_imu, (sample.stamp_ns - last.stamp_ns) as f64 / span_ns),
                antenna_m: sample.position_m,
            }
        }));
        if self.pairs.len() > before {
            self.align(truth.lever_arm, before);
        }
    }

    /// Aligns, with the pairs from `first` on as new ones.
    fn align(&mut self, lever_arm: LeverArm, first: usize) {
        match lever_arm {
            LeverArm::Known(lever_arm_m) => {
                for pair in &self.pairs[first..] {
                    self.sums.add(&pair.pose.transform(&lever_arm_m), &pair.antenna_m);
                }
                self.alignment = self.sums.solve(TrajectoryAlignment::YawPosition).map(|transform| AntennaAlignment {
                    true_from_estimate: transform.rigid,
                    lever_arm_m,
                    lever_arm_sigma_m: None,
                });
            }
            LeverArm::Estimated if self.pairs.len() >= self.next_estimate => {
                self.next_estimate = self.pairs.len() + (NEW_PAIRS_RATIO * self.pairs.len() as f64).ceil() as usize;
                let estimated = align_antenna(&self.pairs, lever_arm);
                // Until the rotations determine the lever arm, the antenna is assumed at the IMU.
                let aligned = estimated.or_else(|_| align_antenna(&self.pairs, LeverArm::Known(Vector3::zeros())));
                self.alignment = aligned.ok();
            }
            LeverArm::Estimated => {}
        }
    }
}
