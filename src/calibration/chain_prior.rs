//! Prior on the chain as a least-squares term, of the rig or of earlier flights.

use nalgebra::{DMatrix, DVector};

use crate::gimbal::{Chain, ClassicalChain, Parameterization};
use crate::optimization::{MIN_PRIOR_VARIANCE, prior_square_root_information};
use crate::sensors::ChainPrior;

/// Given chain with its prior.
#[derive(Clone, Debug)]
pub(super) struct ChainTerm {
    pub(super) given: Chain,
    /// Prior standard deviation of each column.
    pub(super) prior_sigmas: DVector<f64>,
    /// `W` with `WᵀW` the inverse of the prior covariance.
    square_root_information: DMatrix<f64>,
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
        let prior_sigmas = covariance.diagonal().map(|variance| (variance + MIN_PRIOR_VARIANCE).sqrt());
        Self { given, prior_sigmas, square_root_information: prior_square_root_information(covariance) }
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
