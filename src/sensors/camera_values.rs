//! Rig values of the calibration parameters of a camera's clock, shutter and intrinsics.

use super::CameraRig;
use crate::gimbal::Quantity;

impl CameraRig {
    /// Rig value of time offset, readout time or an intrinsic, in the unit of its dimension; `None` for another
    /// quantity.
    pub fn value(&self, quantity: Quantity) -> Option<f64> {
        match quantity {
            Quantity::Timeshift => Some(self.timeshift_cam_imu_s),
            Quantity::Readout => Some(self.readout_s),
            _ => {
                let place = Quantity::INTRINSICS.into_iter().position(|known| known == quantity)?;
                Some(self.model.intrinsics()[place])
            }
        }
    }

    /// Sets calibrated values of [`CameraRig::value`]; intrinsics outside of their range leave the camera model
    /// unchanged.
    pub fn set_values(&mut self, values: &[(Quantity, f64)]) {
        let mut intrinsics = self.model.intrinsics();
        for (quantity, value) in values {
            match quantity {
                Quantity::Timeshift => self.timeshift_cam_imu_s = *value,
                Quantity::Readout => self.readout_s = *value,
                _ => {
                    let mut known = Quantity::INTRINSICS.iter().zip(&mut intrinsics);
                    if let Some((_, intrinsic)) = known.find(|(known, _)| *known == quantity) {
                        *intrinsic = *value;
                    }
                }
            }
        }
        if intrinsics != self.model.intrinsics()
            && let Ok(model) = self.model.with_intrinsics(intrinsics)
        {
            self.model = model;
        }
    }
}
