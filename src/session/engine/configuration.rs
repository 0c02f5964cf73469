//! The estimator's configuration from a rig and a run specification.

use super::stopwatch::clock_ms;
use crate::estimator::{EstimatorConfig, EstimatorOptions, FurtherCamera};
use crate::flight_log::LogError;
use crate::gimbal::{Parameterization, auto_parameterization};
use crate::sensors::{CameraRig, Rig};
use crate::session::plan::{ParameterizationChoice, RunSpec, SessionError, cameras_of_run};

pub(in crate::session) fn estimator_config(rig: &Rig, spec: &RunSpec) -> Result<EstimatorConfig, SessionError> {
    let cameras = cameras_of_run(rig, spec)?;
    let camera = cameras.main;
    let chain = rig.chain_of_camera(&camera.key).unwrap_or_default();
    let parameterization = match spec.parameterization {
        ParameterizationChoice::Auto | ParameterizationChoice::Cluster => auto_parameterization(&chain),
        ParameterizationChoice::Minimal | ParameterizationChoice::Static => Parameterization::Minimal,
        ParameterizationChoice::MinimalSwapped => Parameterization::MinimalSwapped,
        ParameterizationChoice::Classical => Parameterization::Classical,
        ParameterizationChoice::Poe => Parameterization::Poe,
    };
    let configuration = EstimatorConfig::for_camera(rig, &camera.key, parameterization).map_err(LogError::from)?;
    let cameras: Vec<&CameraRig> = cameras.iter().collect();
    let further = (1..cameras.len()).map(|index| FurtherCamera::of_rig(rig, &cameras[..index], cameras[index]));
    let further_cameras = further.flatten().collect();
    let standard = EstimatorOptions::default();
    let options = EstimatorOptions {
        window: spec.window,
        keep_linearization: true,
        calibration_first_estimates: spec.first_estimates,
        first_estimate_reach_rad: if spec.first_estimates { standard.first_estimate_reach_rad } else { 0.0 },
        ..standard
    };
    let mut config = EstimatorConfig {
        auto_parameterize: !chain.links.is_empty() && spec.parameterization.switches_parameterization(rig),
        use_encoder: spec.encoder && configuration.use_encoder,
        calibrate: spec.calibrate,
        estimate_timeshift: spec.timeshift,
        estimate_readout: spec.readout,
        estimate_intrinsics: spec.intrinsics,
        estimate_imu_intrinsics: spec.imu_intrinsics,
        gimbal_imu: configuration.gimbal_imu.clone().filter(|_| spec.gimbal_imu),
        estimate_gimbal_imu: spec.gimbal_imu_axes,
        further_cameras,
        options,
        clock_ms,
        ..configuration
    };
    spec.tuning.apply(&mut config);
    Ok(config)
}
