//! From a rig and a run specification to an estimator's configuration.

use super::stopwatch::clock_ms;
use crate::estimator::{EstimatorConfig, EstimatorOptions, RigidCamera};
use crate::gimbal::{Parameterization, auto_parameterization};
use crate::sensors::{CameraMount, CameraRig, ChainPrior, Rig};
use crate::session::plan::{ParameterizationChoice, RunSpec, SessionError, WatchedCameras, cameras_of_run};

/// How wrong a rigid camera's pose on the IMU may be when the rig has no prior: a target calibration is better than this.
const RIGID_CAMERA_PRIOR: ChainPrior = ChainPrior { translation_bound_m: 0.01, rotation_bound_rad: 0.0175 };

/// Standard deviation of a uniform error within ±1.
const SIGMA_PER_BOUND: f64 = 0.577_350_269_189_625_8;

/// How wrong the rig may be about how a camera is carried.
pub(in crate::session) fn mount_prior(rig: &Rig, camera: &CameraRig) -> ChainPrior {
    match (&rig.gimbal, &camera.mount) {
        (Some(gimbal), CameraMount::Gimbal) => gimbal.prior,
        // The rigid camera of a gimbal rig was calibrated with the same care as its gimbal, but never better than a
        // rigid camera usually is.
        (Some(gimbal), CameraMount::Static { .. }) => ChainPrior {
            translation_bound_m: gimbal.prior.translation_bound_m.min(RIGID_CAMERA_PRIOR.translation_bound_m),
            rotation_bound_rad: gimbal.prior.rotation_bound_rad.min(RIGID_CAMERA_PRIOR.rotation_bound_rad),
        },
        (None, _) => RIGID_CAMERA_PRIOR,
    }
}

/// The estimator that a run asks for.
pub(in crate::session) fn estimator_config(rig: &Rig, spec: &RunSpec) -> Result<EstimatorConfig, SessionError> {
    let WatchedCameras { main: camera, rigid } = cameras_of_run(rig, spec)?;
    let chain = rig.chain_of_camera(&camera.key).unwrap_or_default();
    let gimbal = rig.gimbal.as_ref().filter(|_| camera.mount == CameraMount::Gimbal);
    let prior = mount_prior(rig, camera);
    let parameterization = match spec.parameterization {
        ParameterizationChoice::Auto | ParameterizationChoice::Cluster => auto_parameterization(&chain),
        ParameterizationChoice::Minimal | ParameterizationChoice::Static => Parameterization::Minimal,
        ParameterizationChoice::MinimalSwapped => Parameterization::MinimalSwapped,
        ParameterizationChoice::Classical => Parameterization::Classical,
        ParameterizationChoice::Poe => Parameterization::Poe,
    };
    // Without a topic there is no reading, whatever its noise would be.
    let encoders = gimbal.filter(|gimbal| gimbal.topic.is_some());
    let encoder_sigma_rad = encoders.and_then(|gimbal| gimbal.encoder_sigma_rad);
    let has_joints = !chain.links.is_empty();
    let standard = EstimatorOptions::default();
    let options = EstimatorOptions {
        window: spec.window,
        keep_linearization: true,
        calibration_first_estimates: spec.first_estimates,
        first_estimate_reach_rad: if spec.first_estimates { standard.first_estimate_reach_rad } else { 0.0 },
        ..standard
    };
    Ok(EstimatorConfig {
        camera: camera.model.clone(),
        imu_noise: rig.imu.noise,
        gravity_m_per_s2: rig.gravity_m_per_s2,
        chain,
        parameterization,
        auto_chart: has_joints && spec.parameterization.switches_chart(rig),
        encoder_sigma_rad,
        use_encoder: spec.encoder && encoder_sigma_rad.is_some(),
        calibrate: spec.calibrate,
        estimate_timeshift: spec.timeshift,
        timeshift_s: camera.timeshift_cam_imu_s,
        chain_prior: Some(sigmas(prior)),
        rigid_cameras: rigid.into_iter().filter_map(|camera| rigid_camera(rig, camera)).collect(),
        options,
        clock_ms,
    })
}

fn rigid_camera(rig: &Rig, camera: &CameraRig) -> Option<RigidCamera> {
    let CameraMount::Static { imu_from_camera } = &camera.mount else { return None };
    Some(RigidCamera {
        key: camera.key.clone(),
        model: camera.model.clone(),
        imu_from_camera: *imu_from_camera,
        prior: sigmas(mount_prior(rig, camera)),
        timeshift_s: camera.timeshift_cam_imu_s,
    })
}

/// Standard deviations in metres and radians of errors that are uniform within the bounds.
fn sigmas(prior: ChainPrior) -> (f64, f64) {
    (prior.translation_bound_m * SIGMA_PER_BOUND, prior.rotation_bound_rad * SIGMA_PER_BOUND)
}
