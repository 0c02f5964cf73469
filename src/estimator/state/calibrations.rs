//! Static calibrations of all cameras and of the IMU, with adjacent free columns.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::calibration::Calibration;
use super::calibration_posterior::{CalibrationPosterior, CameraPosterior, ColumnBelief};
use super::earlier_pass::FoundCamera;
use super::imu_calibration::ImuCalibration;
use super::imu_errors::{self, ImuErrors};
use crate::frontend::TrackedFeature;
use crate::gimbal::{ParameterId, Parameterization};

/// Index of the main camera, which may have joints. The window shows its image; its calibration has the first columns.
pub(crate) const MAIN: usize = 0;

/// Calibrations by camera, main camera first, then the IMU if its intrinsics are estimated.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Calibrations {
    cameras: Vec<Calibration>,
    imu: Option<Box<ImuCalibration>>,
}

impl Calibrations {
    pub(crate) fn new(main: Calibration, rigid: impl IntoIterator<Item = Calibration>) -> Self {
        Self { cameras: std::iter::once(main).chain(rigid).collect(), imu: None }
    }

    /// These calibrations with the camera that starts the window; `None` for the first rigid one.
    pub(crate) fn led_by(mut self, leading: Option<usize>) -> Self {
        for (index, camera) in self.cameras.iter_mut().enumerate() {
            camera.set_leads(leading == Some(index));
        }
        self
    }

    pub(crate) fn with_imu(self, imu: Option<ImuCalibration>) -> Self {
        Self { imu: imu.map(Box::new), ..self }
    }

    /// These calibrations at the values of an earlier pass; `found` is by camera.
    pub(crate) fn with_found(self, found: &[FoundCamera]) -> Self {
        let cameras = self.cameras.into_iter().zip(found).map(|(camera, found)| camera.with_found(found));
        Self { cameras: cameras.collect(), ..self }
    }

    /// These calibrations at the values of other flights, by camera; `None` keeps the rig's.
    pub(crate) fn with_flights(self, flights: &[Option<FoundCamera>]) -> Self {
        let cameras = self.cameras.into_iter().enumerate().map(|(place, camera)| {
            let flight = flights.get(place).and_then(Option::as_ref);
            match flight {
                Some(flight) => camera.with_flight(flight),
                None => camera,
            }
        });
        Self { cameras: cameras.collect(), ..self }
    }

    /// Values of all cameras with the `covariance` of all free columns; `None` if the calibration is fixed.
    pub(crate) fn posterior(&self, covariance: &DMatrix<f64>) -> Option<CalibrationPosterior> {
        let count = self.camera_columns();
        if count == 0 || count > covariance.nrows() {
            return None;
        }
        let (cameras, covariance) = self.in_reported_columns(covariance);
        Some(CalibrationPosterior { cameras, covariance, before: self.before_measurements() })
    }

    /// Number of columns of all cameras.
    fn camera_columns(&self) -> usize {
        self.cameras.iter().map(Calibration::dof).sum()
    }

    /// Values of all cameras with the covariance of the columns in which another flight takes them.
    fn in_reported_columns(&self, covariance: &DMatrix<f64>) -> (Vec<CameraPosterior>, DMatrix<f64>) {
        let count = self.camera_columns();
        let (mut cameras, mut by_estimate) = (Vec::new(), DMatrix::identity(count, count));
        for (camera, one) in self.cameras.iter().enumerate() {
            let (posterior, by_columns) = one.posterior();
            let start = self.columns(camera).start;
            by_estimate.view_mut((start, start), by_columns.shape()).copy_from(&by_columns);
            cameras.push(posterior);
        }
        let own = covariance.view((0, 0), (count, count));
        (cameras, &by_estimate * own * by_estimate.transpose())
    }

    /// Values of all cameras and their covariance before any measurement of the run.
    fn before_measurements(&self) -> Option<ColumnBelief> {
        let cameras = self.cameras.iter().map(Calibration::before_measurements).collect();
        let before = Self { cameras, ..self.clone() };
        let whitening = before.prior_jacobian();
        let covariance = whitening.tr_mul(&whitening).cholesky()?.inverse();
        let (cameras, covariance) = before.in_reported_columns(&covariance);
        Some(ColumnBelief { values: cameras.into_iter().flat_map(|camera| camera.values).collect(), covariance })
    }

    /// These calibrations with all columns of `wanted`.
    pub(crate) fn with_columns_of(&self, wanted: &Self) -> Self {
        let cameras = self.cameras.iter().zip(&wanted.cameras);
        Self {
            cameras: cameras.map(|(one, wanted)| one.with_columns_of(wanted)).collect(),
            imu: self.imu.clone().or_else(|| wanted.imu.clone()),
        }
    }

    /// Intrinsics of the IMU, `None` if they are not estimated.
    pub(crate) fn imu(&self) -> Option<&ImuCalibration> {
        self.imu.as_deref()
    }

    /// Correction of the IMU samples relative to the rig's, `None` if it is not estimated.
    pub(crate) fn imu_errors(&self) -> Option<&ImuErrors> {
        self.imu().map(ImuCalibration::errors)
    }

    /// Range of the IMU's columns; empty if its intrinsics are not estimated.
    pub(crate) fn imu_columns(&self) -> Range<usize> {
        let start = self.cameras.iter().map(Calibration::dof).sum();
        start..start + self.imu.as_ref().map_or(0, |_| ImuCalibration::DOF)
    }

    /// Fixes a parameter at its current value.
    pub(crate) fn freeze(&mut self, column: usize) {
        let imu = self.imu_columns();
        if let Some(calibration) = self.imu.as_mut().filter(|_| imu.contains(&column)) {
            calibration.freeze(column - imu.start);
            return;
        }
        if let Some(camera) = (0..self.cameras()).find(|camera| self.columns(*camera).contains(&column)) {
            let first = self.columns(camera).start;
            self.cameras[camera].freeze(column - first);
        }
    }

    pub(crate) fn cameras(&self) -> usize {
        self.cameras.len()
    }

    pub(crate) fn of(&self, camera: usize) -> &Calibration {
        &self.cameras[camera]
    }

    pub(crate) fn of_mut(&mut self, camera: usize) -> &mut Calibration {
        &mut self.cameras[camera]
    }

    /// Camera that starts the window: the chosen one, else a rigid one if there is one, since its extrinsics are most
    /// accurate.
    pub(crate) fn leading(&self) -> usize {
        let is_rigid = |calibration: &Calibration| calibration.base().is_none() && calibration.joint_count() == 0;
        let rigid = || self.cameras.iter().position(is_rigid);
        self.cameras.iter().position(Calibration::leads).or_else(rigid).unwrap_or(MAIN)
    }

    /// True if the leading camera's chain has [inaccurate rotations](Calibration::has_inaccurate_rotations).
    pub(crate) fn leads_inaccurately(&self) -> bool {
        self.of(self.leading()).has_inaccurate_rotations()
    }

    /// Parameters of all columns, free or not: chain and sensor columns of the main camera, then the rigid
    /// cameras, then the IMU.
    pub(crate) fn parameters(&self) -> Vec<ParameterId> {
        let imu = self.imu.iter().flat_map(|_| imu_errors::parameters());
        self.cameras.iter().flat_map(Calibration::numbered_parameters).chain(imu).collect()
    }

    /// Values of all columns, free or not.
    pub(crate) fn values(&self) -> Vec<f64> {
        let imu: Vec<f64> = self.imu.iter().flat_map(|imu| imu.values().data.0[0]).collect();
        self.cameras.iter().flat_map(Calibration::values).chain(imu).collect()
    }

    /// Prior standard deviation of each column.
    pub(crate) fn prior_sigmas(&self) -> Vec<f64> {
        let imu: Vec<f64> = self.imu.iter().flat_map(|_| ImuCalibration::sigmas().data.0[0]).collect();
        self.cameras.iter().flat_map(Calibration::prior_sigmas).chain(imu).collect()
    }

    pub(crate) fn dof(&self) -> usize {
        self.imu_columns().end
    }

    /// Range of one camera's columns.
    pub(crate) fn columns(&self, camera: usize) -> Range<usize> {
        let start = self.cameras[..camera].iter().map(Calibration::dof).sum();
        start..start + self.cameras[camera].dof()
    }

    /// Range of the columns on which the observations of a camera's features depend: its own, those from the first one of
    /// the camera that it is mounted on, and those to the last one of the other camera of its pair.
    pub(crate) fn pose_columns(&self, camera: usize) -> Range<usize> {
        let (one, own) = (self.of(camera), self.columns(camera));
        let start = one.base().map_or(own.start, |base| self.columns(base).start);
        start..one.partner().map_or(own.end, |partner| self.columns(partner).end)
    }

    /// The matched features of a camera if the other one of its pair is in the run, else none.
    pub(crate) fn matched<'m>(&self, camera: usize, matched: &'m [TrackedFeature]) -> &'m [TrackedFeature] {
        if self.of(camera).partner().is_some() { matched } else { &[] }
    }

    /// A camera, and the other one of its stereo pair.
    pub(crate) fn observers(&self, camera: usize) -> impl Iterator<Item = usize> {
        std::iter::once(camera).chain(self.of(camera).partner())
    }

    /// Columns fixed at their values.
    pub(crate) fn frozen_columns(&self) -> Vec<usize> {
        let of_camera = |camera: usize| {
            let start = self.columns(camera).start;
            self.cameras[camera].frozen_columns().into_iter().map(move |column| start + column)
        };
        let first = self.imu_columns().start;
        let of_imu = self.imu().into_iter().flat_map(ImuCalibration::frozen_columns).map(|column| first + column);
        (0..self.cameras()).flat_map(of_camera).chain(of_imu).collect()
    }

    /// Fixes the same parameters as `others`.
    pub(crate) fn freeze_as(&mut self, others: &Self) {
        for (one, other) in self.cameras.iter_mut().zip(&others.cameras) {
            one.freeze_as(other);
        }
        if let (Some(imu), Some(other)) = (&mut self.imu, &others.imu) {
            imu.freeze_as(other);
        }
    }

    /// Applies a step of the solver; with first estimates, the step is added in their tangent spaces.
    pub(crate) fn stepped(&self, delta: &[f64]) -> Self {
        let cameras = self.cameras.iter().enumerate();
        Self {
            cameras: cameras.map(|(camera, one)| one.stepped(&delta[self.columns(camera)])).collect(),
            imu: self.imu().map(|imu| Box::new(imu.stepped(&delta[self.imu_columns()]))),
        }
    }

    /// `x ⊟ x₀` (free columns), zero for a camera without a first estimate; `None` when no camera has one.
    pub(crate) fn first_estimate_offset(&self) -> Option<DVector<f64>> {
        let offsets: Vec<_> = self.cameras.iter().map(Calibration::first_estimate_offset).collect();
        let imu = self.imu().and_then(ImuCalibration::first_estimate_offset);
        if imu.is_none() && offsets.iter().all(Option::is_none) {
            return None;
        }
        let mut first_estimate_offset = DVector::zeros(self.dof());
        for (camera, offset) in offsets.iter().enumerate() {
            let columns = self.columns(camera);
            if let Some(offset) = offset.as_ref().filter(|offset| offset.len() == columns.len()) {
                first_estimate_offset.rows_range_mut(columns).copy_from(offset);
            }
        }
        if let Some(offset) = imu {
            first_estimate_offset.rows_range_mut(self.imu_columns()).copy_from(&offset);
        }
        Some(first_estimate_offset)
    }

    /// These calibrations at their first estimates, or at the current ones without them.
    pub(crate) fn at_first_estimate(&self) -> Self {
        Self {
            cameras: self.cameras.iter().map(Calibration::at_first_estimate).collect(),
            imu: self.imu().map(|imu| Box::new(imu.at_first_estimate())),
        }
    }

    /// Keeps the first estimates of calibrations with columns in the marginalization prior, or sets them to the current
    /// values; removes the first estimates of the others.
    pub(crate) fn keep_first_estimates(&mut self, prior_holds: impl Fn(&Range<usize>) -> bool) {
        for camera in 0..self.cameras() {
            let columns = self.columns(camera);
            self.cameras[camera].keep_first_estimate(prior_holds(&columns));
        }
        let columns = self.imu_columns();
        if let Some(imu) = &mut self.imu {
            imu.keep_first_estimate(prior_holds(&columns));
        }
    }

    /// Whitened prior residuals of all calibrations.
    pub(crate) fn prior_residual(&self) -> DVector<f64> {
        let offsets: Vec<DVector<f64>> = self.free().map(|(_, one)| one.prior_residual()).collect();
        let imu: Vec<ImuErrors> = self.imu().into_iter().map(ImuCalibration::prior_residual).collect();
        let values = offsets.iter().flat_map(DVector::iter).chain(imu.iter().flat_map(ImuErrors::iter));
        DVector::from_iterator(self.dof(), values.copied())
    }

    /// Derivative of the prior residuals with respect to a step.
    pub(crate) fn prior_jacobian(&self) -> DMatrix<f64> {
        let mut jacobian = DMatrix::zeros(self.dof(), self.dof());
        for (camera, one) in self.free() {
            let columns = self.columns(camera);
            jacobian.view_range_mut(columns.clone(), columns).copy_from(&one.prior_jacobian());
        }
        for (column, sigma) in self.imu_columns().zip(ImuCalibration::sigmas().iter()) {
            jacobian[(column, column)] = sigma.recip();
        }
        jacobian
    }

    fn free(&self) -> impl Iterator<Item = (usize, &Calibration)> {
        self.cameras.iter().enumerate().filter(|(_, one)| one.dof() > 0)
    }

    /// Switches the main camera's chain to another parameterization. Returns the derivative of the old columns with
    /// respect to the new ones at the first estimate.
    pub(crate) fn switch_parameterization(&mut self, parameterization: Parameterization) -> DMatrix<f64> {
        let old_from_new = self.cameras[MAIN].switch_parameterization(parameterization);
        let (old, main) = (old_from_new.nrows(), old_from_new.ncols());
        let others = self.dof() - self.cameras[MAIN].dof();
        let mut all = DMatrix::identity(old + others, main + others);
        all.view_mut((0, 0), (old, main)).copy_from(&old_from_new);
        all
    }
}
