//! Poses and calibrations of steps with their covariances, and their squared errors against the ground truth.
//!
//! Poses are judged relative to each other, newest against oldest frame of a window: that difference does not depend on
//! the four unobservable directions (position, yaw), and needs no alignment.

use std::collections::BTreeMap;

use dcvins::estimator::{ColumnGroup, Linearization, StepReport};
use dcvins::geometry::{RigidTransform, so3};
use dcvins::gimbal::{Chain, ClassicalChain, ParameterNames, Parameterization};
use nalgebra::{DMatrix, Matrix3, Matrix6, SMatrix};
use serde::{Deserialize, Serialize};

/// Information that all poses are given about the absolute position and orientation, so that the matrix can be inverted:
/// a hundred metres, a hundred radians. It does not act on differences.
const WEAK_INFORMATION: f64 = 1e-4;

/// The pose of a window's newest frame in its oldest one.
pub(crate) struct PoseSample {
    stamps_ns: [i64; 2],
    oldest_from_newest: RigidTransform,
    covariance: Matrix6<f64>,
}

/// Squared error of a pose over its covariance, of all six components, of the rotation and of the translation.
pub(crate) type PoseSquares = [f64; 3];

/// The calibration at one step with its covariance.
pub(crate) struct CalibrationSample {
    chain: ClassicalChain,
    parameterization: Parameterization,
    names: Vec<String>,
    /// Columns of the chain of the camera in question, without those of a rigid camera beside it.
    chain_columns: usize,
    covariance: DMatrix<f64>,
}

/// A calibration held against the truth.
#[derive(Serialize, Deserialize)]
pub(crate) struct CalibrationErrors {
    pub(crate) names: Vec<String>,
    /// Estimate minus truth.
    pub(crate) errors: Vec<f64>,
    pub(crate) sigmas: Vec<f64>,
    /// Squared error over the covariance.
    pub(crate) square: f64,
}

/// Inverse of all columns' covariance, of the measurements and the priors.
fn information(linearization: &Linearization) -> DMatrix<f64> {
    let (measured, prior) = (&linearization.jacobian, &linearization.prior_jacobian);
    let mut information = measured.tr_mul(measured);
    if prior.nrows() > 0 {
        information += prior.tr_mul(prior);
    }
    for block in linearization.columns.iter().filter(|block| block.id.group() == ColumnGroup::Pose) {
        for column in block.start..block.start + block.len {
            information[(column, column)] += WEAK_INFORMATION;
        }
    }
    information
}

/// The relative pose of a step's window; `None` before the window is there.
pub(crate) fn pose_sample(report: &StepReport) -> Option<PoseSample> {
    let linearization = report.linearization.as_ref()?;
    let poses = || linearization.columns.iter().filter(|block| block.id.group() == ColumnGroup::Pose);
    let (first, last) = (poses().next()?.start, poses().next_back()?.start);
    let [oldest, .., newest] = report.window.as_slice() else { return None };
    let relative = oldest.world_from_imu.inverse() * newest.world_from_imu;
    // From the perturbation rule: rotation on the right, translation added.
    let mut change: SMatrix<f64, 6, 12> = SMatrix::zeros();
    let oldest_from_world = oldest.world_from_imu.rotation_matrix().transpose();
    change.fixed_view_mut::<3, 3>(0, 0).copy_from(&-relative.rotation_matrix().transpose());
    change.fixed_view_mut::<3, 3>(0, 6).copy_from(&Matrix3::identity());
    change.fixed_view_mut::<3, 3>(3, 0).copy_from(&so3::hat(&relative.translation_m));
    change.fixed_view_mut::<3, 3>(3, 3).copy_from(&-oldest_from_world);
    change.fixed_view_mut::<3, 3>(3, 9).copy_from(&oldest_from_world);

    let information = information(linearization);
    let mut right = DMatrix::zeros(information.nrows(), 6);
    for (place, start) in [(0, first), (6, last)] {
        right.rows_mut(start, 6).copy_from(&change.fixed_columns::<6>(place).transpose());
    }
    let solved = information.cholesky()?.solve(&right);
    let covariance = Matrix6::from_iterator((right.transpose() * solved).iter().copied());
    let stamps_ns = [oldest.stamp_ns, newest.stamp_ns];
    Some(PoseSample { stamps_ns, oldest_from_newest: relative, covariance })
}

impl PoseSample {
    /// The sample held against the true poses; `None` when they are not known.
    pub(crate) fn judged(&self, truths: &BTreeMap<i64, RigidTransform>) -> Option<PoseSquares> {
        let [Some(oldest), Some(newest)] = self.stamps_ns.map(|stamp_ns| truths.get(&stamp_ns)) else { return None };
        let error = self.oldest_from_newest.minus(&(oldest.inverse() * *newest));
        let whole = error.dot(&self.covariance.cholesky()?.solve(&error));
        let part = |start: usize| {
            let error = error.fixed_rows::<3>(start).into_owned();
            Some(error.dot(&self.covariance.fixed_view::<3, 3>(start, start).into_owned().cholesky()?.solve(&error)))
        };
        Some([whole, part(0)?, part(3)?])
    }
}

/// The calibration of a step with its covariance; `None` when nothing is calibrated.
pub(crate) fn calibration_sample(report: &StepReport) -> Option<CalibrationSample> {
    let linearization = report.linearization.as_ref()?;
    let columns = linearization.columns.iter().filter(|block| block.id.group() == ColumnGroup::Calibration).count();
    if columns == 0 {
        return None;
    }
    let information = information(linearization);
    let right = DMatrix::identity(information.nrows(), columns);
    let covariance = information.cholesky()?.solve(&right).rows(0, columns).into_owned();
    Some(CalibrationSample {
        chain: report.calibration.classical.clone(),
        parameterization: report.calibration.parameterization,
        names: report.calibration.parameters.iter().map(|it| ParameterNames::default().name(*it)).collect(),
        chain_columns: report.calibration.parameters.len() - 6 * report.calibration.rigid_cameras.len(),
        covariance,
    })
}

impl CalibrationSample {
    /// The sample held against the true chain; `None` when the two have other columns.
    pub(crate) fn judged(&self, ground_truth: &ClassicalChain) -> Option<CalibrationErrors> {
        let chain = |classical: &ClassicalChain| {
            let chain = Chain::from_classical(classical, self.parameterization);
            if chain.dof() == self.chain_columns { chain } else { chain.without_joint_offsets() }
        };
        let error = chain(&self.chain).minus(&chain(ground_truth));
        let columns = error.len();
        if columns > self.covariance.nrows() {
            return None;
        }
        // A rigid camera's columns stand behind the chain's.
        let covariance = self.covariance.view((0, 0), (columns, columns)).into_owned();
        Some(CalibrationErrors {
            names: self.names[..columns].to_vec(),
            errors: error.iter().copied().collect(),
            sigmas: covariance.diagonal().map(f64::sqrt).iter().copied().collect(),
            square: error.dot(&covariance.cholesky()?.solve(&error)),
        })
    }
}

impl CalibrationErrors {
    /// |error| over σ of every parameter.
    pub(crate) fn ratios(&self) -> impl Iterator<Item = f64> {
        self.errors.iter().zip(&self.sigmas).map(|(error, sigma)| error.abs() / sigma)
    }
}
