//! The rig's values of the calibration parameters that a run estimates.

use super::run::RunRecord;
use crate::estimator::{CalibrationEstimate, rigid_columns};
use crate::gimbal::{Chain, NearestForm, ParameterId, Parameterization};
use crate::sensors::Rig;

impl RunRecord {
    /// The rig's values of the run's calibration parameters in the parameterization of `estimate`, in radians, metres
    /// and seconds; angles lie in (−π, π]. Returns `None` when the rig does not have the cameras.
    ///
    /// The classical parameterization has several equivalent values; the result has those nearest to `given`, the rig
    /// of the run's prior, because the run estimates near those.
    pub fn values_in(&self, rig: &Rig, given: &Rig, estimate: &CalibrationEstimate) -> Option<Vec<(ParameterId, f64)>> {
        let main = rig.chain_of_camera(&self.camera_key)?;
        let conversion = self.conversion_for(given, estimate, estimate.parameterization)?;
        let chain = conversion.of(&Chain::from_classical(&main, Parameterization::Classical));
        let mut values: Vec<_> = chain.parameters().into_iter().zip(chain.values().iter().copied()).collect();
        let mut clocks = vec![(ParameterId::timeshift(0), self.camera_key.as_str())];
        for (camera, (key, _)) in (1..).zip(&estimate.rigid_cameras) {
            values.extend(rigid_columns(camera, &rig.chain_of_camera(key)?.imu_from_camera(&[])));
            clocks.push((ParameterId::timeshift(camera), key));
        }
        for (clock, key) in clocks.into_iter().filter(|(clock, _)| estimate.parameters.contains(clock)) {
            values.push((clock, rig.camera(key).ok()?.timeshift_cam_imu_s));
        }
        for (parameter, value) in &mut values {
            *value = parameter.principal_value(*value);
        }
        Some(values)
    }

    /// The conversion of mechanisms to a parameterization. Of several equivalent values it returns those nearest to the
    /// rig's, weighted by the estimate's prior standard deviations if these are in that parameterization. Returns
    /// `None` when the rig does not have the camera.
    pub fn conversion_for(
        &self,
        given: &Rig,
        estimate: &CalibrationEstimate,
        parameterization: Parameterization,
    ) -> Option<NearestForm> {
        let near = Chain::from_classical(&given.chain_of_camera(&self.camera_key)?, parameterization);
        let parameters = near.parameters();
        let scales = if estimate.parameters.starts_with(&parameters) {
            estimate.prior_sigmas[..parameters.len()].to_vec()
        } else {
            parameters.iter().map(|parameter| parameter.scale()).collect()
        };
        Some(NearestForm::new(near, &scales.into()))
    }
}
