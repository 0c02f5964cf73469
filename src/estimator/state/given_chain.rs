//! Initial chain of an estimator with its prior: of the rig, of another flight, or of an earlier pass over the same
//! measurements.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use crate::gimbal::{Chain, ClassicalChain, NearestForm, Parameterization, transport, transport_covariance};
use crate::optimization::prior_square_root_information;

/// Prior standard deviations of the given chain, for all parameters of its classical parameterization.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct GivenSigmas {
    pub(crate) translation_m: f64,
    pub(crate) rotation_rad: f64,
}

/// Given chain with its prior.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct GivenChain {
    classical: ClassicalChain,
    pub(super) chain: Chain,
    uncertainty: Uncertainty,
    /// Prior standard deviations of the columns of `square_root_information`.
    prior_sigmas: DVector<f64>,
    /// `W` with `WᵀW` the inverse of the prior covariance: of the chain's columns, or of all columns after another
    /// flight or an earlier pass.
    pub(super) square_root_information: DMatrix<f64>,
}

/// Source of the prior on the given chain.
#[derive(Clone, Debug, PartialEq)]
enum Uncertainty {
    Rig(GivenSigmas),
    Earlier(EarlierPrior),
}

/// Prior from another flight or an earlier pass.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct EarlierPrior {
    pub(super) measurements: PriorMeasurements,
    /// Covariance of all columns.
    pub(super) covariance: DMatrix<f64>,
    /// Values of the columns after the chain's, relative to the rig's.
    pub(super) expected: DVector<f64>,
    /// Chain with the prior before that flight or pass.
    pub(super) before: Arc<GivenChain>,
}

/// Measurements that a prior other than the rig's comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PriorMeasurements {
    /// Those of the run itself, in an earlier pass.
    SameFlight,
    OtherFlight,
}

impl EarlierPrior {
    /// This prior after conversion of the chain `from` to `to`, another parameterization of it.
    fn transported(&self, from: &Chain, to: &Chain, before: GivenChain) -> Self {
        let (old, new, sensors) = (from.dof(), to.dof(), self.expected.len());
        let part = |start: (usize, usize), size: (usize, usize)| self.covariance.view(start, size).into_owned();
        let chain = transport_covariance(from, &part((0, 0), (old, old)), to);
        let chain_by_sensors = transport(from, to) * part((0, old), (old, sensors));
        let mut covariance = DMatrix::zeros(new + sensors, new + sensors);
        covariance.view_mut((0, 0), (new, new)).copy_from(&chain);
        covariance.view_mut((0, new), (new, sensors)).copy_from(&chain_by_sensors);
        covariance.view_mut((new, 0), (sensors, new)).copy_from(&chain_by_sensors.transpose());
        covariance.view_mut((new, new), (sensors, sensors)).copy_from(&part((old, old), (sensors, sensors)));
        Self { covariance, expected: self.expected.clone(), before: Arc::new(before), measurements: self.measurements }
    }
}

impl GivenChain {
    pub(super) fn new(
        classical: &ClassicalChain,
        parameterization: Parameterization,
        sigmas: GivenSigmas,
        joint_offsets: bool,
    ) -> Self {
        let chain = Self::form(classical, parameterization, joint_offsets);
        let covariance = chain.prior_covariance(classical, sigmas.translation_m, sigmas.rotation_rad);
        Self::with_covariance(classical, chain, Uncertainty::Rig(sigmas), covariance)
    }

    pub(super) fn of_earlier_pass(classical: &ClassicalChain, chain: Chain, earlier: EarlierPrior) -> Self {
        let covariance = earlier.covariance.clone();
        Self::with_covariance(classical, chain, Uncertainty::Earlier(earlier), covariance)
    }

    fn with_covariance(
        classical: &ClassicalChain,
        chain: Chain,
        uncertainty: Uncertainty,
        covariance: DMatrix<f64>,
    ) -> Self {
        let prior_sigmas = covariance.diagonal().map(|variance| variance.max(0.0).sqrt());
        let square_root_information = prior_square_root_information(covariance);
        Self { classical: classical.clone(), chain, uncertainty, prior_sigmas, square_root_information }
    }

    /// Chain in a parameterization; `joint_offsets` is false without encoders, which fixes the joint offsets.
    pub(super) fn form(classical: &ClassicalChain, parameterization: Parameterization, joint_offsets: bool) -> Chain {
        let whole = Chain::from_classical(classical, parameterization);
        if joint_offsets { whole } else { whole.without_joint_offsets() }
    }

    /// The same chain and prior in another parameterization.
    pub(super) fn in_parameterization(&self, parameterization: Parameterization, joint_offsets: bool) -> Self {
        match &self.uncertainty {
            Uncertainty::Rig(sigmas) => Self::new(&self.classical, parameterization, *sigmas, joint_offsets),
            Uncertainty::Earlier(earlier) => {
                let chain = Self::form(&self.classical, parameterization, joint_offsets);
                let before = earlier.before.in_parameterization(parameterization, joint_offsets);
                let earlier = earlier.transported(&self.chain, &chain, before);
                Self::of_earlier_pass(&self.classical, chain, earlier)
            }
        }
    }

    /// Prior from another flight or an earlier pass, `None` if the chain is the rig's.
    pub(super) fn earlier(&self) -> Option<&EarlierPrior> {
        match &self.uncertainty {
            Uncertainty::Rig(_) => None,
            Uncertainty::Earlier(earlier) => Some(earlier),
        }
    }

    /// The rig's chain in the current parameterization.
    pub(super) fn rig(&self) -> &Self {
        self.earlier().map_or(self, |earlier| earlier.before.rig())
    }

    /// Chain with the prior before any measurement of the run: of the rig, or of another flight.
    pub(super) fn before_measurements(&self) -> &Self {
        match self.earlier() {
            Some(EarlierPrior { measurements: PriorMeasurements::SameFlight, before, .. }) => before,
            _ => self,
        }
    }

    /// Standard deviation of the rig's rotations in radians; 0 if the chain comes from a flight or an earlier pass.
    pub(super) fn rotation_sigma_rad(&self) -> f64 {
        match &self.uncertainty {
            Uncertainty::Rig(sigmas) => sigmas.rotation_rad,
            Uncertainty::Earlier(_) => 0.0,
        }
    }

    /// Standard deviations of the chain's columns under the rig's prior.
    pub(super) fn rig_sigmas(&self) -> &DVector<f64> {
        &self.rig().prior_sigmas
    }

    /// Converts a mechanism to the given chain's parameterization.
    ///
    /// The classical parameterization has many values for the same mechanism. The result is the one nearest to the
    /// given values, in units of their standard deviations: for any other the residual of the rig's prior would be
    /// larger.
    pub(super) fn form_of(&self, mechanism: &Chain) -> Chain {
        let sigmas = self.prior_sigmas.rows(0, self.chain.dof()).into_owned();
        NearestForm::new(self.chain.clone(), &sigmas).of(mechanism)
    }
}
