//! The first window: created from a solution of the initialization and solved several times with outlier rejection.

use std::collections::VecDeque;

use nalgebra::{UnitQuaternion, Vector3};

use super::extrinsics_fit::fit_extrinsics;
use crate::estimator::factors::start_prior::StartPrior;
use crate::estimator::initialization::{InitializationOrigin, InitializationSolution};
use crate::estimator::report::{Event, EventKind, StepReport};
use crate::estimator::state::calibrations::{Calibrations, MAIN};
use crate::estimator::state::earlier_pass::BiasPrior;
use crate::estimator::state::frame::Frame;
use crate::estimator::state::frame_state::{FrameState, Rates};
use crate::estimator::state::navigation::{ImuBias, NavigationState};
use crate::estimator::state::preintegration::Preintegration;
use crate::estimator::step_input::StepInput;
use crate::estimator::window::drop_or_marginalize_frame;
use crate::estimator::window::features::{self, FeatureMap};
use crate::estimator::window::frames::Frames;
use crate::estimator::window::setup::Setup;
use crate::estimator::window::sliding_window::SlidingWindow;
use crate::estimator::window::window_state::WindowState;
use crate::frontend::TrackedFeature;
use crate::geometry::{RigidTransform, so3};
use crate::sensors::{ImuSample, JointAngles};

/// Iteration limits of the solves of the first window: the first starts from inaccurate values, the others follow an
/// outlier rejection.
const FIRST_SOLVES: [usize; 3] = [15, 10, 5];

/// Window created from a solution, before its first solve.
pub(super) struct FirstWindow<'a> {
    solution: &'a InitializationSolution,
    window: SlidingWindow,
    /// Features by frame and camera.
    observed: Vec<Vec<[Vec<TrackedFeature>; 2]>>,
}

impl<'a> FirstWindow<'a> {
    /// Window of the newest views of a solution, with the features of the leading camera; `None` when none of these
    /// views is among the waiting frames.
    pub(super) fn new(
        setup: &Setup,
        solution: &'a InitializationSolution,
        waiting: VecDeque<WaitingFrame>,
        mut calibration: Calibrations,
        resume_at: Option<&RigidTransform>,
    ) -> Option<Self> {
        let options = &setup.config.options;
        let leading = calibration.leading();
        let joints = calibration.of(MAIN).joint_count();
        let world = world_from_solution(solution, resume_at);
        let most_frames = drop_or_marginalize_frame::first_window_frames(&calibration, options);
        let views = &solution.frames[solution.frames.len().saturating_sub(most_frames + 1)..];
        let errors = calibration.imu_errors().copied();
        let empty = || Preintegration::with_intrinsics(setup.imu_noise, solution.bias, errors);
        let mut imu = empty();
        // Samples of the IMU on the gimbal since the last frame; none after an interval without them.
        let mut gimbal_imu: Option<Vec<ImuSample>> = Some(Vec::new());
        let mut extrinsics = Vec::new();
        let mut observed = Vec::new();
        let mut features = vec![FeatureMap::new(); calibration.cameras()];
        let mut frames: Option<Frames> = None;
        for waiting in waiting {
            imu.extend(&waiting.imu);
            gimbal_imu = gimbal_imu.filter(|_| !waiting.gimbal_imu.is_empty());
            if let Some(samples) = &mut gimbal_imu {
                samples.extend(&waiting.gimbal_imu);
            }
            let Some(view) = views.iter().find(|view| view.frame_index == waiting.index) else { continue };
            let since_last = std::mem::replace(&mut imu, empty());
            let gimbal_samples = gimbal_imu.replace(Vec::new()).unwrap_or_default();
            let motion = if frames.is_some() { since_last } else { empty() };
            let navigation = NavigationState {
                world_from_imu: world * view.world_from_imu,
                velocity_m_per_s: world.rotation * view.velocity_m_per_s,
                bias: solution.bias,
            };
            let joints_rad = waiting.initial_joints_rad(joints);
            let joint_motion = setup.initial_joint_motion(waiting.encoder.as_ref(), joints_rad.len());
            let samples = [waiting.imu.as_slice(), &waiting.imu_after];
            let profile = setup.motion_profile(samples, &waiting.image_times_s, solution.bias);
            let rates = Rates::at(&waiting.imu, waiting.encoder.as_ref(), profile, &waiting.image_times_s);
            let own = setup.initial_gimbal_imu(navigation.velocity_m_per_s);
            let gimbal_motion = frames.as_ref().and_then(|frames: &Frames| {
                let interval_ns = waiting.stamp_ns - frames.newest().stamp_ns;
                setup.gimbal_motion(&gimbal_samples, own?.bias, interval_ns)
            });
            let state = FrameState { navigation, joints_rad, joint_motion, gimbal_imu: own, rates };
            let frame = Frame::new(waiting.index, waiting.stamp_ns, state, waiting.encoder, motion)
                .with_gimbal_motion(gimbal_motion);
            match &mut frames {
                None => frames = Some(Frames::new(frame)),
                Some(frames) => frames.push(frame),
            }
            extrinsics.push(view.imu_from_camera);
            let [seen, matched] = &waiting.features[leading];
            features::observe(&mut features[leading], extrinsics.len() - 1, seen, matched);
            observed.push(waiting.features);
        }
        let mut frames = frames?;
        frames.newest_mut().keyframe = false;
        if leading == MAIN {
            fit_extrinsics(calibration.of_mut(MAIN), &mut frames, &extrinsics);
        }
        let bias = setup.found_bias().unwrap_or_else(|| BiasPrior {
            mean: ImuBias {
                gyroscope_rad_per_s: solution.bias.gyroscope_rad_per_s,
                accelerometer_m_per_s2: Vector3::zeros(),
            },
            gyroscope_sigma_rad_per_s: Vector3::repeat(options.gyroscope_bias_sigma),
            accelerometer_sigma_m_per_s2: Vector3::repeat(options.accelerometer_bias_sigma),
        });
        let start = StartPrior {
            reference: frames.oldest().state.navigation.world_from_imu,
            bias: bias.mean,
            accelerometer_bias_sigma: bias.accelerometer_sigma_m_per_s2,
            gyroscope_bias_sigma: bias.gyroscope_sigma_rad_per_s,
            gimbal_bias_sigmas: setup
                .config
                .gimbal_imu
                .as_ref()
                .map(|_| [options.gyroscope_bias_sigma, options.accelerometer_bias_sigma]),
        };
        let state = WindowState::new(frames, features, calibration, start);
        Some(Self { solution, window: SlidingWindow::new(state), observed })
    }

    /// Solves the window with outlier rejection between the solves; returns it with its report.
    pub(super) fn solve(
        mut self,
        setup: &Setup,
        input: &StepInput<'_>,
        max_scale_sigma: f64,
        events: &mut Vec<Event>,
    ) -> (SlidingWindow, StepReport) {
        let options = &setup.config.options;
        let mut solved = self.window.state.solve(setup, FIRST_SOLVES[0]);
        if self.add_other_cameras() {
            self.window.state.drop_rejected(&solved, options, events);
            solved = self.window.state.solve(setup, FIRST_SOLVES[0]);
        }
        for iterations in &FIRST_SOLVES[1..] {
            self.window.state.drop_rejected(&solved, options, events);
            solved = self.window.state.solve(setup, *iterations);
        }
        let window = &mut self.window.state;
        if let Some(start) = &mut window.start {
            start.reference = window.frames.oldest().state.navigation.world_from_imu;
        }
        let (kind, how) = match self.solution.origin {
            InitializationOrigin::Motion => (EventKind::InitializedFromMotion, "motion"),
            InitializationOrigin::Stereo => (EventKind::InitializedFromMotion, "a stereo pair"),
            InitializationOrigin::Stationary => (EventKind::InitializedFromStationary, "a stationary vehicle"),
        };
        let scale_sigma = self.solution.diagnostics.scale_sigma;
        let message = format!(
            "initialized from {how}: {} frames, {} landmarks, σ(scale) {:.1} %",
            self.solution.frames.len(),
            self.solution.landmarks.len(),
            100.0 * scale_sigma
        );
        events.push(Event::decided(kind, message, scale_sigma, max_scale_sigma));
        events.push(window.choose_keyframe(setup));
        let report = self.window.report(setup, input, &mut solved);
        self.window.state.drop_rejected(&solved, options, events);
        self.window.state.drop_or_marginalize_frame(setup, events);
        (self.window, report)
    }

    /// Adds the features of the other cameras; returns true if there are any. Their given extrinsics may have large
    /// errors, so they are excluded from the first solve.
    fn add_other_cameras(&mut self) -> bool {
        let window = &mut self.window.state;
        let leading = window.calibration.leading();
        for (slot, by_camera) in self.observed.iter().enumerate() {
            for (camera, features) in by_camera.iter().enumerate().filter(|(camera, _)| *camera != leading) {
                let [seen, matched] = features;
                features::observe(&mut window.features[camera], slot, seen, matched);
            }
        }
        window.calibration.cameras() > 1
    }
}

/// Pose of the solution's world frame: identity, or position and yaw of the window before a failure.
fn world_from_solution(solution: &InitializationSolution, resume_at: Option<&RigidTransform>) -> RigidTransform {
    let (Some(resume), Some(first)) = (resume_at, solution.frames.first()) else {
        return RigidTransform::identity();
    };
    let yaw = |rotation: &UnitQuaternion<f64>| {
        let forward = rotation * Vector3::x();
        forward.y.atan2(forward.x)
    };
    let yaw_change = yaw(&resume.rotation) - yaw(&first.world_from_imu.rotation);
    let rotation = so3::exp(&Vector3::new(0.0, 0.0, yaw_change));
    RigidTransform::new(rotation, resume.translation_m - rotation * first.world_from_imu.translation_m)
}

/// Frame kept during initialization.
#[derive(Clone, Debug)]
pub(super) struct WaitingFrame {
    pub(super) index: usize,
    pub(super) stamp_ns: i64,
    /// Features by camera, and those that the other camera of its pair observes as well.
    pub(super) features: Vec<[Vec<TrackedFeature>; 2]>,
    pub(super) encoder: Option<JointAngles>,
    /// Extrinsics of the leading camera.
    pub(super) imu_from_camera: RigidTransform,
    pub(super) imu: Vec<ImuSample>,
    /// IMU samples from the stamp on.
    pub(super) imu_after: Vec<ImuSample>,
    /// Stamps of the images after the frame's, as in [`StepInput`].
    pub(super) image_times_s: Vec<f64>,
    /// Samples of the IMU on the gimbal over the interval of `imu`.
    pub(super) gimbal_imu: Vec<ImuSample>,
}

impl WaitingFrame {
    /// Encoder angles; zeros without encoders.
    pub(super) fn initial_joints_rad(&self, joints: usize) -> Vec<f64> {
        initial_joints_rad(self.encoder.as_ref(), joints)
    }

    /// Memory use in bytes, heap included.
    pub(super) fn bytes(&self) -> usize {
        let features: usize =
            self.features.iter().flatten().map(|seen| seen.capacity() * size_of::<TrackedFeature>()).sum();
        let encoder = self.encoder.as_ref().map_or(0, JointAngles::heap_bytes);
        size_of::<Self>()
            + features
            + encoder
            + self.image_times_s.capacity() * size_of::<f64>()
            + (self.imu.capacity() + self.imu_after.capacity() + self.gimbal_imu.capacity()) * size_of::<ImuSample>()
    }
}

/// Encoder angles; zeros without encoders.
pub(super) fn initial_joints_rad(encoder: Option<&JointAngles>, joints: usize) -> Vec<f64> {
    encoder.map_or_else(|| vec![0.0; joints], |encoder| encoder.angles_rad.clone())
}
