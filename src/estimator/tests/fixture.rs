//! Windows and estimators made from synthetic flights.

use nalgebra::DVector;

use super::Noise;
use crate::camera::CameraModel;
use crate::estimator::factors::preintegration::Preintegration;
use crate::estimator::factors::prior::StartPrior;
use crate::estimator::state::calibrations::MAIN;
use crate::estimator::state::frame_state::{FrameState, Rates};
use crate::estimator::state::layout::Layout;
use crate::estimator::state::navigation::{ImuBias, NavigationState};
use crate::estimator::window::features;
use crate::estimator::window::frames::Frame;
use crate::estimator::{
    DEFAULT_CHAIN_PRIOR, Estimator, EstimatorConfig, EstimatorOptions, RigidCamera, StepInput, StepReport,
};
use crate::frontend::TrackedFrame;
use crate::geometry::Dimension;
use crate::gimbal::{Chain, Parameterization};
use crate::sensors::Rig;
use crate::simulation::{Lens, SyntheticFlight, SyntheticFrame, SyntheticMount, SyntheticOptions, synthetic_tracks};

pub(super) fn camera(lens: Lens) -> CameraModel {
    let options = SyntheticOptions { duration_s: 0.1, lens, ..SyntheticOptions::default() };
    synthetic_tracks(&options).given_rig.cameras[0].model.clone()
}

/// An estimator for a rig's `cam0`.
pub(super) fn config(rig: &Rig, parameterization: Parameterization, options: EstimatorOptions) -> EstimatorConfig {
    let gimbal_prior = rig.gimbal.as_ref().map(|gimbal| gimbal.prior.sigmas());
    EstimatorConfig {
        chain_prior: gimbal_prior,
        options,
        ..EstimatorConfig::for_camera(rig, "cam0", parameterization).unwrap()
    }
}

/// The camera of a rigid flight, as one that is watched beside another.
pub(super) fn rigid_camera(flight: &SyntheticFlight) -> RigidCamera {
    RigidCamera {
        timeshift_s: 0.0,
        key: "cam1".to_owned(),
        model: flight.given_rig.cameras[0].model.clone(),
        imu_from_camera: flight.given_rig.chain_of_camera("cam0").unwrap().imu_from_camera(&[]),
        prior: DEFAULT_CHAIN_PRIOR,
    }
}

/// One step on a synthetic frame, with what its cameras have tracked.
pub(super) fn step(
    estimator: &mut Estimator,
    frame: &SyntheticFrame,
    tracks: &TrackedFrame,
    rigid_tracks: &[&TrackedFrame],
) -> StepReport {
    let joint_angles = estimator.config.encoder_sigma_rad.and_then(|sigma_rad| frame.encoder_angles(sigma_rad));
    estimator.step(&StepInput {
        frame_index: frame.index,
        stamp_ns: frame.stamp_ns,
        imu: &frame.imu,
        joint_angles: joint_angles.as_ref(),
        tracks,
        rigid_tracks,
    })
}

fn flight(gimbal: bool) -> SyntheticFlight {
    synthetic_tracks(&SyntheticOptions {
        mount: if gimbal { SyntheticMount::Gimbal } else { SyntheticMount::Static },
        duration_s: 8.0,
        features: 40,
        ..SyntheticOptions::default()
    })
}

/// A window of six frames at the truth (landmarks from the noisy tracks), with the given chain.
pub(super) fn window(parameterization: Parameterization, gimbal: bool, options: EstimatorOptions) -> Estimator {
    window_of(&flight(gimbal), None, config(&flight(gimbal).given_rig, parameterization, options))
}

/// The same with a rigid camera beside the gimballed one, and with the offsets of all clocks.
pub(super) fn cluster_window(options: EstimatorOptions, estimate_timeshift: bool) -> Estimator {
    let (main, rigid) = (flight(true), flight(false));
    assert_eq!(main.frames[7].imu, rigid.frames[7].imu, "one flight");
    let config = EstimatorConfig {
        rigid_cameras: vec![rigid_camera(&rigid)],
        estimate_timeshift,
        ..config(&main.given_rig, Parameterization::Minimal, options)
    };
    window_of(&main, Some(&rigid), config)
}

fn window_of(flight: &SyntheticFlight, rigid: Option<&SyntheticFlight>, config: EstimatorConfig) -> Estimator {
    let parameterization = config.parameterization;
    let mut estimator = Estimator::new(config);
    let true_chain = |flight: &SyntheticFlight| flight.true_rig.chain_of_camera("cam0").unwrap();
    estimator.calibration.of_mut(MAIN).set_chain(Chain::from_classical(&true_chain(flight), parameterization));
    if let Some(rigid) = rigid {
        let mount = Chain::from_classical(&true_chain(rigid), Parameterization::Minimal);
        estimator.calibration.of_mut(1).set_chain(mount);
    }
    let spacing = 4;
    let first = 100;
    for slot in 0..6 {
        let index = first + slot * spacing;
        let truth = &flight.frames[index];
        let encoder = estimator.config.encoder_sigma_rad.and_then(|sigma_rad| truth.encoder_angles(sigma_rad));
        let bias = ImuBias {
            gyroscope_rad_per_s: truth.true_bias.gyroscope_rad_per_s,
            accelerometer_m_per_s2: truth.true_bias.accelerometer_m_per_s2,
        };
        let mut motion = Preintegration::new(estimator.noise, bias);
        if slot > 0 {
            for frame in &flight.frames[index - spacing + 1..=index] {
                motion.extend(&frame.imu);
            }
        }
        estimator.frames.push(Frame {
            index,
            stamp_ns: truth.stamp_ns,
            state: FrameState {
                navigation: NavigationState {
                    world_from_imu: truth.true_world_from_imu,
                    velocity_m_per_s: truth.true_velocity_m_per_s,
                    bias,
                },
                joints_rad: truth.true_joint_angles_rad.clone(),
                rates: Rates::at(&truth.imu, encoder.as_ref()),
            },
            first_estimate: None,
            encoder,
            rest: None,
            keyframe: true,
            motion_information: motion.square_root_information(),
            motion,
        });
        features::observe(&mut estimator.features[MAIN], slot, &truth.tracks.features);
        if let Some(rigid) = rigid {
            features::observe(&mut estimator.features[1], slot, &rigid.frames[index].tracks.features);
        }
    }
    estimator.start = Some(StartPrior {
        reference: estimator.frames[0].state.clone(),
        bias: ImuBias::default(),
        accelerometer_bias_sigma: 0.5,
        gyroscope_bias_sigma: 0.02,
    });
    estimator.triangulate_new();
    assert!(estimator.active_tracks().iter().all(|active| active.ids.len() > 20), "enough landmarks");
    estimator
}

/// Marginalizes the oldest frame, so that there is a prior and there are first estimates.
pub(super) fn marginalize_once(estimator: &mut Estimator) {
    estimator.config.options.window = estimator.frames.len() - 1;
    estimator.config.options.first_window_factor = 1;
    estimator.make_room(&mut Vec::new());
    assert!(estimator.prior.is_some());
}

/// Moves every unknown but the clocks at random; `scale` 1 is 2 cm and 1° of pose, 0.1 m/s, 2 mm and 0.2° of calibration.
pub(super) fn shake(estimator: &mut Estimator, scale: f64) {
    let mut random = Noise::new(11);
    let layout = Layout {
        frames: estimator.frames.len(),
        joints: estimator.calibration.of(MAIN).joint_count(),
        calibration: estimator.calibration.dof(),
    };
    let mut delta = DVector::zeros(layout.total());
    for slot in 0..layout.frames {
        for (offset, column) in layout.pose(slot).enumerate() {
            delta[column] = random.normal() * if offset < 3 { 0.017 } else { 0.02 };
        }
        for column in layout.joints(slot) {
            delta[column] = random.normal() * 0.01;
        }
        for (offset, column) in layout.velocity_bias(slot).enumerate() {
            delta[column] = random.normal() * [0.1, 0.003, 0.05][offset / 3];
        }
    }
    for (parameter, column) in estimator.calibration.parameters().into_iter().zip(layout.calibration()) {
        delta[column] = match parameter.dimension() {
            Dimension::Angle => 0.0035 * random.normal(),
            Dimension::Length => 0.002 * random.normal(),
            // Derivatives by velocity and bias, which an offset of the clocks multiplies, are left out.
            Dimension::Time | Dimension::Ratio => 0.0,
        };
    }
    delta *= scale;
    for (slot, frame) in estimator.frames.iter_mut().enumerate() {
        frame.state = frame.state.stepped(frame.first_estimate.as_ref(), &delta.as_slice()[layout.frame(slot)]);
    }
    estimator.calibration = estimator.calibration.stepped(&delta.as_slice()[layout.calibration()]);
}
