//! Prior on the chain as a least-squares term, of the rig or of earlier flights.

use nalgebra::{DMatrix, DVector};

use crate::gimbal::{Chain, ClassicalChain, Parameterization};
use crate::sensors::ChainPrior;

/// Variance added to every column, so that the covariance stays regular when the prior fixes a column.
const MIN_VARIANCE: f64 = 1e-12;

/// Given chain with its prior.
#[derive(Clone, Debug)]
pub(super) struct ChainTerm {
    pub(super) given: Chain,
    /// Prior standard deviation of each column.
    pub(super) prior_sigmas: DVector<f64>,
    /// `W` with `WᵀW` the inverse of the prior covariance.
    square_root_information: DMatrix<f64>,
}

/// `W` (n × n) with `WᵀW` the inverse of a covariance; of its diagonal alone where it is not positive definite.
pub(super) fn square_root_information(mut covariance: DMatrix<f64>) -> DMatrix<f64> {
    let count = covariance.nrows();
    for k in 0..count {
        covariance[(k, k)] += MIN_VARIANCE;
    }
    let sigmas = covariance.diagonal().map(f64::sqrt);
    covariance
        .cholesky()
        .and_then(|factor| factor.l().solve_lower_triangular(&DMatrix::identity(count, count)))
        .unwrap_or_else(|| DMatrix::from_diagonal(&sigmas.map(|sigma| 1.0 / sigma)))
}

impl ChainTerm {
    /// Rig's prior on its chain in a parameterization.
    pub(super) fn new(classical: &ClassicalChain, prior: &ChainPrior, parameterization: Parameterization) -> Self {
        let given = Chain::from_classical(classical, parameterization);
        let (translation_m, rotation_rad) = prior.sigmas();
        let covariance = given.prior_covariance(classical, translation_m, rotation_rad);
        Self::with_covariance(given, covariance)
    }

    /// Prior with this covariance of the chain's columns (dof × dof).
    pub(super) fn with_covariance(given: Chain, covariance: DMatrix<f64>) -> Self {
        let prior_sigmas = covariance.diagonal().map(|variance| (variance + MIN_VARIANCE).sqrt());
        Self { given, prior_sigmas, square_root_information: square_root_information(covariance) }
    }

    /// Whitened difference `W·(chain ⊟ given)` (dof × 1).
    pub(super) fn residual(&self, chain: &Chain) -> DVector<f64> {
        &self.square_root_information * chain.minus(&self.given)
    }

    /// Derivative of the residual with respect to a step (dof × dof).
    pub(super) fn jacobian(&self) -> &DMatrix<f64> {
        &self.square_root_information
    }
}
