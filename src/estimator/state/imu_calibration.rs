//! Estimated intrinsics of the IMU with their prior.

use super::imu_errors::{self, IMU_ERRORS, ImuErrors};
use crate::gimbal::ParameterId;
use crate::sensors::ImuIntrinsics;

/// Prior standard deviation of scale errors and misalignments, dimensionless: consumer IMUs are within 1 to 3 %, their
/// axes within a degree.
const SCALE_SIGMA: f64 = 0.01;
/// Prior standard deviation of each component of the rotation between gyroscope and accelerometer, in radians.
const ROTATION_SIGMA_RAD: f64 = 0.01;

/// Intrinsics of the IMU, relative to the intrinsics of the rig, by which the samples are already corrected.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ImuCalibration {
    given: ImuIntrinsics,
    values: ImuErrors,
    first_estimate: Option<ImuErrors>,
    /// Parameters fixed at their values.
    frozen: Vec<ParameterId>,
}

impl ImuCalibration {
    pub(crate) fn new(given: ImuIntrinsics) -> Self {
        Self { given, values: ImuErrors::zeros(), first_estimate: None, frozen: Vec::new() }
    }

    pub(crate) const DOF: usize = IMU_ERRORS;

    /// Correction of the samples relative to the rig's.
    pub(crate) fn errors(&self) -> &ImuErrors {
        &self.values
    }

    /// Values of the total correction, including the rig's correction.
    pub(crate) fn values(&self) -> ImuErrors {
        imu_errors::of_intrinsics(&imu_errors::intrinsics(&self.values).after(&self.given))
    }

    /// Prior standard deviations of the columns.
    pub(crate) fn sigmas() -> ImuErrors {
        let mut sigmas = ImuErrors::repeat(SCALE_SIGMA);
        sigmas.fixed_rows_mut::<3>(6).fill(ROTATION_SIGMA_RAD);
        sigmas
    }

    /// Fixes a parameter at its current value.
    pub(crate) fn freeze(&mut self, column: usize) {
        let parameter = imu_errors::parameters()[column];
        if !self.frozen.contains(&parameter) {
            self.frozen.push(parameter);
        }
    }

    /// Fixes the same parameters as another calibration.
    pub(crate) fn freeze_as(&mut self, other: &Self) {
        self.frozen.clone_from(&other.frozen);
    }

    /// Columns that are fixed at their values.
    pub(crate) fn frozen_columns(&self) -> Vec<usize> {
        let parameters = imu_errors::parameters().into_iter().enumerate();
        parameters.filter(|(_, parameter)| self.frozen.contains(parameter)).map(|(column, _)| column).collect()
    }

    /// Applies a step of the solver. The values are a vector space, so a first estimate does not change the step.
    pub(crate) fn stepped(&self, delta: &[f64]) -> Self {
        Self { values: self.values + ImuErrors::from_column_slice(delta), ..self.clone() }
    }

    /// `x − x₀` (15 × 1) from the first estimate `x₀`, `None` without one.
    pub(crate) fn first_estimate_offset(&self) -> Option<ImuErrors> {
        self.first_estimate.map(|first| self.values - first)
    }

    /// This calibration at the first estimate, or at the current one without it.
    pub(crate) fn at_first_estimate(&self) -> Self {
        Self { values: self.first_estimate.unwrap_or(self.values), ..self.clone() }
    }

    /// Keeps the first estimate, or sets it to the current values, while the prior has the IMU's columns; otherwise
    /// removes it.
    pub(crate) fn keep_first_estimate(&mut self, in_prior: bool) {
        self.first_estimate = in_prior.then(|| self.first_estimate.unwrap_or(self.values));
    }

    /// Whitened prior residual (15 × 1).
    pub(crate) fn prior_residual(&self) -> ImuErrors {
        self.values.component_div(&Self::sigmas())
    }
}
