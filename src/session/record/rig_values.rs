//! The rig's values of the calibration parameters that a run estimates, and a rig with the estimated values.

use nalgebra::Vector3;

use super::run::RunRecord;
use crate::estimator::{CalibrationEstimate, imu_columns, imu_intrinsics, pose_columns};
use crate::geometry::{RigidTransform, so3};
use crate::gimbal::{Chain, ClassicalChain, NearestForm, ParameterId, ParameterPart, Parameterization, Quantity};
use crate::sensors::{CameraMount, Rig};

impl RunRecord {
    /// The rig's values of the run's calibration parameters in the parameterization of `estimate`, each in the unit of
    /// its dimension; angles lie in (−π, π]. Returns `None` if the rig does not have the cameras.
    ///
    /// The classical parameterization has several equivalent values; the result is nearest to `given`, the rig of the
    /// run's prior, because the run estimates near its values.
    pub fn values_in(&self, rig: &Rig, given: &Rig, estimate: &CalibrationEstimate) -> Option<Vec<(ParameterId, f64)>> {
        let main = rig.chain_of_camera(&self.camera_key)?;
        let conversion = self.conversion_for(given, estimate, estimate.parameterization)?;
        let mut values = conversion.values_of(&Chain::from_classical(&main, Parameterization::Classical));
        for camera in &estimate.further_cameras {
            let base_from_camera = match camera.base.as_deref() {
                None => rig.chain_of_camera(&camera.key)?.imu_from_camera(&[]),
                base => rig.base_from_camera(base, &camera.key)?,
            };
            values.extend(pose_columns(camera.number, &base_from_camera));
        }
        for parameter in &estimate.parameters {
            let ParameterPart::Camera(number) = parameter.part else { continue };
            let rigid = estimate.further_cameras.iter().find(|camera| camera.number == number);
            let camera = rig.camera(rigid.map_or(&self.camera_key, |rigid| &rigid.key)).ok()?;
            values.extend(camera.value(parameter.quantity).map(|value| (*parameter, value)));
        }
        if has_imu_columns(estimate) {
            values.extend(imu_columns(&rig.imu.intrinsics));
        }
        values.extend(gimbal_imu_columns(rig, given, &estimate.parameters));
        for (parameter, value) in &mut values {
            *value = parameter.principal_value(*value);
        }
        Some(values)
    }

    /// Value of a parameter at the start of the run, angles in (−π, π]; `None` if it is not estimated there.
    pub fn start_value(&self, parameter: ParameterId) -> Option<f64> {
        let start = self.steps.first()?.report.calibration.value_of(parameter)?;
        Some(parameter.principal_value(start))
    }

    /// Value of a parameter as tables, plots and files show it: an angle is the one nearest to that at the start.
    pub fn shown_value(&self, parameter: ParameterId, value: f64) -> f64 {
        self.start_value(parameter)
            .map_or_else(|| parameter.principal_value(value), |start| parameter.value_near(start, value))
    }

    /// The rig of the run's prior with the final calibration of the run.
    pub fn calibrated_rig(&self, given: &Rig) -> Rig {
        let mut rig = given.clone();
        let Some(last) = self.steps.last() else { return rig };
        let calibration = &last.report.calibration;
        self.set_main_chain(&mut rig, &calibration.classical);
        for camera in &calibration.further_cameras {
            rig.set_base_from_camera(camera.base.as_deref(), &camera.key, camera.base_from_camera);
        }
        let values = calibration.values.iter().copied();
        let columns: Vec<(ParameterId, f64)> = calibration.parameters.iter().copied().zip(values).collect();
        let rigid = calibration.further_cameras.iter().map(|camera| (camera.number, camera.key.as_str()));
        for (number, key) in std::iter::once((0, self.camera_key.as_str())).chain(rigid) {
            let of_camera = columns.iter().filter(|(parameter, _)| parameter.part == ParameterPart::Camera(number));
            let values: Vec<_> = of_camera.map(|(parameter, value)| (parameter.quantity, *value)).collect();
            if let Some(camera) = rig.cameras.iter_mut().find(|camera| camera.key == key) {
                camera.set_values(&values);
            }
        }
        if has_imu_columns(calibration) {
            let intrinsics = imu_intrinsics(&columns);
            rig.imu.intrinsics = intrinsics.in_frame_of(&given.imu.intrinsics).unwrap_or(intrinsics);
        }
        set_gimbal_imu(&mut rig, &columns);
        rig
    }

    /// Sets the chain of the main camera; the poses of other cameras relative to it do not change.
    fn set_main_chain(&self, rig: &mut Rig, chain: &ClassicalChain) {
        let paired: Vec<(String, RigidTransform)> = rig
            .cameras
            .iter()
            .filter(|camera| rig.base_of(camera).is_some_and(|base| base.key == self.camera_key))
            .filter_map(|camera| Some((camera.key.clone(), rig.base_from_camera(Some(&self.camera_key), &camera.key)?)))
            .collect();
        let Some(camera) = rig.cameras.iter_mut().find(|camera| camera.key == self.camera_key) else { return };
        match &mut camera.mount {
            CameraMount::Gimbal => {
                let mut chain = chain.clone();
                // The chain of the rig ends at its first camera.
                if camera.relative_prior.is_some() {
                    chain.effector_from_camera = chain.effector_from_camera * camera.first_from_camera.inverse();
                }
                if let Some(gimbal) = &mut rig.gimbal {
                    gimbal.set_chain(chain);
                }
            }
            CameraMount::Static { imu_from_camera } => *imu_from_camera = chain.imu_from_camera(&[]),
        }
        for (key, base_from_camera) in paired {
            rig.set_base_from_camera(Some(&self.camera_key), &key, base_from_camera);
        }
    }

    /// Keys of the cameras in the order of their features, the main camera first.
    pub fn camera_keys<'a>(&'a self, estimate: &'a CalibrationEstimate) -> Vec<&'a str> {
        let rigid = estimate.further_cameras.iter().map(|camera| camera.key.as_str());
        std::iter::once(self.camera_key.as_str()).chain(rigid).collect()
    }

    /// Conversion of mechanisms to a parameterization. Of several equivalent values it returns those nearest to the
    /// rig's, weighted by the estimate's prior standard deviations if these are in that parameterization. Returns
    /// `None` if the rig does not have the camera.
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

fn has_imu_columns(estimate: &CalibrationEstimate) -> bool {
    let is_intrinsic = |part| matches!(part, ParameterPart::Gyroscope | ParameterPart::Accelerometer);
    estimate.parameters.iter().any(|parameter| is_intrinsic(parameter.part))
}

/// A rig's values of the `parameters` that belong to the IMU on the gimbal: pose relative to `given`, time offset.
fn gimbal_imu_columns(rig: &Rig, given: &Rig, parameters: &[ParameterId]) -> Vec<(ParameterId, f64)> {
    let (Some(imu), Some(given)) = (&rig.gimbal_imu, &given.gimbal_imu) else { return Vec::new() };
    let rotation = so3::log(&(given.camera_from_imu.rotation.inverse() * imu.camera_from_imu.rotation));
    let offset_m = imu.camera_from_imu.translation_m - given.camera_from_imu.translation_m;
    let pose = [rotation.as_slice(), offset_m.as_slice()].concat();
    let value = |quantity: Quantity| match quantity {
        Quantity::Timeshift => Some(imu.timeshift_s),
        _ => Quantity::TRANSFORM.iter().position(|known| *known == quantity).map(|place| pose[place]),
    };
    let own = parameters.iter().filter(|parameter| parameter.part == ParameterPart::GimbalImu);
    own.filter_map(|parameter| Some((*parameter, value(parameter.quantity)?))).collect()
}

/// Sets pose and time offset of the IMU on the gimbal to estimated values.
fn set_gimbal_imu(rig: &mut Rig, columns: &[(ParameterId, f64)]) {
    let value = |quantity: Quantity| {
        let wanted = ParameterId { part: ParameterPart::GimbalImu, quantity };
        columns.iter().find(|(parameter, _)| *parameter == wanted).map(|(_, value)| *value)
    };
    let Some(imu) = &mut rig.gimbal_imu else { return };
    if let [Some(rx), Some(ry), Some(rz), Some(tx), Some(ty), Some(tz)] = Quantity::TRANSFORM.map(value) {
        imu.camera_from_imu.rotation *= so3::exp(&Vector3::new(rx, ry, rz));
        imu.camera_from_imu.translation_m += Vector3::new(tx, ty, tz);
    }
    imu.timeshift_s = value(Quantity::Timeshift).unwrap_or(imu.timeshift_s);
}
