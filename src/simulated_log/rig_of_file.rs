//! Rig of a file as the true rig of a simulated flight.

use nalgebra::Vector2;

use super::error::SimulationError;
use super::options::SimulationOptions;
use super::planting::Planting;
use crate::camera::CameraModel;
use crate::sensors::{CameraMount, CameraRig, ChainPrior, GimbalRig, ImuIntrinsics, Rig};
use crate::simulation::equipment::{GRAVITY_M_PER_S2, GROUND_TRUTH_TOPIC, JOINT_TOPIC};

/// Largest angle between a ray and the optical axis that is rendered: the grid of samples grows with its tangent.
const MAX_RAY_RAD: f64 = 70.0 * std::f64::consts::PI / 180.0;

/// True rig from a file: its cameras, noise and chain, with the encoders of the options and the gravity of the worlds.
///
/// # Errors
/// If there is no motion for it, or the rig has a property that is not simulated.
pub(super) fn rig_as_truth(rig: &Rig, options: &SimulationOptions, name: &str) -> Result<Rig, SimulationError> {
    let problem = |problem: String| SimulationError::Rig { rig: rig.name.clone(), problem };
    if options.motion.is_none() {
        return Err(problem("the experiments' motions are those of the paper's gimbal, give a motion".to_owned()));
    }
    if options.gimbal_imu_noise_scale.is_some() || rig.gimbal_imu.is_some() {
        return Err(problem("an IMU on the gimbal is simulated for the paper's gimbal only; omit imu1".to_owned()));
    }
    unsupported(rig).map_or(Ok(()), |found| Err(problem(found)))?;
    let mut truth = rig.clone();
    name.clone_into(&mut truth.name);
    truth.gravity_m_per_s2 = GRAVITY_M_PER_S2;
    truth.ground_truth_topic = Some(GROUND_TRUTH_TOPIC.to_owned());
    truth.ground_truth_lever_arm = None;
    truth.assumed.clear();
    truth.cameras.retain(|camera| options.static_camera || camera.mount == CameraMount::Gimbal);
    if truth.cameras.is_empty() {
        return Err(problem("it has no camera on the gimbal; keep the static ones".to_owned()));
    }
    for camera in &mut truth.cameras {
        camera.timeshift_cam_imu_s = Planting::of(&options.disturbances).camera_offset_s();
        camera.readout_s = options.disturbances.readout_s;
    }
    if let Some(gimbal) = &mut truth.gimbal {
        gimbal.prior = ChainPrior { translation_bound_m: 0.0, rotation_bound_rad: 0.0 };
        gimbal.encoder_sigma_rad = options.encoder_sigma_rad;
        let topic = gimbal.topic.take().unwrap_or_else(|| JOINT_TOPIC.to_owned());
        gimbal.topic = options.encoder_sigma_rad.map(|_| topic);
    } else if options.encoder_sigma_rad.is_some() {
        return Err(problem("it has no gimbal, so that it has no encoders either".to_owned()));
    }
    Ok(truth)
}

/// First property of a rig that simulated sensors do not have, as a sentence.
fn unsupported(rig: &Rig) -> Option<String> {
    let imu = &rig.imu;
    if imu.accelerometer_topic.is_some() {
        return Some("gyroscope and accelerometer on two topics are not simulated; use one".to_owned());
    }
    if imu.intrinsics != ImuIntrinsics::default() {
        return Some(
            "scale and misalignment of the IMU are not simulated from a rig; omit them, or use --disturb \
             imu-intrinsics"
                .to_owned(),
        );
    }
    if imu.use_log_time || rig.cameras.iter().any(|camera| camera.use_log_time) {
        return Some("messages have header stamps; omit use_log_time".to_owned());
    }
    rig.cameras.iter().find_map(unsupported_camera).or_else(|| rig.gimbal.as_ref().and_then(unsupported_gimbal))
}

fn unsupported_camera(camera: &CameraRig) -> Option<String> {
    let key = &camera.key;
    if camera.timeshift_cam_imu_s != 0.0 || camera.readout_s != 0.0 {
        return Some(format!(
            "time offset and readout of {key} are not taken from a rig; set them to 0, and use --disturb camera-offset \
             and readout"
        ));
    }
    if camera.mask.is_some() {
        return Some(format!("{key} has a mask, and the vehicle is not rendered; omit it"));
    }
    let widest_rad = widest_ray_rad(&camera.model);
    (widest_rad > MAX_RAY_RAD).then(|| {
        format!(
            "{key} sees rays {:.0}° from its axis, at most {:.0}° are rendered",
            widest_rad.to_degrees(),
            MAX_RAY_RAD.to_degrees()
        )
    })
}

fn unsupported_gimbal(gimbal: &GimbalRig) -> Option<String> {
    if gimbal.attitude.is_some() {
        return Some("attitudes of a gimbal are not simulated; give joints".to_owned());
    }
    if gimbal.use_log_time || gimbal.timeshift_gimbal_imu_s != 0.0 {
        return Some(
            "joint angles have the IMU's clock; omit use_log_time and timeshift_gimbal_imu, or use --disturb joint-lag"
                .to_owned(),
        );
    }
    None
}

/// Largest angle between the optical axis and a ray through the border of the image.
fn widest_ray_rad(model: &CameraModel) -> f64 {
    const STEPS: usize = 16;
    let [width, height] = model.resolution_px.map(|size| (size - 1) as f64);
    let angle_rad =
        |u: f64, v: f64| model.unproject(&Vector2::new(u, v)).map_or(0.0, |ray| ray.xy().norm().atan2(ray.z));
    let along = (0..=STEPS).map(|step| step as f64 / STEPS as f64);
    let border = along.flat_map(|ratio| {
        let (u, v) = (ratio * width, ratio * height);
        [(u, 0.0), (u, height), (0.0, v), (width, v)]
    });
    border.map(|(u, v)| angle_rad(u, v)).fold(0.0, f64::max)
}
