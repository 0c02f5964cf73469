//! Synthetic flights with both cameras.

use std::sync::Arc;

use crate::calibration::{CalibrationInput, GimbalCamera, StaticCamera, TrackedView};
use crate::estimator::{EstimatorConfig, ImuBias, NavigationState};
use crate::geometry::RigidTransform;
use crate::gimbal::{ClassicalChain, Parameterization};
use crate::sensors::{CameraMount, ChainPrior, Rig};
use crate::simulation::{SyntheticFlight, SyntheticFrame, SyntheticMount, SyntheticOptions, synthetic_tracks};

/// Flight with both cameras and its ground truth.
pub(super) struct Flight {
    pub(super) input: CalibrationInput,
    pub(super) true_extrinsics: RigidTransform,
    pub(super) true_chain: ClassicalChain,
    rigid: SyntheticFlight,
}

/// Ground-truth state at every image of the static camera.
pub(super) fn true_states(flight: &Flight) -> Vec<NavigationState> {
    let state = |frame: &SyntheticFrame| NavigationState {
        world_from_imu: frame.true_world_from_imu,
        velocity_m_per_s: frame.true_velocity_m_per_s,
        bias: ImuBias {
            gyroscope_rad_per_s: frame.true_bias.gyroscope_rad_per_s,
            accelerometer_m_per_s2: frame.true_bias.accelerometer_m_per_s2,
        },
    };
    flight.rigid.frames.iter().map(state).collect()
}

pub(super) fn mount(rig: &Rig) -> RigidTransform {
    match &rig.cameras[0].mount {
        CameraMount::Static { imu_from_camera } => *imu_from_camera,
        CameraMount::Gimbal => panic!("a rigid camera"),
    }
}

/// Tracked images of a flight; `encoder_sigma_rad` is unused without encoders.
pub(in crate::calibration) fn views(flight: &SyntheticFlight, encoder_sigma_rad: f64) -> Vec<TrackedView> {
    flight
        .frames
        .iter()
        .map(|frame| TrackedView {
            frame_index: frame.index,
            stamp_ns: frame.stamp_ns,
            imu: frame.imu.clone(),
            joint_angles: frame.encoder_angles(encoder_sigma_rad),
            tracks: Arc::new(frame.tracks.clone()),
        })
        .collect()
}

/// The same flight with either camera: equal seeds give equal trajectories and IMU samples.
pub(super) fn flight(options: &SyntheticOptions) -> Flight {
    let gimbal = synthetic_tracks(&SyntheticOptions { mount: SyntheticMount::Gimbal, ..options.clone() });
    let rigid = synthetic_tracks(&SyntheticOptions { mount: SyntheticMount::Static, ..options.clone() });
    assert_eq!(gimbal.frames[7].imu, rigid.frames[7].imu, "one flight");
    let given_extrinsics = mount(&rigid.given_rig);
    let extrinsics_prior = ChainPrior { translation_bound_m: 0.003, rotation_bound_rad: 0.0087 };
    let given = gimbal.given_rig.gimbal.clone().unwrap();
    let sigma_rad = given.encoder_sigma_rad.unwrap();
    let input = CalibrationInput {
        earlier: None,
        static_camera: StaticCamera {
            key: "cam1".to_owned(),
            model: rigid.given_rig.cameras[0].model.clone(),
            imu_from_camera: given_extrinsics,
            prior: extrinsics_prior,
            views: views(&rigid, sigma_rad),
        },
        gimbal_camera: GimbalCamera {
            key: "cam0".to_owned(),
            model: gimbal.given_rig.cameras[0].model.clone(),
            chain: given.chain,
            joints: given.joints.iter().map(|joint| joint.name.clone()).collect(),
            prior: given.prior,
            views: views(&gimbal, sigma_rad),
        },
        imu_noise: rigid.given_rig.imu.noise,
        gravity_m_per_s2: rigid.given_rig.gravity_m_per_s2,
        estimator: EstimatorConfig {
            chain: ClassicalChain { imu_from_base: given_extrinsics, ..ClassicalChain::default() },
            chain_prior: Some((0.0017, 0.005)),
            ..EstimatorConfig::for_camera(&rigid.given_rig, "cam0", Parameterization::Minimal).unwrap()
        },
    };
    Flight { input, true_extrinsics: mount(&rigid.true_rig), true_chain: gimbal.true_rig.gimbal.unwrap().chain, rigid }
}
