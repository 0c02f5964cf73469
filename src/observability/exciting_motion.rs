//! Motions that make the calibration of sensors observable.

use super::RankReport;
use crate::gimbal::{ParameterId, ParameterPart, Quantity};

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
