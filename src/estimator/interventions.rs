//! Changes to an estimator between two images, for trying another way from the same instant.

use nalgebra::DVector;
use thiserror::Error;

use super::estimator::Estimator;
use crate::estimator::state::calibrations::MAIN;
use crate::estimator::window::features::FeatureMap;
use crate::frontend::FeatureId;
use crate::gimbal::{ParameterId, Parameterization};

/// Why an estimator cannot be changed as asked.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum InterventionError {
    /// No such parameter.
    #[error("there is no parameter {0:?} in this parameterization")]
    UnknownParameter(ParameterId),
    /// The calibration is not estimated.
    #[error("the calibration of this run is fixed (calibrate=off)")]
    FixedCalibration,
}

impl Estimator {
    /// Goes over to another parameterization of the chain: the calibration stays what it is, and so does everything that
    /// is known about it, as far as the new columns can say it.
    pub fn use_parameterization(&mut self, parameterization: Parameterization, auto_chart: bool) {
        self.config.auto_chart = auto_chart;
        self.config.parameterization = parameterization;
        if self.calibration.of(MAIN).chain().parameterization() == parameterization {
            return;
        }
        if self.calibration.dof() == 0 {
            self.calibration.switch_chart(parameterization);
        } else {
            self.switch_chart(parameterization);
        }
    }

    /// The parameters of the calibration, estimated or not, in the order of their columns.
    pub fn parameters(&self) -> Vec<ParameterId> {
        self.calibration.parameters()
    }

    /// Holds a parameter at its present value from the next solve on.
    pub fn freeze(&mut self, parameter: ParameterId) -> Result<(), InterventionError> {
        let (camera, index) = self.free_column(parameter)?;
        self.calibration.of_mut(camera).freeze(index);
        Ok(())
    }

    /// Sets a parameter to another value; what the window and its priors know stays, and pulls it back.
    pub fn set_value(&mut self, parameter: ParameterId, value: f64) -> Result<(), InterventionError> {
        let (camera, index) = self.free_column(parameter)?;
        let mut step = DVector::zeros(self.calibration.dof());
        let before = self.calibration.of(camera).values()[index];
        step[self.calibration.columns(camera).start + index] = value - before;
        self.calibration = self.calibration.stepped(step.as_slice());
        Ok(())
    }

    /// Multiplies the inertial noise densities of all intervals to come.
    pub fn scale_imu_noise(&mut self, factor: f64) {
        for noise in [&mut self.noise, &mut self.config.imu_noise] {
            noise.accelerometer_noise_density *= factor;
            noise.accelerometer_random_walk *= factor;
            noise.gyroscope_noise_density *= factor;
            noise.gyroscope_random_walk *= factor;
        }
    }

    /// Multiplies the standard deviation of a tracked pixel from the next solve on.
    pub fn scale_pixel_noise(&mut self, factor: f64) {
        self.config.options.pixel_sigma_px *= factor;
    }

    /// Forgets features of a camera; what went into the marginalization prior because of them stays.
    pub fn forget_features(&mut self, camera: usize, gone: impl Fn(FeatureId) -> bool) {
        if let Some(features) = self.features.get_mut(camera) {
            FeatureMap::retain(features, |id, _| !gone(*id));
        }
        for waiting in &mut self.waiting {
            waiting.forget_features(camera, &gone);
        }
    }

    /// The camera and the number within it of a parameter that is estimated.
    fn free_column(&self, parameter: ParameterId) -> Result<(usize, usize), InterventionError> {
        let known = self.calibration.parameters();
        let Some(mut index) = known.iter().position(|known| *known == parameter) else {
            return Err(InterventionError::UnknownParameter(parameter));
        };
        if self.calibration.dof() == 0 {
            return Err(InterventionError::FixedCalibration);
        }
        for camera in 0..self.calibration.cameras() {
            let columns = self.calibration.of(camera).parameters().len();
            if index < columns {
                return Ok((camera, index));
            }
            index -= columns;
        }
        Err(InterventionError::UnknownParameter(parameter))
    }
}
