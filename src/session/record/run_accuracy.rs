//! Errors of a run's trajectory and chain against ground truth.

use super::run::RunRecord;
use super::step::StepRecord;
use super::trajectory_accuracy::{MAX_POSITION_AGE_NS, TrajectoryAccuracy};
use crate::calibration::ChainDistance;
use crate::geometry::{seconds_from_ns, so3};
use crate::gimbal::ClassicalChain;
use crate::session::accuracy::{StampedPose, path_length_m};
use crate::session::antenna::{align_antenna, antenna_errors_m};

const NO_GROUND_TRUTH: &str = "no ground truth for the estimated frames in the log";

impl RunRecord {
    /// Errors of the trajectory: of the poses of the IMU, or of the antenna positions if these are the ground truth.
    ///
    /// # Errors
    /// A message if there is no ground truth or it does not determine the alignment.
    pub fn accuracy(&self) -> Result<TrajectoryAccuracy, String> {
        let Some(truth) = &self.position_truth else {
            let pairs = self.pairs_with_ground_truth();
            let reason = if pairs.is_empty() { NO_GROUND_TRUTH } else { "too few frames with ground truth to align" };
            return TrajectoryAccuracy::of(&pairs).ok_or_else(|| reason.to_owned());
        };
        let pairs = &self.antenna.pairs;
        let alignment = align_antenna(pairs, truth.lever_arm).map_err(|error| error.to_string())?;
        TrajectoryAccuracy::of_antenna(pairs, &alignment).ok_or_else(|| NO_GROUND_TRUTH.to_owned())
    }

    /// Distances in metres between the aligned run and the ground truth at the estimated frames, or at the antenna
    /// positions if these are the ground truth; empty before the alignment.
    pub fn position_errors_m(&self) -> Vec<f64> {
        if self.position_truth.is_some() {
            let errors_m = |alignment| antenna_errors_m(&self.antenna.pairs, alignment);
            return self.antenna.alignment.as_ref().map(errors_m).unwrap_or_default();
        }
        self.steps.iter().filter_map(|step| self.pose_error_m(step)).collect()
    }

    /// The same distance at one step: at its frame, or at the last antenna position at or before it that is at most 0.5
    /// s old.
    pub fn position_error_m(&self, step: &StepRecord) -> Option<f64> {
        if self.position_truth.is_none() {
            return self.pose_error_m(step);
        }
        let alignment = self.antenna.alignment.as_ref()?;
        let stamp_ns = step.report.newest()?.stamp_ns;
        let last = self.antenna.pairs.partition_point(|pair| pair.stamp_ns <= stamp_ns).checked_sub(1)?;
        let pair = self.antenna.pairs.get(last).filter(|pair| stamp_ns - pair.stamp_ns <= MAX_POSITION_AGE_NS)?;
        antenna_errors_m(std::slice::from_ref(pair), alignment).first().copied()
    }

    /// Position error in metres and angle in radians of the pose of a step after the alignment of the whole run; `None`
    /// without a pose or ground truth.
    pub fn aligned_error(&self, step: &StepRecord) -> Option<[f64; 2]> {
        let (alignment, truth) = (self.alignment?, step.ground_truth?);
        let aligned = alignment * step.report.newest()?.world_from_imu;
        let turn = so3::log(&(truth.rotation.inverse() * aligned.rotation));
        Some([(aligned.translation_m - truth.translation_m).norm(), turn.norm()])
    }

    fn pose_error_m(&self, step: &StepRecord) -> Option<f64> {
        let estimate = self.alignment?.transform(&step.report.newest()?.world_from_imu.translation_m);
        Some((estimate - step.ground_truth?.translation_m).norm())
    }

    /// Length of the ground-truth path in metres over the frames with ground truth; `None` without ground truth.
    pub fn true_length_m(&self) -> Option<f64> {
        if self.position_truth.is_some() && !self.antenna.pairs.is_empty() {
            return Some(path_length_m(self.antenna.pairs.iter().map(|pair| &pair.antenna_m)));
        }
        let pairs = self.pairs_with_ground_truth();
        (!pairs.is_empty())
            .then(|| path_length_m(pairs.iter().map(|(_, ground_truth)| &ground_truth.pose.translation_m)))
    }

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

    /// Distance of a chain from a reference over the joint angles of the run's frames, `None` before the first pose.
    pub fn chain_distance(&self, chain: &ClassicalChain, reference: &ClassicalChain) -> Option<ChainDistance> {
        let newest = self.steps.iter().filter_map(|step| step.report.newest());
        ChainDistance::over(chain, reference, newest.map(|newest| &newest.joint_angles_rad))
    }
}
