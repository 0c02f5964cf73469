//! Static calibrations of all cameras with adjacent free columns.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::calibration::Calibration;
use crate::gimbal::{ParameterId, Parameterization};

/// Index of the main camera, which may have joints. Its image is shown, its calibration has the first columns.
pub(crate) const MAIN: usize = 0;

/// The calibrations by camera, the main camera's first.
#[derive(Clone, Debug)]
pub(crate) struct Calibrations(Vec<Calibration>);

impl Calibrations {
    /// Collects the main camera's calibration and those of the further rigid cameras.
    pub(crate) fn new(main: Calibration, rigid: impl IntoIterator<Item = Calibration>) -> Self {
        Self(std::iter::once(main).chain(rigid).collect())
    }

    /// Number of cameras.
    pub(crate) fn cameras(&self) -> usize {
        self.0.len()
    }

    pub(crate) fn of(&self, camera: usize) -> &Calibration {
        &self.0[camera]
    }

    pub(crate) fn of_mut(&mut self, camera: usize) -> &mut Calibration {
        &mut self.0[camera]
    }

    /// Camera with which the window starts: a rigid one if there is one, since its extrinsics are most accurate.
    pub(crate) fn leading(&self) -> usize {
        self.0.iter().position(|calibration| calibration.joint_count() == 0).unwrap_or(MAIN)
    }

    /// Parameters of all columns, free or not: the main camera's chain and time offsets, then those of the rigid
    /// cameras.
    pub(crate) fn parameters(&self) -> Vec<ParameterId> {
        let of = |(camera, one): (usize, &Calibration)| {
            one.parameters().into_iter().map(move |parameter| parameter.of_camera(camera as u8))
        };
        self.0.iter().enumerate().flat_map(of).collect()
    }

    /// Number of free columns.
    pub(crate) fn dof(&self) -> usize {
        self.0.iter().map(Calibration::dof).sum()
    }

    /// Range of one camera's columns.
    pub(crate) fn columns(&self, camera: usize) -> Range<usize> {
        let start = self.0[..camera].iter().map(Calibration::dof).sum();
        start..start + self.0[camera].dof()
    }

    /// Columns fixed at their values.
    pub(crate) fn frozen_columns(&self) -> Vec<usize> {
        let of_camera = |camera: usize| {
            let start = self.columns(camera).start;
            self.0[camera].frozen_columns().into_iter().map(move |column| start + column)
        };
        (0..self.cameras()).flat_map(of_camera).collect()
    }

    /// Fixes the same parameters as others.
    pub(crate) fn freeze_as(&mut self, others: &Self) {
        for (one, other) in self.0.iter_mut().zip(&others.0) {
            one.freeze_as(other);
        }
    }

    /// Applies a step of the solver, counted from the first estimates where there are any.
    pub(crate) fn stepped(&self, delta: &[f64]) -> Self {
        Self(self.0.iter().enumerate().map(|(camera, one)| one.stepped(&delta[self.columns(camera)])).collect())
    }

    /// Returns `x ⊟ x₀` (free columns), zero for a camera without a first estimate; `None` when no camera has one.
    pub(crate) fn first_estimate_offset(&self) -> Option<DVector<f64>> {
        let offsets: Vec<_> = self.0.iter().map(Calibration::first_estimate_offset).collect();
        if offsets.iter().all(Option::is_none) {
            return None;
        }
        let mut first_estimate_offset = DVector::zeros(self.dof());
        for (camera, offset) in offsets.iter().enumerate() {
            let columns = self.columns(camera);
            if let Some(offset) = offset.as_ref().filter(|offset| offset.len() == columns.len()) {
                first_estimate_offset.rows_range_mut(columns).copy_from(offset);
            }
        }
        Some(first_estimate_offset)
    }

    /// Returns the calibrations at their first estimates, or the present ones.
    pub(crate) fn at_first_estimate(&self) -> Self {
        Self(self.0.iter().map(Calibration::at_first_estimate).collect())
    }

    /// Cameras with columns in the marginalization prior keep their first estimate, or take the present one; the
    /// others have none.
    pub(crate) fn keep_first_estimates(&mut self, prior_holds: impl Fn(&Range<usize>) -> bool) {
        for camera in 0..self.cameras() {
            let columns = self.columns(camera);
            self.0[camera].keep_first_estimate(prior_holds(&columns));
        }
    }

    /// Whitened prior residuals of all cameras.
    pub(crate) fn prior_residual(&self) -> DVector<f64> {
        let offsets: Vec<DVector<f64>> = self.free().map(|(_, one)| one.prior_residual()).collect();
        DVector::from_iterator(self.dof(), offsets.iter().flat_map(DVector::iter).copied())
    }

    /// Derivative of the prior residuals with respect to a step.
    pub(crate) fn prior_jacobian(&self) -> DMatrix<f64> {
        let mut jacobian = DMatrix::zeros(self.dof(), self.dof());
        for (camera, one) in self.free() {
            let columns = self.columns(camera);
            jacobian.view_range_mut(columns.clone(), columns).copy_from(&one.prior_jacobian());
        }
        jacobian
    }

    fn free(&self) -> impl Iterator<Item = (usize, &Calibration)> {
        self.0.iter().enumerate().filter(|(_, one)| one.dof() > 0)
    }

    /// Switches the main camera's chain to another parameterization; returns the derivative of the old columns with
    /// respect to the new ones at the first estimate.
    pub(crate) fn switch_parameterization(&mut self, parameterization: Parameterization) -> DMatrix<f64> {
        let old_from_new = self.0[MAIN].switch_parameterization(parameterization);
        let (old, main) = (old_from_new.nrows(), old_from_new.ncols());
        let others = self.dof() - self.0[MAIN].dof();
        let mut all = DMatrix::identity(old + others, main + others);
        all.view_mut((0, 0), (old, main)).copy_from(&old_from_new);
        all
    }
}
