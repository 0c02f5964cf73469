//! Experiments with columns of sensors: times, shutter and intrinsics of the camera, intrinsics of the IMU.
//!
//! Unknowns, IMU factor and encoder factor are the estimator's. Only the motion is continuous: an image row is
//! exposed at its own time, the camera's pose at that time follows from the IMU, and the preintegration between frames
//! is exact (docs/mathematics.md, section 11).

mod excitation;
mod experiments;
mod propagation;
mod rows;
mod survey;
mod table;
#[cfg(test)]
mod tests;
mod window;

pub(super) use survey::survey_sensors;

pub use excitation::{ParameterSigmas, SensorExcitation, sensor_excitation};
pub use survey::{SensorSurveyEntry, SensorSurveyRow, SensorSurveySection};

use super::experiment::{LaboratoryForm, LaboratorySetup};
use crate::estimator::Linearization;
use window::SensorWindow;

/// Linearization of an experiment with its columns of sensors; `None` when a value is not finite.
pub(super) fn linearize_sensors(setup: &LaboratorySetup, form: LaboratoryForm) -> Option<Linearization> {
    let window = SensorWindow::new(setup, form, setup.columns);
    window.linearization(&window.truth)
}
