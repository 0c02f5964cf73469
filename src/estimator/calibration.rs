//! The static calibration as the window estimates it: the gimbal's chain, how wrong it may be, and where the
//! marginalization prior was linearized.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use crate::geometry::{RigidTransform, so3};
use crate::gimbal::{Chain, ChainLinearization, ClassicalChain, Parameterization, transport};

/// How wrong the given chain may be, as standard deviations of every number of its classical form.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct GivenSigmas {
    pub(super) translation_m: f64,
    pub(super) rotation_rad: f64,
}

/// What the rig says about the chain.
#[derive(Clone, Debug)]
struct GivenChain {
    classical: ClassicalChain,
    chain: Chain,
    sigmas: GivenSigmas,
    prior_sigmas: DVector<f64>,
    /// `W` with `WᵀW` the inverse of the prior covariance.
    square_root_information: DMatrix<f64>,
}

/// The chain, free or fixed.
#[derive(Clone, Debug)]
pub(super) struct Calibration {
    chain: Chain,
    given: GivenChain,
    first_estimate: Option<Chain>,
    free: bool,
}

impl Calibration {
    /// The given chain in a parameterization; without encoders its joint offsets are held fixed.
    pub(super) fn new(
        classical: &ClassicalChain,
        parameterization: Parameterization,
        sigmas: GivenSigmas,
        free: bool,
        joint_offsets: bool,
    ) -> Self {
        let given = GivenChain::new(classical, parameterization, sigmas, joint_offsets);
        Self { chain: given.chain.clone(), given, first_estimate: None, free }
    }

    pub(super) fn chain(&self) -> &Chain {
        &self.chain
    }

    /// Number of free columns.
    pub(super) fn dof(&self) -> usize {
        if self.free { self.chain.dof() } else { 0 }
    }

    pub(super) fn joint_count(&self) -> usize {
        self.chain.joint_count()
    }

    /// Pose of the camera at a frame's joint angles, which a rigid mount does not follow.
    pub(super) fn imu_from_camera(&self, joints_rad: &[f64]) -> RigidTransform {
        self.chain.imu_from_camera(self.own(joints_rad))
    }

    fn own<'a>(&self, joints_rad: &'a [f64]) -> &'a [f64] {
        &joints_rad[..self.joint_count().min(joints_rad.len())]
    }

    /// Pose of the camera with its derivatives by the free columns and by the joints.
    pub(super) fn linearize(&self, joints_rad: &[f64]) -> ChainLinearization {
        let mut linearization = self.chain.linearize(self.own(joints_rad));
        if !self.free {
            linearization.by_parameters = linearization.by_parameters.columns(0, 0).into_owned();
        }
        linearization
    }

    /// A step of the solver, counted from the first estimate where there is one.
    pub(super) fn stepped(&self, delta: &[f64]) -> Self {
        if !self.free {
            return self.clone();
        }
        let chain = match &self.first_estimate {
            None => self.chain.plus_slice(delta),
            Some(first) => first.plus(&(self.chain.minus(first) + DVector::from_column_slice(delta))),
        };
        Self { chain, ..self.clone() }
    }

    /// `x ⊟ x₀`, `None` without a first estimate.
    pub(super) fn deviation(&self) -> Option<DVector<f64>> {
        self.first_estimate.as_ref().map(|first| self.chain.minus(first))
    }

    /// The calibration at the first estimate, or as it is.
    pub(super) fn at_first_estimate(&self) -> Self {
        let chain = self.first_estimate.as_ref().unwrap_or(&self.chain).clone();
        Self { chain, ..self.clone() }
    }

    /// The prior holds the calibration (keep the first estimate, or take the present one), or holds it no more.
    pub(super) fn keep_first_estimate(&mut self, held: bool) {
        self.first_estimate = match self.first_estimate.take() {
            Some(first) if held => Some(first),
            None if held => Some(self.chain.clone()),
            _ => None,
        };
    }

    /// Whitened deviation from the given chain.
    pub(super) fn prior_residual(&self) -> DVector<f64> {
        &self.given.square_root_information * self.chain.minus(&self.given.chain)
    }

    /// Its derivative by a step.
    ///
    /// For rotation blocks the logarithm of the deviation turns with the deviation itself, and a step counts from the first
    /// estimate; the inner blocks of `poe` are taken as flat.
    pub(super) fn prior_jacobian(&self) -> DMatrix<f64> {
        let mut jacobian = self.given.square_root_information.clone();
        let starts: &[usize] = match self.chain.parameterization() {
            Parameterization::Classical => &[0, self.chain.dof() - 6],
            Parameterization::Poe => &[self.chain.dof() - 6],
            _ if self.joint_count() == 0 => &[0],
            _ => &[],
        };
        if starts.is_empty() {
            return jacobian;
        }
        let from_given = self.chain.minus(&self.given.chain);
        let from_first = self.deviation();
        for start in starts {
            let turn: Vector3<f64> = from_given.fixed_rows::<3>(*start).into_owned();
            let mut by_step: Matrix3<f64> = so3::right_jacobian_inverse(&turn);
            if let Some(deviation) = &from_first {
                by_step *= so3::right_jacobian(&deviation.fixed_rows::<3>(*start).into_owned());
            }
            let turned = jacobian.fixed_columns::<3>(*start) * by_step;
            jacobian.fixed_columns_mut::<3>(*start).copy_from(&turned);
        }
        jacobian
    }

    /// Prior standard deviation of each column.
    pub(super) fn prior_sigmas(&self) -> &DVector<f64> {
        &self.given.prior_sigmas
    }

    /// Moves to the truth of a test.
    #[cfg(test)]
    pub(super) fn set_chain(&mut self, chain: Chain) {
        self.chain = chain;
    }

    /// Goes over to another chart; returns how the old columns follow the new ones at the first estimate.
    pub(super) fn switch_chart(&mut self, parameterization: Parameterization) -> DMatrix<f64> {
        let offsets = !self.chain.hides_joint_offsets();
        let old = self.first_estimate.as_ref().unwrap_or(&self.chain).clone();
        let new = old.in_parameterization(parameterization);
        let old_from_new = transport(&new, &old);
        self.first_estimate = self.first_estimate.as_ref().map(|_| new);
        self.chain = self.chain.in_parameterization(parameterization);
        self.given = GivenChain::new(&self.given.classical, parameterization, self.given.sigmas, offsets);
        old_from_new
    }
}

impl GivenChain {
    fn new(
        classical: &ClassicalChain,
        parameterization: Parameterization,
        sigmas: GivenSigmas,
        joint_offsets: bool,
    ) -> Self {
        let whole = Chain::from_classical(classical, parameterization);
        let chain = if joint_offsets { whole } else { whole.without_joint_offsets() };
        let covariance = chain.prior_covariance(classical, sigmas.translation_m, sigmas.rotation_rad);
        let prior_sigmas = covariance.diagonal().map(|variance| variance.max(0.0).sqrt());
        // A column that the prior fixes entirely would make the covariance singular.
        let floor = 1e-12;
        let mut regular = covariance;
        for k in 0..regular.nrows() {
            regular[(k, k)] += floor;
        }
        let dof = chain.dof();
        let square_root_information = regular
            .cholesky()
            .and_then(|factor| factor.l().solve_lower_triangular(&DMatrix::identity(dof, dof)))
            .unwrap_or_else(|| DMatrix::from_diagonal(&prior_sigmas.map(|sigma| 1.0 / sigma.max(1e-6))));
        Self { classical: classical.clone(), chain, sigmas, prior_sigmas, square_root_information }
    }
}
