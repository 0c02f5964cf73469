//! Observability of single parameters in a window, from the null and uninformed directions of its step, and the motions
//! that determine the parameters of sensors.

use std::collections::BTreeMap;

use super::RankReport;
use crate::gimbal::{ParameterId, ParameterPart, Quantity};

/// A parameter counts as lost if at least this ratio of its squared unit vector lies in the span of the directions.
const MIN_LOST_RATIO: f64 = 0.25;

/// Observability of a parameter in a window.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ParameterState {
    /// The window constrains it more than a prior of 10° or 3 cm.
    Informed,
    Fixed,
    /// It lies in null and uninformed directions: the window constrains it less than a prior of 10° or 3 cm.
    Uninformed,
    /// Unobservable: it lies in a structural null direction.
    Unobservable,
}

/// Observability of each parameter, `None` during initialization.
pub fn parameter_states(rank: Option<&RankReport>) -> Option<BTreeMap<ParameterId, ParameterState>> {
    let rank = rank?;
    let lost_ratio = |column: usize, structural_only: bool| -> f64 {
        let directions = rank.directions.iter().filter(|direction| direction.structural || !structural_only);
        directions.filter_map(|direction| direction.weights.get(column)).map(|weight| weight * weight).sum()
    };
    let verdict = |column: usize| {
        if lost_ratio(column, true) >= MIN_LOST_RATIO {
            ParameterState::Unobservable
        } else if lost_ratio(column, false) >= MIN_LOST_RATIO {
            ParameterState::Uninformed
        } else {
            ParameterState::Informed
        }
    };
    let fixed = rank.fixed_parameters.iter().map(|parameter| (*parameter, ParameterState::Fixed));
    let columns = rank.parameters.iter().enumerate().map(|(column, parameter)| (*parameter, verdict(column)));
    Some(columns.chain(fixed).collect())
}

impl RankReport {
    /// Least observable parameter with the motion that determines it; `None` if it does not belong to a sensor.
    pub fn sensor_excitation(&self) -> Option<(ParameterId, &'static str)> {
        let parameter = self.least_observable()?;
        Some((parameter, exciting_motion(parameter)?))
    }
}

/// Motion that determines a sensor parameter, as text; `None` for the chain, whose excitation depends on its state
/// ([`super::laboratory::advise`]).
///
/// The text names axes of the image and of the IMU, not of the vehicle, so that it is valid for any extrinsics. The
/// test of the laboratory's table of motions checks it against predicted standard deviations.
pub fn exciting_motion(parameter: ParameterId) -> Option<&'static str> {
    let words = match (parameter.part, parameter.quantity) {
        (ParameterPart::GimbalImu, _) => "rotate the camera about all its axes, back and forth",
        (ParameterPart::Encoder, Quantity::Timeshift) => "move the joints back and forth",
        (_, Quantity::Timeshift | Quantity::Readout) => "rotate the camera back and forth",
        (_, Quantity::Fx) => "rotate the camera about its vertical image axis",
        (_, Quantity::Fy) => "rotate the camera about its horizontal image axis",
        (_, Quantity::Cx | Quantity::Cy) => "rotate the camera about both image axes",
        (_, Quantity::K1 | Quantity::K2) => "rotate the camera so that features cross the whole image",
        (ParameterPart::Gyroscope, Quantity::Sx) => "rotate about the x axis of the IMU",
        (ParameterPart::Gyroscope, Quantity::Sy) => "rotate about the y axis of the IMU",
        (ParameterPart::Gyroscope, Quantity::Sz) => "rotate about the z axis of the IMU",
        (ParameterPart::Gyroscope, _) => "rotate about all axes of the IMU",
        (ParameterPart::Accelerometer, _) => "roll and pitch far, so that gravity moves over the axes of the IMU",
        _ => return None,
    };
    Some(words)
}
