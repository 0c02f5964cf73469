//! The estimated static calibration: the gimbal's chain with its prior, and the linearization point of the
//! marginalization prior.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use crate::geometry::{RigidTransform, so3};
use crate::gimbal::{Chain, ChainLinearization, ClassicalChain, NearestForm, ParameterId, Parameterization, transport};

/// Prior standard deviations of the given chain, for every parameter of its classical form.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct GivenSigmas {
    pub(crate) translation_m: f64,
    pub(crate) rotation_rad: f64,
}

/// Given chain with its prior.
#[derive(Clone, Debug)]
struct GivenChain {
    classical: ClassicalChain,
    chain: Chain,
    sigmas: GivenSigmas,
    prior_sigmas: DVector<f64>,
    /// `W` with `WᵀW` the inverse of the prior covariance.
    square_root_information: DMatrix<f64>,
}

/// Prior standard deviation of a time offset relative to the rig, in seconds: transport and exposure delay an
/// image by a frame period at most.
const CLOCK_SIGMA_S: f64 = 0.02;

/// Estimated time offsets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FreeClocks {
    /// None.
    None,
    /// That of the camera.
    Camera,
    /// Those of camera and encoders.
    CameraAndEncoders,
}

impl FreeClocks {
    /// Time offsets in the order of their columns after the chain's, as parameters of the main camera.
    fn parameters(self) -> &'static [ParameterId] {
        const ALL: [ParameterId; 2] = [ParameterId::timeshift(0), ParameterId::ENCODER_TIMESHIFT];
        match self {
            Self::None => &[],
            Self::Camera => &ALL[..1],
            Self::CameraAndEncoders => &ALL,
        }
    }
}

/// Estimated values.
#[derive(Clone, Debug)]
struct Values {
    chain: Chain,
    /// Estimated time offsets relative to the rig, in seconds: IMU time is the stamp plus the offset. The camera's,
    /// then the encoders'.
    clocks_s: DVector<f64>,
}

impl Values {
    fn dof(&self) -> usize {
        self.chain.dof() + self.clocks_s.len()
    }

    fn plus(&self, delta: &[f64]) -> Self {
        let (chain, clocks) = delta.split_at(self.chain.dof());
        Self { chain: self.chain.plus_slice(chain), clocks_s: &self.clocks_s + DVector::from_column_slice(clocks) }
    }

    fn minus(&self, origin: &Self) -> DVector<f64> {
        let mut difference = DVector::zeros(self.dof());
        let chain = self.chain.dof();
        difference.rows_mut(0, chain).copy_from(&self.chain.minus(&origin.chain));
        difference.rows_mut(chain, self.clocks_s.len()).copy_from(&(&self.clocks_s - &origin.clocks_s));
        difference
    }
}

/// A chain with its time offsets, free or fixed.
#[derive(Clone, Debug)]
pub(crate) struct Calibration {
    values: Values,
    given: GivenChain,
    clocks: FreeClocks,
    /// Time offset of the camera in the given rig: stamps already include it.
    given_timeshift_s: f64,
    first_estimate: Option<Values>,
    free: bool,
    /// Parameters fixed at their values; the parameterization may change.
    frozen: Vec<ParameterId>,
}

impl Calibration {
    /// The given chain in a parameterization; without encoders its joint offsets are fixed.
    pub(crate) fn new(
        classical: &ClassicalChain,
        parameterization: Parameterization,
        sigmas: GivenSigmas,
        free: bool,
        joint_offsets: bool,
    ) -> Self {
        let given = GivenChain::new(classical, parameterization, sigmas, joint_offsets);
        let values = Values { chain: given.chain.clone(), clocks_s: DVector::zeros(0) };
        Self {
            values,
            given,
            clocks: FreeClocks::None,
            given_timeshift_s: 0.0,
            first_estimate: None,
            free,
            frozen: Vec::new(),
        }
    }

    /// Adds time offsets; a fixed calibration has none.
    pub(crate) fn with_clocks(self, clocks: FreeClocks, given_timeshift_s: f64) -> Self {
        let clocks = if self.free { clocks } else { FreeClocks::None };
        let clocks_s = DVector::zeros(clocks.parameters().len());
        Self { values: Values { clocks_s, ..self.values }, clocks, given_timeshift_s, ..self }
    }

    pub(crate) fn chain(&self) -> &Chain {
        &self.values.chain
    }

    /// Time offset of the camera relative to the rig, in seconds: exposure time minus stamp.
    pub(crate) fn camera_shift_s(&self) -> f64 {
        self.values.clocks_s.get(0).copied().unwrap_or(0.0)
    }

    /// Column of the camera's time offset.
    pub(crate) fn camera_shift_column(&self) -> Option<usize> {
        (self.clocks != FreeClocks::None).then(|| self.chain().dof())
    }

    /// Time offset of the encoders, in seconds: measurement time minus stamp.
    pub(crate) fn encoder_shift_s(&self) -> f64 {
        self.values.clocks_s.get(1).copied().unwrap_or(0.0)
    }

    /// Column of the encoders' time offset.
    pub(crate) fn encoder_shift_column(&self) -> Option<usize> {
        (self.clocks == FreeClocks::CameraAndEncoders).then(|| self.chain().dof() + 1)
    }

    /// The parameters of all columns, free or not, as those of the main camera.
    pub(crate) fn parameters(&self) -> Vec<ParameterId> {
        let mut parameters = self.chain().parameters();
        parameters.extend(self.clocks.parameters());
        parameters
    }

    /// Values of all columns; the camera's time offset as Kalibr's `timeshift_cam_imu`.
    pub(crate) fn values(&self) -> Vec<f64> {
        let given = [self.given_timeshift_s, 0.0];
        let clocks = self.values.clocks_s.iter().zip(given).map(|(shift_s, given_s)| given_s + shift_s);
        self.chain().values().iter().copied().chain(clocks).collect()
    }

    /// Fixes a parameter at its present value.
    pub(crate) fn freeze(&mut self, column: usize) {
        let parameter = self.parameters()[column];
        if !self.frozen.contains(&parameter) {
            self.frozen.push(parameter);
        }
    }

    /// Fixes the same parameters as another calibration.
    pub(crate) fn freeze_as(&mut self, other: &Self) {
        self.frozen.clone_from(&other.frozen);
    }

    /// Free columns that are fixed at their values.
    pub(crate) fn frozen_columns(&self) -> Vec<usize> {
        if self.frozen.is_empty() || !self.free {
            return Vec::new();
        }
        let parameters = self.parameters().into_iter().enumerate();
        parameters.filter(|(_, parameter)| self.frozen.contains(parameter)).map(|(column, _)| column).collect()
    }

    /// Number of free columns.
    pub(crate) fn dof(&self) -> usize {
        if self.free { self.values.dof() } else { 0 }
    }

    pub(crate) fn joint_count(&self) -> usize {
        self.chain().joint_count()
    }

    /// Returns `imu_from_camera` at a frame's joint angles; a rigid camera ignores them.
    pub(crate) fn imu_from_camera(&self, joints_rad: &[f64]) -> RigidTransform {
        self.chain().imu_from_camera(self.own(joints_rad))
    }

    fn own<'a>(&self, joints_rad: &'a [f64]) -> &'a [f64] {
        &joints_rad[..self.joint_count().min(joints_rad.len())]
    }

    /// Returns `imu_from_camera` with its derivatives with respect to the free columns and the joint angles; those
    /// of time offsets are zero.
    pub(crate) fn linearize(&self, joints_rad: &[f64]) -> ChainLinearization {
        let mut linearization = self.chain().linearize(self.own(joints_rad));
        if linearization.by_parameters.ncols() != self.dof() {
            linearization.by_parameters = linearization.by_parameters.resize_horizontally(self.dof(), 0.0);
        }
        linearization
    }

    /// Applies a step of the solver, counted from the first estimate where there is one.
    pub(crate) fn stepped(&self, delta: &[f64]) -> Self {
        if !self.free {
            return self.clone();
        }
        let values = match &self.first_estimate {
            None => self.values.plus(delta),
            Some(first) => first.plus((self.values.minus(first) + DVector::from_column_slice(delta)).as_slice()),
        };
        Self { values, ..self.clone() }
    }

    /// Returns `x ⊟ x₀` (free columns), `None` without a first estimate.
    pub(crate) fn first_estimate_offset(&self) -> Option<DVector<f64>> {
        self.first_estimate.as_ref().map(|first| self.values.minus(first))
    }

    /// Returns the calibration at the first estimate, or the present one without it.
    pub(crate) fn at_first_estimate(&self) -> Self {
        let values = self.first_estimate.as_ref().unwrap_or(&self.values).clone();
        Self { values, ..self.clone() }
    }

    /// Keeps the first estimate, or takes the present one, while the prior has calibration columns; drops it
    /// otherwise.
    pub(crate) fn keep_first_estimate(&mut self, in_prior: bool) {
        self.first_estimate = match self.first_estimate.take() {
            Some(first) if in_prior => Some(first),
            None if in_prior => Some(self.values.clone()),
            _ => None,
        };
    }

    /// Whitened prior residual: difference from the given chain, and time offsets; one row per column.
    pub(crate) fn prior_residual(&self) -> DVector<f64> {
        let chain = &self.given.square_root_information * self.chain().minus(&self.given.chain);
        let clocks = self.values.clocks_s.iter().map(|shift_s| shift_s / CLOCK_SIGMA_S);
        DVector::from_iterator(self.values.dof(), chain.iter().copied().chain(clocks))
    }

    /// Derivative of the prior residual with respect to a step (columns × columns).
    ///
    /// For rotation blocks the logarithm of the difference rotates with the difference itself, and a step counts
    /// from the first estimate; the inner blocks of `poe` count as flat.
    pub(crate) fn prior_jacobian(&self) -> DMatrix<f64> {
        let (all, chain) = (self.values.dof(), self.chain().dof());
        let mut jacobian = self.given.square_root_information.clone().resize(all, all, 0.0);
        (chain..all).for_each(|clock| jacobian[(clock, clock)] = CLOCK_SIGMA_S.recip());
        let starts: &[usize] = match self.chain().parameterization() {
            Parameterization::Classical => &[0, chain - 6],
            Parameterization::Poe => &[chain - 6],
            _ if self.joint_count() == 0 => &[0],
            _ => &[],
        };
        if starts.is_empty() {
            return jacobian;
        }
        let from_given = self.chain().minus(&self.given.chain);
        let from_first = self.first_estimate_offset();
        for start in starts {
            let rotation_vector: Vector3<f64> = from_given.fixed_rows::<3>(*start).into_owned();
            let mut by_step: Matrix3<f64> = so3::right_jacobian_inverse(&rotation_vector);
            if let Some(first_estimate_offset) = &from_first {
                by_step *= so3::right_jacobian(&first_estimate_offset.fixed_rows::<3>(*start).into_owned());
            }
            let by_step_columns = jacobian.fixed_columns::<3>(*start) * by_step;
            jacobian.fixed_columns_mut::<3>(*start).copy_from(&by_step_columns);
        }
        jacobian
    }

    /// Prior standard deviation of each column.
    pub(crate) fn prior_sigmas(&self) -> impl Iterator<Item = f64> + '_ {
        let clocks = std::iter::repeat_n(CLOCK_SIGMA_S, self.values.clocks_s.len());
        self.given.prior_sigmas.iter().copied().chain(clocks)
    }

    /// Sets the ground truth in a test.
    #[cfg(test)]
    pub(crate) fn set_chain(&mut self, chain: Chain) {
        self.values.chain = chain;
    }

    /// Switches to another parameterization; returns the derivative of the old columns with respect to the new ones
    /// at the first estimate.
    pub(crate) fn switch_parameterization(&mut self, parameterization: Parameterization) -> DMatrix<f64> {
        let offsets = !self.chain().hides_joint_offsets();
        let old = &self.first_estimate.as_ref().unwrap_or(&self.values).chain;
        let given = GivenChain::new(&self.given.classical, parameterization, self.given.sigmas, offsets);
        let new = given.form_of(old);
        let chain = transport(&new, old);
        let clocks = self.values.clocks_s.len();
        let mut old_from_new = DMatrix::identity(chain.nrows() + clocks, chain.ncols() + clocks);
        old_from_new.view_mut((0, 0), chain.shape()).copy_from(&chain);
        if let Some(first) = &mut self.first_estimate {
            first.chain = new;
        }
        self.values.chain = given.form_of(&self.values.chain);
        self.given = given;
        old_from_new
    }
}

impl GivenChain {
    /// Converts a mechanism to the given chain's parameterization.
    ///
    /// The classical form has many values for the same mechanism. The values nearest to the given ones are used, in
    /// units of their standard deviations: at any others the rig's prior would pull.
    fn form_of(&self, mechanism: &Chain) -> Chain {
        NearestForm::new(self.chain.clone(), &self.prior_sigmas).of(mechanism)
    }

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
        // A column that the prior fixes would make the covariance singular.
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
