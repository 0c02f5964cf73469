//! Calibrations of steps with their covariances, and their squared errors against the ground truth.

use dcvins::estimator::{ColumnGroup, Linearization, StepReport};
use dcvins::gimbal::{Chain, ClassicalChain, ParameterNames, Parameterization};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// Information that all poses are given about the absolute position and orientation, so that the matrix can be inverted:
/// a hundred metres, a hundred radians. It does not act on differences.
const WEAK_INFORMATION: f64 = 1e-4;

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
