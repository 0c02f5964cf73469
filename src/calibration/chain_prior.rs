//! Rig's prior on the chain as a least-squares term in the minimal parameterization.

use nalgebra::{DMatrix, DVector};

use crate::gimbal::{Chain, ClassicalChain, auto_parameterization};
use crate::sensors::ChainPrior;

/// Variance added to every column, so that the covariance stays regular when the prior fixes a column.
const MIN_VARIANCE: f64 = 1e-12;

/// Given chain in its best minimal parameterization, with its prior.
#[derive(Clone, Debug)]
pub(super) struct ChainTerm {
    pub(super) given: Chain,
    /// Prior standard deviation of each column.
    pub(super) prior_sigmas: DVector<f64>,
    /// `W` with `WᵀW` the inverse of the prior covariance.
    square_root_information: DMatrix<f64>,
}

impl ChainTerm {
    pub(super) fn new(classical: &ClassicalChain, prior: &ChainPrior) -> Self {
        let given = Chain::from_classical(classical, auto_parameterization(classical));
        let (translation_m, rotation_rad) = prior.sigmas();
        let mut covariance = given.prior_covariance(classical, translation_m, rotation_rad);
        for k in 0..covariance.nrows() {
            covariance[(k, k)] += MIN_VARIANCE;
        }
        let prior_sigmas = covariance.diagonal().map(f64::sqrt);
        let dof = given.dof();
        let square_root_information = covariance
            .cholesky()
            .and_then(|factor| factor.l().solve_lower_triangular(&DMatrix::identity(dof, dof)))
            .unwrap_or_else(|| DMatrix::from_diagonal(&prior_sigmas.map(|sigma| 1.0 / sigma)));
        Self { given, prior_sigmas, square_root_information }
    }

    /// Whitened difference `W·(chain ⊟ given)` (dof × 1).
    pub(super) fn residual(&self, chain: &Chain) -> DVector<f64> {
        &self.square_root_information * chain.minus(&self.given)
    }

    /// Derivative of the residual with respect to a step (dof × dof).
    pub(super) fn jacobian(&self) -> &DMatrix<f64> {
        &self.square_root_information
    }

    /// Prior information `WᵀW` (dof × dof).
    pub(super) fn information(&self) -> DMatrix<f64> {
        self.square_root_information.tr_mul(&self.square_root_information)
    }
}
