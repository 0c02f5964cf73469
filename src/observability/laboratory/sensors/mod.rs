//! Experiments with columns of sensors: times, shutter and intrinsics of the camera, intrinsics of the IMU.
//!
//! The laboratory linearizes these windows itself, from the continuous motion: an image row is exposed at its own time,
//! the camera's pose at that time follows from the IMU, and the preintegration between frames carries its derivatives
//! with respect to the intrinsics (docs/mathematics.md, section 11).

mod columns;
mod excitation;
mod experiments;
mod propagation;
mod rows;
mod state;
mod survey;
mod table;
#[cfg(test)]
mod tests;
mod values;
mod window;

pub(super) use survey::survey_sensors;

pub use columns::{SensorColumns, UnknownColumns};
pub use excitation::{ParameterSigmas, SensorExcitation, sensor_excitation};
pub use survey::{SensorSurveyEntry, SensorSurveyRow, SensorSurveySection};

use super::experiment::{LaboratoryForm, LaboratorySetup};
use crate::estimator::Linearization;
use window::SensorWindow;

/// Linearization of an experiment with its columns of sensors; `None` when a value is not finite.
pub(super) fn linearize_sensors(setup: &LaboratorySetup, form: LaboratoryForm) -> Option<Linearization> {
    let mut window = SensorWindow::new(setup, form);
    window.columns.sensors.retain(|(_, parameter)| setup.columns.has(*parameter));
    window.linearization(&window.truth)
}
