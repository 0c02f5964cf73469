//! The estimated static calibration of a camera: its chain, clocks, shutter and intrinsics with their priors, and the
//! linearization point of the marginalization prior.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::sensor_columns::SensorColumn;
use crate::camera::CameraModel;
use crate::geometry::{RigidTransform, so3};
use crate::gimbal::{
    Chain, ChainLinearization, ClassicalChain, NearestForm, ParameterId, ParameterPart, Parameterization, Quantity,
    transport,
};

/// Prior standard deviations of the given chain, for every parameter of its classical form.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct GivenSigmas {
    pub(crate) translation_m: f64,
    pub(crate) rotation_rad: f64,
}

/// Given chain with its prior.
#[derive(Clone, Debug, PartialEq)]
struct GivenChain {
    classical: ClassicalChain,
    chain: Chain,
    sigmas: GivenSigmas,
    prior_sigmas: DVector<f64>,
    /// `W` with `WᵀW` the inverse of the prior covariance.
    square_root_information: DMatrix<f64>,
}

/// Estimated values.
#[derive(Clone, Debug, PartialEq)]
struct Values {
    chain: Chain,
    /// Estimated values of the sensor columns relative to the rig's.
    sensors: DVector<f64>,
}

impl Values {
    fn dof(&self) -> usize {
        self.chain.dof() + self.sensors.len()
    }

    fn plus(&self, delta: &[f64]) -> Self {
        let (chain, sensors) = delta.split_at(self.chain.dof());
        Self { chain: self.chain.plus_slice(chain), sensors: &self.sensors + DVector::from_column_slice(sensors) }
    }

    fn minus(&self, origin: &Self) -> DVector<f64> {
        let mut difference = DVector::zeros(self.dof());
        let chain = self.chain.dof();
        difference.rows_mut(0, chain).copy_from(&self.chain.minus(&origin.chain));
        difference.rows_mut(chain, self.sensors.len()).copy_from(&(&self.sensors - &origin.sensors));
        difference
    }
}

/// A chain with the clocks, the shutter and the intrinsics of its camera, free or fixed.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Calibration {
    values: Values,
    given: Arc<GivenChain>,
    /// Columns after the chain's, as parameters of the main camera.
    sensors: Arc<[SensorColumn]>,
    /// Readout time of the rig, in seconds.
    given_readout_s: f64,
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
        let values = Values { chain: given.chain.clone(), sensors: DVector::zeros(0) };
        Self {
            values,
            given: Arc::new(given),
            sensors: Arc::default(),
            given_readout_s: 0.0,
            first_estimate: None,
            free,
            frozen: Vec::new(),
        }
    }

    /// Adds columns of clocks, shutter and intrinsics; a fixed calibration has none.
    pub(crate) fn with_sensors(self, columns: Vec<SensorColumn>) -> Self {
        let columns = if self.free { columns } else { Vec::new() };
        let sensors = DVector::zeros(columns.len());
        Self { values: Values { sensors, ..self.values }, sensors: columns.into(), ..self }
    }

    /// This calibration with the columns of another one, which has all of its own; new ones start at the rig's values.
    pub(crate) fn with_columns_of(&self, wanted: &Self) -> Self {
        let of_columns = |values: &Values| {
            let value =
                |column: &SensorColumn| self.sensor(column.parameter).map_or(0.0, |place| values.sensors[place]);
            let sensors = wanted.sensors.iter().map(value);
            Values { chain: values.chain.clone(), sensors: DVector::from_iterator(wanted.sensors.len(), sensors) }
        };
        Self {
            values: of_columns(&self.values),
            first_estimate: self.first_estimate.as_ref().map(of_columns),
            sensors: Arc::clone(&wanted.sensors),
            ..self.clone()
        }
    }

    /// Readout time of the rig, in seconds; zero for a global shutter.
    pub(crate) fn with_given_readout(self, given_readout_s: f64) -> Self {
        Self { given_readout_s, ..self }
    }

    pub(crate) fn chain(&self) -> &Chain {
        &self.values.chain
    }

    /// Place of a parameter among the columns after the chain's.
    fn sensor(&self, parameter: ParameterId) -> Option<usize> {
        self.sensors.iter().position(|column| column.parameter == parameter)
    }

    /// Column of a parameter after the chain's.
    fn sensor_column(&self, parameter: ParameterId) -> Option<usize> {
        self.sensor(parameter).map(|place| self.chain().dof() + place)
    }

    /// Estimated value of a parameter relative to the rig's, zero without a column.
    fn sensor_value(&self, parameter: ParameterId) -> f64 {
        self.sensor(parameter).map_or(0.0, |place| self.values.sensors[place])
    }

    /// Time offset of the camera relative to the rig, in seconds: exposure time minus stamp.
    pub(crate) fn camera_shift_s(&self) -> f64 {
        self.sensor_value(ParameterId::timeshift(0))
    }

    /// Column of the camera's time offset.
    pub(crate) fn camera_shift_column(&self) -> Option<usize> {
        self.sensor_column(ParameterId::timeshift(0))
    }

    /// Time offset of the encoders, in seconds: measurement time minus stamp.
    pub(crate) fn encoder_shift_s(&self) -> f64 {
        self.sensor_value(ParameterId::ENCODER_TIMESHIFT)
    }

    /// Column of the encoders' time offset.
    pub(crate) fn encoder_shift_column(&self) -> Option<usize> {
        self.sensor_column(ParameterId::ENCODER_TIMESHIFT)
    }

    /// Readout time of the camera's shutter, in seconds.
    pub(crate) fn readout_s(&self) -> f64 {
        self.given_readout_s + self.sensor_value(ParameterId::readout(0))
    }

    /// Column of the readout time.
    pub(crate) fn readout_column(&self) -> Option<usize> {
        self.sensor_column(ParameterId::readout(0))
    }

    /// Whether the rows of an image are exposed at different times: by the rig, or because the readout is estimated.
    pub(crate) fn has_rolling_shutter(&self) -> bool {
        self.given_readout_s != 0.0 || self.readout_column().is_some()
    }

    /// Columns of the camera's intrinsics, in the order of [`Quantity::INTRINSICS`]; empty without.
    pub(crate) fn intrinsics_columns(&self) -> Range<usize> {
        let is_intrinsic = |column: &&SensorColumn| {
            column.parameter.part == ParameterPart::Camera(0)
                && Quantity::INTRINSICS.contains(&column.parameter.quantity)
        };
        let first = self.sensors.iter().position(|column| is_intrinsic(&column)).unwrap_or(0);
        let start = self.chain().dof() + first;
        start..start + self.sensors.iter().filter(is_intrinsic).count()
    }

    /// The camera model with the estimated intrinsics.
    pub(crate) fn camera_model<'m>(&self, given: &'m CameraModel) -> Cow<'m, CameraModel> {
        let columns = self.intrinsics_columns();
        if columns.is_empty() {
            return Cow::Borrowed(given);
        }
        let first = columns.start - self.chain().dof();
        let mut intrinsics = given.intrinsics();
        for (value, change) in intrinsics.iter_mut().zip(self.values.sensors.rows(first, columns.len()).iter()) {
            *value += change;
        }
        // Only a step of the solver far out of range is no camera any more; its cost is that of the given one.
        given.with_intrinsics(intrinsics).map_or(Cow::Borrowed(given), Cow::Owned)
    }

    /// The parameters of all columns, free or not, as those of the main camera.
    pub(crate) fn parameters(&self) -> Vec<ParameterId> {
        let mut parameters = self.chain().parameters();
        parameters.extend(self.sensors.iter().map(|column| column.parameter));
        parameters
    }

    /// Values of all columns; the camera's time offset as Kalibr's `timeshift_cam_imu`.
    pub(crate) fn values(&self) -> Vec<f64> {
        let sensors = self.values.sensors.iter().zip(self.sensors.iter());
        let sensors = sensors.map(|(change, column)| column.given + change);
        self.chain().values().iter().copied().chain(sensors).collect()
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
    /// of the columns after the chain's are zero.
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

    /// Whitened prior residual: difference from the rig's values; one row per column.
    pub(crate) fn prior_residual(&self) -> DVector<f64> {
        let chain = &self.given.square_root_information * self.chain().minus(&self.given.chain);
        let sensors = self.values.sensors.iter().zip(self.sensors.iter()).map(|(change, column)| change / column.sigma);
        DVector::from_iterator(self.values.dof(), chain.iter().copied().chain(sensors))
    }

    /// Derivative of the prior residual with respect to a step (columns × columns).
    ///
    /// For rotation blocks the logarithm of the difference rotates with the difference itself, and a step counts
    /// from the first estimate; the inner blocks of `poe` count as flat.
    pub(crate) fn prior_jacobian(&self) -> DMatrix<f64> {
        let (all, chain) = (self.values.dof(), self.chain().dof());
        let mut jacobian = self.given.square_root_information.clone().resize(all, all, 0.0);
        for (place, column) in (chain..all).zip(self.sensors.iter()) {
            jacobian[(place, place)] = column.sigma.recip();
        }
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
        let sensors = self.sensors.iter().map(|column| column.sigma);
        self.given.prior_sigmas.iter().copied().chain(sensors)
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
        let sensors = self.values.sensors.len();
        let mut old_from_new = DMatrix::identity(chain.nrows() + sensors, chain.ncols() + sensors);
        old_from_new.view_mut((0, 0), chain.shape()).copy_from(&chain);
        if let Some(first) = &mut self.first_estimate {
            first.chain = new;
        }
        self.values.chain = given.form_of(&self.values.chain);
        self.given = Arc::new(given);
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
