//! Motions that make the calibration of sensors observable.

use super::RankReport;
use crate::gimbal::{ParameterId, ParameterPart, Quantity};

impl RankReport {
    /// The least observable parameter with the motion that determines it, where it belongs to a sensor.
    pub fn sensor_excitation(&self) -> Option<(ParameterId, &'static str)> {
        let parameter = self.least_observable()?;
        Some((parameter, exciting_motion(parameter)?))
    }
}

/// The motion that determines a parameter of a sensor, in words; `None` for the chain, whose excitation depends on its state
/// ([`super::laboratory::advise`]).
///
/// Axes of the image and of the IMU are named instead of those of the vehicle, so that it holds for every mount. The test of the
/// laboratory's table of motions holds the words against predicted standard deviations.
pub fn exciting_motion(parameter: ParameterId) -> Option<&'static str> {
    let words = match (parameter.part, parameter.quantity) {
        (ParameterPart::Encoder, Quantity::Timeshift) => "move the joints to and fro",
        (_, Quantity::Timeshift | Quantity::Readout) => "rotate the camera to and fro",
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
