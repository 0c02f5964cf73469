//! Errors of estimated poses against ground truth, with the covariances of the estimator, and their
//! consistency.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, Matrix3, Matrix6, SMatrix, Vector6};

use super::run::RunRecord;
use super::trajectory_lane::yaw_and_position;
use crate::estimator::{ColumnGroup, Linearization, PoseCovariance, StepReport};
use crate::geometry::{RigidTransform, so3};

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

/// Information added to the absolute position and orientation of all poses, in 1/m² and 1/rad², so that the matrix is
/// invertible: σ of a hundred metres and a hundred radians.
const WEAK_INFORMATION: f64 = 1e-4;

/// Normalized estimation error squared (NEES) of the newest pose of a window relative to its oldest one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseConsistency {
    /// NEES of all six components; 6 on average for a consistent estimator.
    pub pose: f64,
    /// NEES of the rotation; 3 on average.
    pub rotation: f64,
    /// NEES of the translation; 3 on average.
    pub translation: f64,
}

impl RunRecord {
    /// The consistency at every step that keeps its linearization and has ground truth; see
    /// [`SessionPlan::keep_linearization_every`](crate::session::SessionPlan::keep_linearization_every).
    pub fn pose_consistency(&self) -> Vec<PoseConsistency> {
        let truths: BTreeMap<i64, RigidTransform> =
            self.steps.iter().filter_map(|step| Some((step.report.stamp_ns, step.ground_truth?))).collect();
        self.steps.iter().filter_map(|step| consistency(&step.report, &truths)).collect()
    }
}

/// Consistency of one step; `truths` are `world_from_imu` by stamp.
fn consistency(report: &StepReport, truths: &BTreeMap<i64, RigidTransform>) -> Option<PoseConsistency> {
    let [oldest, .., newest] = report.window.as_slice() else { return None };
    let (true_oldest, true_newest) = (truths.get(&oldest.stamp_ns)?, truths.get(&newest.stamp_ns)?);
    let oldest_from_newest = oldest.world_from_imu.inverse() * newest.world_from_imu;
    let error = oldest_from_newest.minus(&(true_oldest.inverse() * *true_newest));
    let covariance = relative_covariance(report, &oldest_from_newest)?;
    let part = |start: usize| {
        let error = error.fixed_rows::<3>(start).into_owned();
        Some(error.dot(&covariance.fixed_view::<3, 3>(start, start).into_owned().cholesky()?.solve(&error)))
    };
    Some(PoseConsistency {
        pose: error.dot(&covariance.cholesky()?.solve(&error)),
        rotation: part(0)?,
        translation: part(3)?,
    })
}

/// Covariance of `oldest_from_newest` (6 × 6) in the perturbation rule, rotation first; all other unknowns
/// marginalized.
fn relative_covariance(report: &StepReport, oldest_from_newest: &RigidTransform) -> Option<Matrix6<f64>> {
    let linearization = report.linearization.as_ref()?;
    let poses = || linearization.columns.iter().filter(|block| block.id.group() == ColumnGroup::Pose);
    let (first, last) = (poses().next()?.start, poses().next_back()?.start);
    let oldest = report.window.first()?;
    let mut change: SMatrix<f64, 6, 12> = SMatrix::zeros();
    let oldest_from_world = oldest.world_from_imu.rotation_matrix().transpose();
    change.fixed_view_mut::<3, 3>(0, 0).copy_from(&-oldest_from_newest.rotation_matrix().transpose());
    change.fixed_view_mut::<3, 3>(0, 6).copy_from(&Matrix3::identity());
    change.fixed_view_mut::<3, 3>(3, 0).copy_from(&so3::hat(&oldest_from_newest.translation_m));
    change.fixed_view_mut::<3, 3>(3, 3).copy_from(&-oldest_from_world);
    change.fixed_view_mut::<3, 3>(3, 9).copy_from(&oldest_from_world);

    let information = information(linearization);
    let mut right = DMatrix::zeros(information.nrows(), 6);
    for (place, start) in [(0, first), (6, last)] {
        right.rows_mut(start, 6).copy_from(&change.fixed_columns::<6>(place).transpose());
    }
    let solved = information.cholesky()?.solve(&right);
    Some(Matrix6::from_iterator((right.transpose() * solved).iter().copied()))
}

/// Information of all columns of a step, from measurements and priors, with [`WEAK_INFORMATION`] on poses.
fn information(linearization: &Linearization) -> DMatrix<f64> {
    let (measured, prior) = (&linearization.jacobian, &linearization.prior_jacobian);
    let mut information = measured.tr_mul(measured);
    if prior.nrows() > 0 {
        information += prior.tr_mul(prior);
    }
    let poses = linearization.columns.iter().filter(|block| block.id.group() == ColumnGroup::Pose);
    for column in poses.flat_map(|block| block.start..block.start + block.len) {
        information[(column, column)] += WEAK_INFORMATION;
    }
    information
}
