//! Rig of a chain that was calibrated from stills.

use crate::calibration::stills::StillsOutcome;
use crate::flight_log::rig_template::TYPICAL_IMU_NOISE;
use crate::geometry::{Dimension, RigidTransform};
use crate::sensors::{
    AssumedField, CameraMount, CameraRig, ChainPrior, GimbalRig, ImuIntrinsics, ImuRig, Joint, RequiredAccuracy, Rig,
    StillCamera, Stills,
};

/// Rate of images and joint angles, in Hz: stills have none.
const ASSUMED_RATE_HZ: f64 = 20.0;
/// Rate of the IMU, in Hz.
const ASSUMED_IMU_RATE_HZ: f64 = 200.0;
/// Ratio of the bound of a uniform error to its standard deviation.
const BOUND_PER_SIGMA: f64 = 1.732_050_807_568_877_2;
/// Bounds of the prior without standard deviations.
const ASSUMED_PRIOR: ChainPrior = ChainPrior { translation_bound_m: 0.01, rotation_bound_rad: 0.0175 };

/// Rig with the chain, its uncertainty as prior, and the rigid cameras; the frame of the first rigid camera is the IMU
/// frame.
pub(super) fn rig_of_stills(stills: &Stills, outcome: &StillsOutcome) -> Rig {
    let camera = |index: usize, camera: &StillCamera, mount: CameraMount| CameraRig {
        key: format!("cam{index}"),
        first_from_camera: RigidTransform::identity(),
        relative_prior: None,
        mount,
        topic: format!("/{}/image", camera.name),
        use_log_time: false,
        frame_id: camera.name.clone(),
        rate_hz: ASSUMED_RATE_HZ,
        model: camera.model.clone(),
        timeshift_cam_imu_s: 0.0,
        readout_s: 0.0,
        readout_sigma_s: None,
        intrinsics_sigma: None,
        mask: None,
    };
    let rigid = stills.rigid_cameras.iter().enumerate().map(|(index, rigid)| {
        let imu_from_camera = outcome.chain.rigid_from_first(index).inverse();
        camera(index + 1, rigid, CameraMount::Static { imu_from_camera })
    });
    let cameras = std::iter::once(camera(0, &stills.gimbal_camera, CameraMount::Gimbal)).chain(rigid).collect();
    let reason = |field: &str, reason: String| AssumedField { field: field.to_owned(), reason };
    let first = &stills.rigid_cameras[0].name;
    let largest = outcome.noise.encoder_rad.iter().copied().fold(0.0, f64::max);
    Rig {
        name: if stills.name.is_empty() { "stills".to_owned() } else { stills.name.clone() },
        gravity_m_per_s2: 9.81,
        imu: ImuRig {
            topic: "/imu".to_owned(),
            accelerometer_topic: None,
            use_log_time: false,
            frame_id: "imu".to_owned(),
            rate_hz: ASSUMED_IMU_RATE_HZ,
            noise: TYPICAL_IMU_NOISE,
            intrinsics: ImuIntrinsics::default(),
        },
        gimbal_imu: None,
        cameras,
        gimbal: Some(GimbalRig {
            topic: Some("/joint_states".to_owned()),
            attitude: None,
            use_log_time: false,
            timeshift_gimbal_imu_s: 0.0,
            rate_hz: ASSUMED_RATE_HZ,
            encoder_sigma_rad: (largest > 0.0 && largest.is_finite()).then_some(largest),
            prior: prior(outcome),
            switches_parameterization: false,
            chain: outcome.chain.chain.clone(),
            joints: stills.joints.iter().map(|name| joint(name)).collect(),
        }),
        ground_truth_topic: None,
        ground_truth_use_log_time: false,
        ground_truth_lever_arm: None,
        required_accuracy: RequiredAccuracy::default(),
        assumed: vec![
            reason("imu0", "the stills have no IMU, topic, rate and noise are placeholders".to_owned()),
            reason("gimbal.T_I_B", format!("the stills have no IMU, I is the frame of the rigid camera {first}")),
        ],
    }
}

fn joint(name: &str) -> Joint {
    Joint { name: name.to_owned(), limits_rad: (-std::f64::consts::PI, std::f64::consts::PI) }
}

/// Bounds that contain the largest σ of a length and of an angle in the reported parameterization.
fn prior(outcome: &StillsOutcome) -> ChainPrior {
    let bound = |dimension: Dimension| {
        let parameters = outcome.tables.first().into_iter().flat_map(|table| &table.parameters);
        let sigmas = parameters.filter(|parameter| parameter.dimension == dimension).map(|parameter| parameter.sigma);
        BOUND_PER_SIGMA * sigmas.fold(0.0, f64::max)
    };
    let or_assumed = |bound: f64, assumed: f64| if bound > 0.0 && bound.is_finite() { bound } else { assumed };
    ChainPrior {
        translation_bound_m: or_assumed(bound(Dimension::Length), ASSUMED_PRIOR.translation_bound_m),
        rotation_bound_rad: or_assumed(bound(Dimension::Angle), ASSUMED_PRIOR.rotation_bound_rad)
            .min(std::f64::consts::PI),
    }
}
