//! Windows and estimators from synthetic flights.

use nalgebra::{DMatrix, DVector, Vector3};

use super::Noise;
use crate::estimator::config::{CameraSensorPrior, EstimatorConfig, EstimatorOptions, FurtherCamera, rigid_chain};
use crate::estimator::estimator::PhaseState;
use crate::estimator::factors::kind::FactorLabel;
use crate::estimator::factors::labelled_rows::{LabelledRows, stack};
use crate::estimator::factors::measurements::measurements;
use crate::estimator::factors::start_prior::StartPrior;
use crate::estimator::problem::problem::Problem;
use crate::estimator::report::StepReport;
use crate::estimator::state::calibrations::MAIN;
use crate::estimator::state::estimate::Estimate;
use crate::estimator::state::frame::{Frame, layout};
use crate::estimator::state::frame_state::{FrameState, Rates};
use crate::estimator::state::gimbal_imu_noise::GimbalImuNoise;
use crate::estimator::state::navigation::{ImuBias, NavigationState};
use crate::estimator::state::preintegration::Preintegration;
use crate::estimator::window::features::ActiveTracks;
use crate::estimator::window::features::{self, FeatureMap};
use crate::estimator::window::frames::Frames;
use crate::estimator::window::setup::Setup;
use crate::estimator::window::window_state::WindowState;
use crate::estimator::{DEFAULT_CHAIN_PRIOR, Estimator, StepInput};
use crate::frontend::{TrackedFeature, TrackedFrame};
use crate::geometry::{Dimension, seconds_from_ns};
use crate::gimbal::{Chain, ParameterId, Parameterization};
use crate::sensors::{ChainPrior, ImuSample, Rig};
use crate::simulation::{
    Exercise, JOINT_PERIOD_S, JointSwing, SyntheticFlight, SyntheticFrame, SyntheticMotion, SyntheticMount,
    SyntheticOptions, VehicleSwing, synthetic_tracks,
};

pub(super) struct TestWindow {
    pub(super) setup: Setup,
    pub(super) window: WindowState,
}

impl TestWindow {
    /// Window of a tracking estimator.
    pub(super) fn of(estimator: &Estimator) -> Self {
        let PhaseState::Tracking(window) = &estimator.phase else { panic!("the estimator has no window") };
        Self { setup: estimator.setup.clone(), window: window.state.clone() }
    }

    /// Fixes a parameter of the main camera's chain.
    pub(super) fn freeze(&mut self, parameter: ParameterId) {
        let calibration = self.window.calibration.of_mut(MAIN);
        let column = calibration.parameters().iter().position(|known| *known == parameter).unwrap();
        calibration.freeze(column);
    }

    pub(super) fn active_tracks(&self) -> Vec<ActiveTracks> {
        self.window.active_tracks()
    }

    pub(super) fn problem<'a>(&'a self, active: &'a [ActiveTracks]) -> Problem<'a> {
        self.window.problem(&self.setup, active)
    }

    /// Current estimate, with the landmarks of these tracks.
    pub(super) fn estimate(&self, active: &[ActiveTracks]) -> Estimate {
        self.window.estimate(active.iter().map(|active| active.landmarks.clone()).collect())
    }
}

/// Hover during which one joint swings by 15° from 4.5 s on.
pub(super) fn joint_swing(joint: usize, duration_s: f64) -> SyntheticOptions {
    let swing = JointSwing { joint, amplitude_rad: 15_f64.to_radians(), period_s: JOINT_PERIOD_S };
    SyntheticOptions {
        duration_s,
        features: 80,
        motion: SyntheticMotion::Hover,
        look_around_rad: 0.3,
        exercise: Some((4.5, Exercise::full(VehicleSwing::Hover, Some(swing)))),
        ..SyntheticOptions::default()
    }
}

/// Configuration for a rig's `cam0`.
pub(super) fn config(rig: &Rig, parameterization: Parameterization, options: EstimatorOptions) -> EstimatorConfig {
    let gimbal_prior = rig.gimbal.as_ref().map(|gimbal| gimbal.prior.sigmas());
    EstimatorConfig {
        chain_prior: gimbal_prior,
        options,
        ..EstimatorConfig::for_camera(rig, "cam0", parameterization).unwrap()
    }
}

/// Camera of a flight beside the one of another flight, which is camera `base` of the run.
fn camera_beside(flight: &SyntheticFlight, base: usize, number: u8) -> FurtherCamera {
    let rig = &flight.given_rig;
    FurtherCamera {
        number,
        key: format!("cam{number}"),
        model: rig.cameras[1].model.clone(),
        base: Some(base),
        is_matched: false,
        base_from_camera: rig.base_from_camera(Some("cam0"), "cam1").unwrap(),
        prior: ChainPrior::RELATIVE.sigmas(),
        timeshift_s: 0.0,
        sensor: CameraSensorPrior::default(),
    }
}

/// Camera of a rigid flight, as `cam1`.
pub(super) fn rigid_camera(flight: &SyntheticFlight) -> FurtherCamera {
    FurtherCamera {
        number: 1,
        timeshift_s: 0.0,
        key: "cam1".to_owned(),
        model: flight.given_rig.cameras[0].model.clone(),
        base: None,
        is_matched: false,
        base_from_camera: flight.given_rig.chain_of_camera("cam0").unwrap().imu_from_camera(&[]),
        prior: DEFAULT_CHAIN_PRIOR,
        sensor: CameraSensorPrior::default(),
    }
}

/// Runs one step on a synthetic frame with the given tracks.
pub(super) fn step(
    estimator: &mut Estimator,
    frame: &SyntheticFrame,
    tracks: &TrackedFrame,
    further_tracks: &[&TrackedFrame],
) -> StepReport {
    step_before(estimator, frame, None, tracks, further_tracks)
}

/// [`step`] with the IMU samples of the next frame, during which the rows of a rolling shutter are exposed.
pub(super) fn step_before(
    estimator: &mut Estimator,
    frame: &SyntheticFrame,
    next: Option<&SyntheticFrame>,
    tracks: &TrackedFrame,
    further_tracks: &[&TrackedFrame],
) -> StepReport {
    let joint_angles = estimator.config().encoder_sigma_rad.and_then(|sigma_rad| frame.encoder_angles(sigma_rad));
    estimator.step(&StepInput {
        frame_index: frame.index,
        stamp_ns: frame.stamp_ns,
        imu: &frame.imu,
        imu_after: next.map_or(&[], |next| &next.imu),
        image_times_s: &[],
        gimbal_imu: &frame.gimbal_imu,
        joint_angles: joint_angles.as_ref(),
        tracks,
        further_tracks,
    })
}

fn flight(gimbal: bool) -> SyntheticFlight {
    synthetic_tracks(&flight_options(gimbal))
}

fn flight_options(gimbal: bool) -> SyntheticOptions {
    SyntheticOptions {
        mount: if gimbal { SyntheticMount::Gimbal } else { SyntheticMount::Static },
        duration_s: 8.0,
        features: 40,
        ..SyntheticOptions::default()
    }
}

/// Window of six frames at the ground truth (landmarks from the noisy tracks), with the given chain.
pub(super) fn window(parameterization: Parameterization, gimbal: bool, options: EstimatorOptions) -> TestWindow {
    window_of(&flight(gimbal), &[], config(&flight(gimbal).given_rig, parameterization, options))
}

/// [`window`] of a gimballed and a rigid camera, with all time offsets if `estimate_timeshift`.
pub(super) fn cluster_window(options: EstimatorOptions, estimate_timeshift: bool) -> TestWindow {
    let (main, rigid) = (flight(true), flight(false));
    assert_eq!(main.frames[7].imu, rigid.frames[7].imu, "one flight");
    let config = EstimatorConfig {
        further_cameras: vec![rigid_camera(&rigid)],
        estimate_timeshift,
        ..config(&main.given_rig, Parameterization::Minimal, options)
    };
    window_of(&main, &[&rigid], config)
}

/// [`cluster_window`] with a camera beside the rigid one and a second one on the gimbal.
pub(super) fn mounted_window(options: EstimatorOptions, estimate_intrinsics: bool) -> TestWindow {
    let (main, rigid) = (flight(true), flight(false));
    let beside = |gimbal| synthetic_tracks(&SyntheticOptions { beside: true, ..flight_options(gimbal) });
    let (right, second) = (beside(false), beside(true));
    assert_eq!(main.frames[7].imu, right.frames[7].imu, "one flight");
    let config = EstimatorConfig {
        further_cameras: vec![rigid_camera(&rigid), camera_beside(&right, 1, 2), camera_beside(&second, MAIN, 3)],
        estimate_intrinsics,
        ..config(&main.given_rig, Parameterization::Minimal, options)
    };
    window_of(&main, &[&rigid, &right, &second], config)
}

/// Flight of a rigid camera with the observations of its features by the right one of a stereo pair, and the flight of that
/// one.
pub(super) fn stereo_flights(options: &SyntheticOptions) -> [SyntheticFlight; 2] {
    let options = SyntheticOptions { mount: SyntheticMount::Static, ..options.clone() };
    let mut flight = synthetic_tracks(&options);
    let right = synthetic_tracks(&SyntheticOptions { beside: true, ..options.clone() });
    let model = &right.true_rig.cameras[1].model;
    let mut random = Noise::new(5);
    for (frame, right) in flight.frames.iter_mut().zip(&right.frames) {
        for feature in &frame.tracks.features {
            let Some(point_m) = flight.landmarks.get(&feature.id) else { continue };
            let in_right = right.true_world_from_camera.inverse().transform(point_m);
            let seen_px = model.project(&in_right).filter(|uv_px| model.contains(uv_px, 0.0));
            let noisy_px = seen_px.map(|uv_px| uv_px.map(|at| at + options.pixel_sigma_px * random.normal()));
            let observed = noisy_px.and_then(|uv_px| Some((uv_px, model.unproject(&uv_px)?)));
            frame.tracks.matched.extend(observed.map(|(uv_px, bearing)| TrackedFeature { uv_px, bearing, ..*feature }));
        }
    }
    [flight, right]
}

/// Configuration of a stereo pair.
pub(super) fn stereo_config([flight, right]: &[SyntheticFlight; 2], options: EstimatorOptions) -> EstimatorConfig {
    EstimatorConfig {
        further_cameras: vec![FurtherCamera { is_matched: true, ..camera_beside(right, MAIN, 1) }],
        chain_prior: None,
        ..config(&flight.given_rig, Parameterization::Minimal, options)
    }
}

/// Window of a stereo pair, with time offsets.
pub(super) fn stereo_window(options: EstimatorOptions) -> TestWindow {
    let flights = stereo_flights(&flight_options(false));
    let config = EstimatorConfig { estimate_timeshift: true, ..stereo_config(&flights, options) };
    let [flight, right] = &flights;
    let test = window_of(flight, &[right], config);
    let is_matched = |features: &FeatureMap| features.values().filter(|feature| feature.matched.len() > 1).count();
    assert!(is_matched(&test.window.features[MAIN]) > 20, "matches");
    test
}

/// Time of the gimballed camera's images after the rigid one's in [`interleaved_window`].
const INTERLEAVED_S: f64 = -0.02;

/// [`cluster_window`] with the frames at the images of the rigid camera, and with images of the gimballed one between them.
pub(super) fn interleaved_window(options: EstimatorOptions, estimate_timeshift: bool) -> TestWindow {
    let main = synthetic_tracks(&SyntheticOptions { phase_s: INTERLEAVED_S, ..flight_options(true) });
    let rigid = flight(false);
    let config = EstimatorConfig {
        further_cameras: vec![rigid_camera(&rigid)],
        frame_camera: Some(1),
        estimate_timeshift,
        ..config(&main.given_rig, Parameterization::Minimal, options)
    };
    window_of(&main, &[&rigid], config)
}

/// Window of a gimballed or a rigid camera with a changed configuration.
pub(super) fn changed_window(
    gimbal: bool,
    options: EstimatorOptions,
    change: impl FnOnce(&mut EstimatorConfig),
) -> TestWindow {
    let flight = flight(gimbal);
    let mut config = config(&flight.given_rig, Parameterization::Minimal, options);
    change(&mut config);
    window_of(&flight, &[], config)
}

/// Window of a gimballed camera with an IMU on the gimbal, with a changed configuration.
pub(super) fn gimbal_imu_window(options: EstimatorOptions, change: impl FnOnce(&mut EstimatorConfig)) -> TestWindow {
    let flight = synthetic_tracks(&SyntheticOptions { gimbal_imu: true, ..flight_options(true) });
    let mut config = config(&flight.given_rig, Parameterization::Minimal, options);
    assert!(config.gimbal_imu.is_some());
    change(&mut config);
    window_of(&flight, &[], config)
}

fn window_of(flight: &SyntheticFlight, further: &[&SyntheticFlight], config: EstimatorConfig) -> TestWindow {
    let parameterization = config.parameterization;
    let setup = Setup::new(config);
    let mut calibration = setup.given_calibration();
    let true_chain = |flight: &SyntheticFlight| flight.true_rig.chain_of_camera("cam0").unwrap();
    calibration.of_mut(MAIN).set_chain(Chain::from_classical(&true_chain(flight), parameterization));
    for (camera, further) in (1..).zip(further) {
        let beside = further.true_rig.base_from_camera(Some("cam0"), "cam1").map(|pose| rigid_chain(&pose));
        let mount = Chain::from_classical(&beside.unwrap_or_else(|| true_chain(further)), Parameterization::Minimal);
        calibration.of_mut(camera).set_chain(mount);
    }
    let mut features = vec![FeatureMap::new(); calibration.cameras()];
    let mut frames: Option<Frames> = None;
    // The window's frames lie at the images of this flight.
    let frame_flight = further.first().filter(|_| setup.config.frame_camera == Some(1)).map_or(flight, |rigid| *rigid);
    let spacing = 4;
    let first = 100;
    for slot in 0..6 {
        let index = first + slot * spacing;
        let (ground_truth, main) = (&frame_flight.frames[index], &flight.frames[index]);
        let image_times_s = match setup.config.frame_camera {
            Some(_) => vec![seconds_from_ns(main.stamp_ns - ground_truth.stamp_ns), 0.0],
            None => Vec::new(),
        };
        let encoder = setup.config.encoder_sigma_rad.and_then(|sigma_rad| main.encoder_angles(sigma_rad));
        let bias = ImuBias {
            gyroscope_rad_per_s: ground_truth.true_bias.gyroscope_rad_per_s,
            accelerometer_m_per_s2: ground_truth.true_bias.accelerometer_m_per_s2,
        };
        let mut motion = Preintegration::new(setup.imu_noise, bias);
        if slot > 0 {
            for frame in &frame_flight.frames[index - spacing + 1..=index] {
                motion.extend(&frame.imu);
            }
        }
        let profile =
            setup.motion_profile([&ground_truth.imu, &frame_flight.frames[index + 1].imu], &image_times_s, bias);
        let joint_motion = setup.initial_joint_motion(encoder.as_ref(), main.true_joint_angles_rad.len());
        let state = FrameState {
            navigation: NavigationState {
                world_from_imu: ground_truth.true_world_from_imu,
                velocity_m_per_s: ground_truth.true_velocity_m_per_s,
                bias,
            },
            joints_rad: main.true_joint_angles_rad.clone(),
            joint_motion,
            gimbal_imu: setup.initial_gimbal_imu(ground_truth.true_velocity_m_per_s),
            rates: Rates::at(&ground_truth.imu, encoder.as_ref(), profile, &image_times_s),
        };
        let between = &flight.frames[index - spacing + 1..=index];
        let samples: Vec<ImuSample> = between.iter().flat_map(|frame| &frame.gimbal_imu).copied().collect();
        let gimbal_motion = (slot > 0)
            .then(|| {
                let interval_ns = ground_truth.stamp_ns - flight.frames[index - spacing].stamp_ns;
                setup.gimbal_motion(&samples, ImuBias::default(), interval_ns)
            })
            .flatten();
        let frame = Frame::new(index, ground_truth.stamp_ns, state, encoder, motion).with_gimbal_motion(gimbal_motion);
        match &mut frames {
            None => frames = Some(Frames::new(frame)),
            Some(frames) => frames.push(frame),
        }
        let matched = calibration.matched(MAIN, &main.tracks.matched);
        features::observe(&mut features[MAIN], slot, &main.tracks.features, matched);
        for (camera, further) in (1..).zip(further) {
            features::observe(&mut features[camera], slot, &further.frames[index].tracks.features, &[]);
        }
    }
    let frames = frames.expect("six frames");
    let start = StartPrior {
        reference: frames.oldest().state.navigation.world_from_imu,
        bias: ImuBias::default(),
        accelerometer_bias_sigma: Vector3::repeat(0.5),
        gyroscope_bias_sigma: Vector3::repeat(0.02),
        gimbal_bias_sigmas: Some([0.02, 0.5]),
    };
    let mut window = WindowState::new(frames, features, calibration, start);
    window.gimbal_imu_noise = GimbalImuNoise::OF_RIG;
    window.triangulate_new(&setup);
    assert!(window.active_tracks().iter().all(|active| active.ids.len() > 20), "enough landmarks");
    TestWindow { setup, window }
}

/// Marginalizes the oldest frame, which creates a prior and first estimates.
pub(super) fn marginalize_once(test: &mut TestWindow) {
    test.setup.config.options.window = test.window.frames.len() - 1;
    test.setup.config.options.first_window_factor = 1;
    test.window.drop_or_marginalize_frame(&test.setup, &mut Vec::new());
    assert!(test.window.prior.is_some());
}

/// Disturbs all unknowns but time offsets and intrinsics; `scale` 1 is 2 cm and 1° of pose, 0.1 m/s, 2 mm and 0.2° of
/// calibration.
pub(super) fn disturb(test: &mut TestWindow, scale: f64) {
    let mut random = Noise::new(11);
    let layout = layout(&test.window.frames, test.window.calibration.dof());
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
        for (offset, column) in layout.gimbal_imu(slot).enumerate() {
            delta[column] = random.normal() * [0.1, 0.003, 0.05][offset / 3];
        }
    }
    for (parameter, column) in test.window.calibration.parameters().into_iter().zip(layout.calibration()) {
        delta[column] = match parameter.dimension() {
            Dimension::Angle => 0.0035 * random.normal(),
            Dimension::Length => 0.002 * random.normal(),
            // Derivatives by velocity and bias, which a time offset multiplies, are neglected.
            Dimension::Time | Dimension::Pixel | Dimension::Ratio => 0.0,
        };
    }
    delta *= scale;
    for (slot, frame) in test.window.frames.iter_mut().enumerate() {
        frame.state = frame.state.stepped(frame.first_estimate.as_ref(), &delta.as_slice()[layout.frame(slot)]);
    }
    test.window.calibration = test.window.calibration.stepped(&delta.as_slice()[layout.calibration()]);
}

/// Rows `[columns of the layout | residual]` of the wanted factors, reprojections excepted.
pub(super) fn rows(problem: &Problem<'_>, estimate: &Estimate, wanted: impl Fn(FactorLabel) -> bool) -> DMatrix<f64> {
    let total = problem.layout.total();
    let linearized = problem.linearization_point(estimate);
    let point = problem.point(estimate, &linearized);
    let mut rows = LabelledRows::of(total, wanted);
    measurements(&point, problem.layout.frames, &mut rows);
    problem.priors(&point, &mut rows);
    stack(rows.matrices(), 0..=total)
}
