//! Changes to an estimator between two images.

use nalgebra::DVector;
use thiserror::Error;

use super::estimator::{Estimator, PhaseState};
use super::state::calibrations::MAIN;
use crate::frontend::FeatureId;
use crate::gimbal::{ParameterId, Parameterization};

/// Reason to refuse a change.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum InterventionError {
    #[error("there is no parameter {0:?} in this parameterization")]
    UnknownParameter(ParameterId),
    #[error("the calibration of this run is fixed (calibrate=off)")]
    FixedCalibration,
}

/// Calibration columns in addition to the chain that are enabled together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum SensorParameters {
    Timeshift,
    /// Readout times of rolling shutters.
    Readout,
    Intrinsics,
    ImuIntrinsics,
    /// Orientation and time offset of the IMU on the gimbal.
    GimbalImu,
}

impl SensorParameters {
    pub const ALL: [Self; 5] = [Self::Timeshift, Self::Readout, Self::Intrinsics, Self::ImuIntrinsics, Self::GimbalImu];

    /// Key in the specification of a run.
    pub const fn key(self) -> &'static str {
        match self {
            Self::Timeshift => "timeshift",
            Self::Readout => "readout",
            Self::Intrinsics => "intrinsics",
            Self::ImuIntrinsics => "imu-intrinsics",
            Self::GimbalImu => "gimbal-imu-axes",
        }
    }
}

impl Estimator {
    /// Switches the parameterization of the chain. The calibration stays; its prior stays as far as the new
    /// columns can represent it.
    pub fn use_parameterization(&mut self, parameterization: Parameterization, auto_parameterize: bool) {
        self.setup.config.auto_parameterize = auto_parameterize;
        self.setup.config.parameterization = parameterization;
        if self.calibration().of(MAIN).chain().parameterization() == parameterization {
            return;
        }
        match &mut self.phase {
            PhaseState::Tracking(window) if window.state.calibration.dof() > 0 => {
                window.state.switch_parameterization(parameterization);
            }
            PhaseState::Initializing(_) | PhaseState::Tracking(_) => {
                self.calibration_mut().switch_parameterization(parameterization);
            }
        }
    }

    /// Parameters of the calibration, estimated or not, in column order.
    pub fn parameters(&self) -> Vec<ParameterId> {
        self.calibration().parameters()
    }

    /// Estimates further sensor parameters from the next solve on, starting at the rig's values; the frames of the
    /// window and the marginalization prior stay.
    pub fn estimate_sensors(&mut self, columns: SensorParameters) -> Result<(), InterventionError> {
        let config = &mut self.setup.config;
        if !config.calibrate {
            return Err(InterventionError::FixedCalibration);
        }
        match columns {
            SensorParameters::Timeshift => config.estimate_timeshift = true,
            SensorParameters::Readout => config.estimate_readout = true,
            SensorParameters::Intrinsics => config.estimate_intrinsics = true,
            SensorParameters::ImuIntrinsics => config.estimate_imu_intrinsics = true,
            SensorParameters::GimbalImu => config.estimate_gimbal_imu = true,
        }
        match &mut self.phase {
            PhaseState::Tracking(window) => window.state.add_columns(&self.setup),
            PhaseState::Initializing(initializer) => {
                initializer.calibration = initializer.calibration.with_columns_of(&self.setup.given_calibration());
            }
        }
        Ok(())
    }

    /// Fixes a parameter at its current value from the next solve on.
    pub fn freeze(&mut self, parameter: ParameterId) -> Result<(), InterventionError> {
        let column = self.free_column(parameter)?;
        self.calibration_mut().freeze(column);
        Ok(())
    }

    /// Sets a parameter to another value. Window and priors stay and pull it back.
    pub fn set_value(&mut self, parameter: ParameterId, value: f64) -> Result<(), InterventionError> {
        let column = self.free_column(parameter)?;
        let calibration = self.calibration_mut();
        let mut step = DVector::zeros(calibration.dof());
        step[column] = value - calibration.values()[column];
        *calibration = calibration.stepped(step.as_slice());
        Ok(())
    }

    /// Scales the IMU noise densities of all following intervals.
    pub fn scale_imu_noise(&mut self, factor: f64) {
        self.setup.scale_imu_noise(factor);
    }

    /// Scales the pixel standard deviation from the next solve on.
    pub fn scale_pixel_noise(&mut self, factor: f64) {
        self.setup.config.options.pixel_sigma_px *= factor;
    }

    /// Scales the prior standard deviations of the main camera's chain from the next initialization on.
    pub fn scale_chain_prior(&mut self, factor: f64) {
        let config = &mut self.setup.config;
        let (translation_m, rotation_rad) = config.extrinsics_sigmas(MAIN);
        if factor == 1.0 {
            return;
        }
        config.chain_prior = Some((factor * translation_m, factor * rotation_rad));
        if let PhaseState::Initializing(initializer) = &mut self.phase {
            let mut calibration = self.setup.given_calibration();
            calibration.freeze_as(&initializer.calibration);
            initializer.calibration = calibration;
        }
    }

    /// Drops features of a camera; their information stays in the marginalization prior.
    pub fn drop_features(&mut self, camera: usize, dropped: impl Fn(FeatureId) -> bool) {
        match &mut self.phase {
            PhaseState::Initializing(initializer) => initializer.drop_features(camera, &dropped),
            PhaseState::Tracking(window) => {
                if let Some(features) = window.state.features.get_mut(camera) {
                    features.retain(|id, _| !dropped(*id));
                }
            }
        }
    }

    fn free_column(&self, parameter: ParameterId) -> Result<usize, InterventionError> {
        let known = self.calibration().parameters();
        let column = known.iter().position(|known| *known == parameter);
        let column = column.ok_or(InterventionError::UnknownParameter(parameter))?;
        if self.calibration().dof() == 0 {
            return Err(InterventionError::FixedCalibration);
        }
        Ok(column)
    }
}
