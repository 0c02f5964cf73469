//! Errors of estimated poses against ground truth, with the covariances of the estimator.

use nalgebra::Vector6;

use super::run::RunRecord;
use super::trajectory_lane::yaw_and_position;
use crate::estimator::PoseCovariance;
use crate::geometry::RigidTransform;

/// Error of the newest pose of a step.
///
/// Position and yaw of a visual-inertial estimate are relative to the oldest frame of the first window, and so is the
/// covariance: the ground truth is aligned with the estimate by position and yaw at that frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseError {
    /// Stamp of the frame in nanoseconds since the log began.
    pub stamp_ns: i64,
    /// Estimate minus ground truth in the rows of [`PoseCovariance`]: rotation vector in the IMU frame (rad), position
    /// in the world of the run (m).
    pub error: Vector6<f64>,
    pub covariance: PoseCovariance,
}

impl PoseError {
    /// Normalized error squared of all six components, 6 on average for a consistent estimator.
    pub fn nees(&self) -> Option<f64> {
        self.covariance.nees(&self.error)
    }

    /// Mean of [`PoseError::nees`], `None` if there are no errors.
    pub fn mean_nees(errors: &[Self]) -> Option<f64> {
        let nees: Vec<f64> = errors.iter().filter_map(Self::nees).collect();
        (!nees.is_empty()).then(|| nees.iter().sum::<f64>() / nees.len() as f64)
    }
}

impl RunRecord {
    /// Errors of the newest poses of all steps with ground truth, after initializations whose oldest frame has ground
    /// truth.
    pub fn pose_errors(&self) -> Vec<PoseError> {
        let mut errors = Vec::new();
        // Number of restarts, and the alignment of the ground truth with the oldest frame of the window after the last
        // one.
        let mut origin: Option<(usize, Option<RigidTransform>)> = None;
        for (number, step) in self.steps.iter().enumerate() {
            let report = &step.report;
            let (Some(newest), Some(covariance)) = (report.newest(), report.newest_pose_covariance) else { continue };
            let run_from_true = match origin {
                Some((restarts, known)) if restarts == report.restarts => known,
                _ => self.run_from_true(number),
            };
            origin = Some((report.restarts, run_from_true));
            if let (Some(run_from_true), Some(truth)) = (run_from_true, step.ground_truth) {
                let error = newest.world_from_imu.minus(&(run_from_true * truth));
                errors.push(PoseError { stamp_ns: report.stamp_ns, error, covariance });
            }
        }
        errors
    }

    /// `run_from_true`: alignment of the ground truth with the oldest frame of a step's window by position and yaw;
    /// `None` if that frame has no ground truth.
    fn run_from_true(&self, step: usize) -> Option<RigidTransform> {
        let oldest = self.steps[step].report.window.first()?;
        let place = self.steps[..=step].binary_search_by_key(&oldest.stamp_ns, |step| step.report.stamp_ns).ok()?;
        Some(yaw_and_position(&oldest.world_from_imu, &self.steps[place].ground_truth?))
    }
}
