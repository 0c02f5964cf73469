//! Estimated static calibration of a camera: chain, time offsets, shutter and intrinsics with their priors, and the
//! linearization point of the marginalization prior.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::calibration_posterior::CameraPosterior;
use super::earlier_pass::FoundCamera;
use super::given_chain::{EarlierPrior, GivenChain, GivenSigmas, PriorMeasurements};
use super::sensor_columns::SensorColumn;
use crate::camera::CameraModel;
use crate::geometry::{RigidTransform, so3};
use crate::gimbal::{
    Chain, ChainLinearization, ClassicalChain, ParameterId, ParameterPart, Parameterization, Quantity, transport,
};

/// Standard deviation of the given chain rotations above which they are inaccurate, in radians: derivatives at the
/// given chain have a relative error of the same size.
pub const INACCURATE_ROTATION_RAD: f64 = 0.03;

#[derive(Clone, Debug, PartialEq)]
struct Values {
    chain: Chain,
    /// Estimated values of the sensor columns, relative to the rig's.
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

/// Chain with the time offsets, shutter and intrinsics of its camera, free or fixed.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Calibration {
    values: Values,
    given: Arc<GivenChain>,
    /// Index among the cameras of the run; the main camera has 0.
    camera: usize,
    /// Number in the names of its parameters; the main camera has 0.
    number: u8,
    /// Camera of the run that its pose is relative to; `None` for the IMU.
    base: Option<usize>,
    /// Other camera of a stereo pair, mounted on this one, in whose images features of this one are matched.
    partner: Option<usize>,
    /// True if this camera starts the window in place of the first rigid one.
    leads: bool,
    /// Columns after the chain's, as parameters of the main camera.
    sensors: Arc<[SensorColumn]>,
    /// Readout time of the rig, in seconds.
    given_readout_s: f64,
    /// Rig's `camera_from_imu1` of the IMU on the gimbal, `None` without one.
    given_gimbal_imu: Option<RigidTransform>,
    first_estimate: Option<Values>,
    free: bool,
    /// Parameters fixed at their values; the parameterization may still change.
    frozen: Vec<ParameterId>,
}

impl Calibration {
    /// Given chain in a parameterization; `joint_offsets` is false without encoders, which fixes the joint offsets.
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
            camera: 0,
            number: 0,
            base: None,
            partner: None,
            leads: false,
            sensors: Arc::default(),
            given_readout_s: 0.0,
            given_gimbal_imu: None,
            first_estimate: None,
            free,
            frozen: Vec::new(),
        }
    }

    /// This calibration as the one of another camera of the run, with its number in the names of parameters.
    pub(crate) fn of_camera(self, camera: usize, number: u8) -> Self {
        Self { camera, number, ..self }
    }

    /// This calibration as the one of a camera that is mounted on another one of the run.
    pub(crate) fn mounted_on(self, base: Option<usize>) -> Self {
        Self { base, ..self }
    }

    pub(crate) fn camera(&self) -> usize {
        self.camera
    }

    pub(crate) fn base(&self) -> Option<usize> {
        self.base
    }

    /// This calibration with the other camera of a stereo pair.
    pub(crate) fn with_partner(self, partner: Option<usize>) -> Self {
        Self { partner, ..self }
    }

    pub(crate) fn partner(&self) -> Option<usize> {
        self.partner
    }

    /// Chooses this camera to start the window, or no longer.
    pub(crate) fn set_leads(&mut self, leads: bool) {
        self.leads = leads;
    }

    pub(crate) fn leads(&self) -> bool {
        self.leads
    }

    /// Adds columns for time offsets, shutter and intrinsics, unless the calibration is fixed.
    pub(crate) fn with_sensors(self, columns: Vec<SensorColumn>) -> Self {
        let columns = if self.free { columns } else { Vec::new() };
        let sensors = DVector::zeros(columns.len());
        Self { values: Values { sensors, ..self.values }, sensors: columns.into(), ..self }
    }

    /// This calibration with the columns of `wanted`, which contain its own; new columns start at the rig's values.
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
            given: if wanted.given.earlier().is_some() {
                let offsets = !self.chain().hides_joint_offsets();
                Arc::new(wanted.given.in_parameterization(self.chain().parameterization(), offsets))
            } else {
                Arc::clone(&self.given)
            },
            ..self.clone()
        }
    }

    /// This calibration at the values of an earlier pass, with that pass' covariance as its prior.
    pub(crate) fn with_found(self, found: &FoundCamera) -> Self {
        self.with_values_of(found, PriorMeasurements::SameFlight)
    }

    /// This calibration at the values of another flight, with their covariance as its prior, in the same
    /// parameterization; the values of `flight` after the chain's are absolute.
    pub(crate) fn with_flight(self, flight: &FoundCamera) -> Self {
        let parameterization = self.chain().parameterization();
        let given = |parameter: ParameterId| self.sensor(parameter).map_or(0.0, |place| self.sensors[place].given);
        let relative = flight.sensors.iter().map(|(parameter, value)| (*parameter, value - given(*parameter)));
        let found = FoundCamera { sensors: relative.collect(), ..flight.clone() };
        let mut calibration = self.with_values_of(&found, PriorMeasurements::OtherFlight);
        if calibration.chain().parameterization() != parameterization {
            calibration.switch_parameterization(parameterization);
        }
        calibration
    }

    fn with_values_of(self, found: &FoundCamera, measurements: PriorMeasurements) -> Self {
        if !self.free {
            return self;
        }
        let offsets = !self.chain().hides_joint_offsets();
        let chain = if offsets { found.chain.clone() } else { found.chain.clone().without_joint_offsets() };
        let before = Arc::new(self.given.in_parameterization(chain.parameterization(), offsets));
        // Columns that the earlier pass or flight did not estimate keep the rig's prior.
        let columns = chain.dof();
        let place_of = |column: &SensorColumn| {
            let place = found.sensors.iter().position(|(parameter, _)| *parameter == column.parameter);
            place.map(|place| columns + place)
        };
        let places: Vec<Option<usize>> = (0..columns).map(Some).chain(self.sensors.iter().map(place_of)).collect();
        let entry = |row: usize, column: usize| match (places[row], places[column]) {
            (Some(from), Some(to)) => found.covariance[(from, to)],
            _ if row == column => self.sensors[row - columns].sigma.powi(2),
            _ => 0.0,
        };
        let covariance = DMatrix::from_fn(places.len(), places.len(), entry);
        let expected =
            places[columns..].iter().map(|place| place.map_or(0.0, |place| found.sensors[place - columns].1));
        let expected = DVector::from_iterator(self.sensors.len(), expected);
        let earlier = EarlierPrior { measurements, covariance, expected: expected.clone(), before };
        Self {
            values: Values { chain: chain.clone(), sensors: expected },
            given: Arc::new(GivenChain::of_earlier_pass(&found.chain.to_classical(), chain, earlier)),
            ..self
        }
    }

    /// This calibration with the values and the prior before any measurement of the run: of the rig, or of another flight.
    pub(crate) fn before_measurements(&self) -> Self {
        let given = self.given.before_measurements();
        let of_rig = || DVector::zeros(self.sensors.len());
        let sensors = given.earlier().map_or_else(of_rig, |earlier| earlier.expected.clone());
        Self {
            values: Values { chain: given.chain.clone(), sensors },
            given: Arc::new(given.clone()),
            first_estimate: None,
            ..self.clone()
        }
    }

    /// Prior of the next pass over the same measurements. Mean: current estimate. Information:
    /// `Λ + weight·(covariance⁻¹ − Λ)` with `Λ` of the prior before the run's measurements.
    /// `None` when the covariance is not positive definite.
    pub(crate) fn next_pass_prior(&self, covariance: &DMatrix<f64>, weight: f64) -> Option<FoundCamera> {
        let chain = self.chain().dof();
        let carried = if self.free {
            let before = self.given.before_measurements();
            let mut of_prior = before.square_root_information.tr_mul(&before.square_root_information);
            of_prior.resize_mut(self.dof(), self.dof(), 0.0);
            if before.earlier().is_none() {
                for (place, column) in self.sensors.iter().enumerate() {
                    of_prior[(chain + place, chain + place)] = column.sigma.powi(-2);
                }
            }
            let information = covariance.clone().cholesky()?.inverse() * weight + of_prior * (1.0 - weight);
            information.cholesky()?.inverse()
        } else {
            DMatrix::zeros(0, 0)
        };
        let sensors = self.sensors.iter().zip(self.values.sensors.iter());
        Some(FoundCamera {
            chain: self.chain().clone(),
            covariance: carried,
            sensors: sensors.map(|(column, change)| (column.parameter, *change)).collect(),
        })
    }

    /// Standard deviations of `imu_from_camera` at these joint angles under the prior of another flight or an earlier
    /// pass, worst axis each: translation in metres, rotation in radians. `None` with the rig's prior.
    pub(crate) fn found_extrinsics_sigmas(&self, joints_rad: &[f64]) -> Option<(f64, f64)> {
        let earlier = self.given.earlier()?;
        let by_parameters = self.chain().linearize(self.own(joints_rad)).by_parameters;
        let covariance = earlier.covariance.view((0, 0), (by_parameters.ncols(), by_parameters.ncols()));
        let variances = (&by_parameters * covariance * by_parameters.transpose()).diagonal();
        let worst = |start: usize| variances.fixed_rows::<3>(start).max().max(0.0).sqrt();
        Some((worst(3), worst(0)))
    }

    /// Readout time of the rig, in seconds; zero for a global shutter.
    pub(crate) fn with_given_readout(self, given_readout_s: f64) -> Self {
        Self { given_readout_s, ..self }
    }

    /// Rig's `camera_from_imu1` of the IMU on the gimbal.
    pub(crate) fn with_given_gimbal_imu(self, given_gimbal_imu: Option<RigidTransform>) -> Self {
        Self { given_gimbal_imu, ..self }
    }

    pub(crate) fn chain(&self) -> &Chain {
        &self.values.chain
    }

    /// Index of a parameter among the columns after the chain's, `None` without a column.
    fn sensor(&self, parameter: ParameterId) -> Option<usize> {
        self.sensors.iter().position(|column| column.parameter == parameter)
    }

    /// Column of a parameter after the chain's, `None` without one.
    fn sensor_column(&self, parameter: ParameterId) -> Option<usize> {
        self.sensor(parameter).map(|place| self.chain().dof() + place)
    }

    /// Estimated value of a parameter relative to the rig's; zero without a column.
    fn sensor_value(&self, parameter: ParameterId) -> f64 {
        self.sensor(parameter).map_or(0.0, |place| self.values.sensors[place])
    }

    /// Time offset of the camera relative to the rig, in seconds: exposure time minus stamp.
    pub(crate) fn camera_shift_s(&self) -> f64 {
        self.sensor_value(ParameterId::timeshift(0))
    }

    pub(crate) fn camera_shift_column(&self) -> Option<usize> {
        self.sensor_column(ParameterId::timeshift(0))
    }

    /// Time offset of the encoders, in seconds: measurement time minus stamp.
    pub(crate) fn encoder_shift_s(&self) -> f64 {
        self.sensor_value(ParameterId::ENCODER_TIMESHIFT)
    }

    pub(crate) fn encoder_shift_column(&self) -> Option<usize> {
        self.sensor_column(ParameterId::ENCODER_TIMESHIFT)
    }

    /// Rig's `camera_from_imu1` of the IMU on the gimbal, `None` without one.
    pub(crate) fn given_gimbal_imu(&self) -> Option<&RigidTransform> {
        self.given_gimbal_imu.as_ref()
    }

    /// Corrections of the orientation of the IMU on the gimbal, as a rotation vector, and of its position in the camera's
    /// frame; zero without columns.
    pub(crate) fn gimbal_imu_correction(&self) -> [Vector3<f64>; 2] {
        let value = |quantity| self.sensor_value(ParameterId { part: ParameterPart::GimbalImu, quantity });
        [Quantity::ROTATION, Quantity::TRANSLATION].map(|quantities| quantities.map(value).into())
    }

    /// First of the six columns of [`Self::gimbal_imu_correction`], `None` if they are fixed.
    pub(crate) fn gimbal_imu_pose_column(&self) -> Option<usize> {
        self.sensor_column(ParameterId { part: ParameterPart::GimbalImu, quantity: Quantity::Rx })
    }

    /// Time offset of the IMU on the gimbal relative to the rig, in seconds: measurement time minus stamp.
    pub(crate) fn gimbal_imu_shift_s(&self) -> f64 {
        self.sensor_value(ParameterId::GIMBAL_IMU_TIMESHIFT)
    }

    pub(crate) fn gimbal_imu_shift_column(&self) -> Option<usize> {
        self.sensor_column(ParameterId::GIMBAL_IMU_TIMESHIFT)
    }

    /// Readout time of the camera's shutter, in seconds.
    pub(crate) fn readout_s(&self) -> f64 {
        self.given_readout_s + self.sensor_value(ParameterId::readout(0))
    }

    pub(crate) fn readout_column(&self) -> Option<usize> {
        self.sensor_column(ParameterId::readout(0))
    }

    /// True if the rows of an image are exposed at different times: by the rig, or because the readout time is
    /// estimated.
    pub(crate) fn has_rolling_shutter(&self) -> bool {
        self.given_readout_s != 0.0 || self.readout_column().is_some()
    }

    /// Columns of the camera's intrinsics, in the order of [`Quantity::INTRINSICS`]; empty if they are fixed.
    pub(crate) fn intrinsics_columns(&self) -> Range<usize> {
        let is_intrinsic = |column: &&SensorColumn| {
            column.parameter.part == ParameterPart::Camera(0)
                && Quantity::INTRINSICS.contains(&column.parameter.quantity)
        };
        let first = self.sensors.iter().position(|column| is_intrinsic(&column)).unwrap_or(0);
        let start = self.chain().dof() + first;
        start..start + self.sensors.iter().filter(is_intrinsic).count()
    }

    /// Camera model with the estimated intrinsics.
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
        // Invalid intrinsics occur only when a solver step goes far out of range; the given model then yields the cost.
        given.with_intrinsics(intrinsics).map_or(Cow::Borrowed(given), Cow::Owned)
    }

    /// Parameters of all columns, free or not.
    pub(crate) fn numbered_parameters(&self) -> Vec<ParameterId> {
        self.parameters().into_iter().map(|parameter| parameter.of_camera(self.number)).collect()
    }

    /// Parameters of all columns, free or not, with the names of the main camera's parameters.
    pub(crate) fn parameters(&self) -> Vec<ParameterId> {
        let mut parameters = self.chain().parameters();
        parameters.extend(self.sensors.iter().map(|column| column.parameter));
        parameters
    }

    /// Values of all columns, in `poe` relative to the rig's ([`Chain::values_from`]); the camera's time offset as Kalibr's
    /// `timeshift_cam_imu`.
    pub(crate) fn values(&self) -> Vec<f64> {
        let sensors = self.values.sensors.iter().zip(self.sensors.iter());
        let sensors = sensors.map(|(change, column)| column.given + change);
        self.chain().values_from(&self.given.rig().chain).iter().copied().chain(sensors).collect()
    }

    /// Fixes a parameter at its current value.
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

    /// Columns of a free calibration that are fixed at their values.
    pub(crate) fn frozen_columns(&self) -> Vec<usize> {
        if self.frozen.is_empty() || !self.free {
            return Vec::new();
        }
        let parameters = self.parameters().into_iter().enumerate();
        parameters.filter(|(_, parameter)| self.frozen.contains(parameter)).map(|(column, _)| column).collect()
    }

    pub(crate) fn dof(&self) -> usize {
        if self.free { self.values.dof() } else { 0 }
    }

    pub(crate) fn joint_count(&self) -> usize {
        self.chain().joint_count()
    }

    /// `imu_from_camera` at a frame's joint angles, which a rigid camera ignores.
    pub(crate) fn imu_from_camera(&self, joints_rad: &[f64]) -> RigidTransform {
        self.chain().imu_from_camera(self.own(joints_rad))
    }

    fn own<'a>(&self, joints_rad: &'a [f64]) -> &'a [f64] {
        &joints_rad[..self.joint_count().min(joints_rad.len())]
    }

    /// `imu_from_camera` with its derivatives with respect to the free columns and the joint angles; those
    /// of the columns after the chain's are zero.
    pub(crate) fn linearize(&self, joints_rad: &[f64]) -> ChainLinearization {
        let mut linearization = self.chain().linearize(self.own(joints_rad));
        if linearization.by_parameters.ncols() != self.dof() {
            linearization.by_parameters = linearization.by_parameters.resize_horizontally(self.dof(), 0.0);
        }
        linearization
    }

    /// Applies a step of the solver; with a first estimate, the step is added in its tangent space.
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

    /// `x ⊟ x₀` (free columns) from the first estimate `x₀`, `None` without one.
    pub(crate) fn first_estimate_offset(&self) -> Option<DVector<f64>> {
        self.first_estimate.as_ref().map(|first| self.values.minus(first))
    }

    /// This calibration at the first estimate, or at the current one without it.
    pub(crate) fn at_first_estimate(&self) -> Self {
        let values = self.first_estimate.as_ref().unwrap_or(&self.values).clone();
        Self { values, ..self.clone() }
    }

    /// Keeps the first estimate, or sets it to the current values, while the prior has calibration columns; otherwise
    /// removes it.
    pub(crate) fn keep_first_estimate(&mut self, in_prior: bool) {
        self.first_estimate = match self.first_estimate.take() {
            Some(first) if in_prior => Some(first),
            None if in_prior => Some(self.values.clone()),
            _ => None,
        };
    }

    /// Whitened prior residual, one row per column: difference from the rig's values or from the values of an earlier
    /// pass.
    pub(crate) fn prior_residual(&self) -> DVector<f64> {
        if let Some(earlier) = self.given.earlier() {
            let expected = Values { chain: self.given.chain.clone(), sensors: earlier.expected.clone() };
            return &self.given.square_root_information * self.values.minus(&expected);
        }
        let chain = &self.given.square_root_information * self.chain().minus(&self.given.chain);
        let sensors = self.values.sensors.iter().zip(self.sensors.iter()).map(|(change, column)| change / column.sigma);
        DVector::from_iterator(self.values.dof(), chain.iter().copied().chain(sensors))
    }

    /// Derivative of the prior residual with respect to a step (columns × columns).
    ///
    /// For rotation blocks it includes the right Jacobians of the logarithm of the difference and of the step from the
    /// first estimate; the inner blocks of `poe` are treated as vector spaces.
    pub(crate) fn prior_jacobian(&self) -> DMatrix<f64> {
        let (all, chain) = (self.values.dof(), self.chain().dof());
        let mut jacobian = self.given.square_root_information.clone().resize(all, all, 0.0);
        if self.given.earlier().is_none() {
            for (place, column) in (chain..all).zip(self.sensors.iter()) {
                jacobian[(place, place)] = column.sigma.recip();
            }
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

    /// True if rotations of the given chain have a standard deviation above [`INACCURATE_ROTATION_RAD`]; false if the chain
    /// is not calibrated, or comes from a flight or an earlier pass.
    pub(crate) fn has_inaccurate_rotations(&self) -> bool {
        self.free && self.given.rotation_sigma_rad() > INACCURATE_ROTATION_RAD
    }

    /// Standard deviation of each column under the rig's prior.
    pub(crate) fn prior_sigmas(&self) -> impl Iterator<Item = f64> + '_ {
        let sensors = self.sensors.iter().map(|column| column.sigma);
        self.given.rig_sigmas().iter().copied().chain(sensors)
    }

    /// Sets the chain to the ground truth.
    #[cfg(test)]
    pub(crate) fn set_chain(&mut self, chain: Chain) {
        self.values.chain = chain;
    }

    /// Switches to another parameterization. Returns the derivative of the old columns with respect to the new ones
    /// at the first estimate.
    pub(crate) fn switch_parameterization(&mut self, parameterization: Parameterization) -> DMatrix<f64> {
        let offsets = !self.chain().hides_joint_offsets();
        let old = &self.first_estimate.as_ref().unwrap_or(&self.values).chain;
        let given = self.given.in_parameterization(parameterization, offsets);
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

    /// Values with the standard deviations of the rig's prior, for another flight, and the derivative of their columns
    /// by the columns of the estimate.
    ///
    /// `poe` is the only parameterization whose columns depend on the way on which its values were reached.
    pub(crate) fn posterior(&self) -> (CameraPosterior, DMatrix<f64>) {
        let (classical, parameterization) = (self.chain().to_classical(), self.chain().parameterization());
        let mut by_columns = DMatrix::identity(self.values.dof(), self.values.dof());
        let mut values = self.values();
        if parameterization == Parameterization::Poe {
            let chain = GivenChain::form(&classical, parameterization, !self.chain().hides_joint_offsets());
            let by_chain = transport(self.chain(), &chain);
            by_columns.view_mut((0, 0), by_chain.shape()).copy_from(&by_chain);
            values.splice(..chain.dof(), chain.values().iter().copied());
        }
        let (parameters, rig_sigmas) = (self.parameters(), self.prior_sigmas().collect());
        (CameraPosterior { chain: classical, parameterization, parameters, values, rig_sigmas }, by_columns)
    }
}
