//! Running window. A step predicts, solves, rejects outliers, selects keyframes and removes a frame.

use super::consistency::ConsistencyMonitor;
use super::failure::{LandmarkWatch, failure, saturation};
use super::features::{self, FeatureMap};
use super::reporting::{calibration_estimate, empty_report};
use super::setup::Setup;
use super::solve::SolvedWindow;
use super::stationary::{Observed, StationaryDetector};
use super::window_state::WindowState;
use crate::estimator::report::{Event, EventKind, FailureCause, Phase, StepReport};
use crate::estimator::state::allocation::allocated_bytes;
use crate::estimator::state::calibrations::MAIN;
use crate::estimator::state::frame::Frame;
use crate::estimator::state::frame_state::{FrameState, Rates};
use crate::estimator::state::preintegration::Preintegration;
use crate::estimator::step_input::StepInput;
use crate::geometry::{RigidTransform, median, seconds_from_ns};
use crate::gimbal::SWITCH_MARGIN;

/// Assumed distance of a scene without triangulated landmarks.
const UNKNOWN_DISTANCE_M: f64 = 10.0;
/// Upper bound of the assumed distance of a scene.
const FARTHEST_USUAL_M: f64 = 100.0;

#[derive(Clone, Debug)]
pub(crate) struct SlidingWindow {
    pub(crate) state: WindowState,
    pub(super) monitors: Monitors,
}

/// State kept between steps outside the least-squares problem: detectors, running means, last standard deviations.
#[derive(Clone, Debug, Default)]
pub(crate) struct Monitors {
    /// Posterior standard deviations of the calibration's columns after the last solve.
    calibration_sigmas: Vec<f64>,
    stationary: StationaryDetector,
    consistency: ConsistencyMonitor,
    landmarks: LandmarkWatch,
}

#[derive(Debug)]
pub(crate) struct WindowFailure {
    /// Events of the step; the failure is the last one.
    pub(crate) events: Vec<Event>,
    /// Last pose before the failure, `None` if no pose is finite.
    pub(crate) last_pose: Option<RigidTransform>,
}

impl SlidingWindow {
    /// Window that starts from the given state.
    pub(crate) fn new(state: WindowState) -> Self {
        Self { state, monitors: Monitors::default() }
    }

    /// Processes the tracks of an image with the IMU samples before it: estimates with its frame, reports, then removes
    /// outliers and a frame.
    pub(crate) fn step(&mut self, setup: &Setup, input: &StepInput<'_>) -> Result<StepReport, WindowFailure> {
        let before_ns = self.state.frames.newest().stamp_ns;
        if input.stamp_ns <= before_ns {
            return Ok(self.skip(setup, input, before_ns));
        }
        let begin_ms = setup.clock_ms();
        let mut events = Vec::new();
        let mut solved = match self.estimate(setup, input, &mut events) {
            Ok(solved) => solved,
            Err(failure) => {
                events.push(failure);
                return Err(self.failed(input, events));
            }
        };
        let optimize_ms = setup.clock_ms() - begin_ms;
        let mut report = self.report(setup, input, &mut solved);
        report.times.optimize_ms = optimize_ms;
        let marginalizing_ms = setup.clock_ms();
        let scores = || self.state.sensor_scores(setup);
        report.warnings = self.monitors.consistency.observe(
            report.stamp_ns,
            (&report.residuals, &self.state.gimbal_imu_noise),
            &setup.config,
            scores,
        );
        self.state.drop_rejected(&solved, &setup.config.options, &mut events);
        events.extend(self.switch_near_singularity(setup));
        self.state.drop_or_marginalize_frame(setup, &mut events);
        self.state.follow_residuals(setup, &solved, seconds_from_ns(input.stamp_ns - before_ns));
        report.times.marginalize_ms = setup.clock_ms() - marginalizing_ms;
        report.events.extend(events);
        Ok(report)
    }

    /// Adds the frame of an image, solves the window and decides on the keyframe; the error is the failure of the window.
    fn estimate(
        &mut self,
        setup: &Setup,
        input: &StepInput<'_>,
        events: &mut Vec<Event>,
    ) -> Result<SolvedWindow, Event> {
        let options = &setup.config.options;
        self.push_frame(setup, input)?;
        events.extend(saturation(self.state.frames.newest()));
        events.extend(self.detect_stationary(setup, input));
        let predicted = self.state.frames.newest().state.navigation;
        let solved = self.state.solve(setup, options.iterations);
        events.extend(self.monitors.landmarks.observe(&self.state, options));
        let newest = self.state.frames.newest();
        if let Some(failure) = failure(newest, &predicted, &self.monitors.landmarks, options) {
            return Err(failure);
        }
        events.push(self.state.choose_keyframe(setup));
        Ok(solved)
    }

    pub(crate) fn report(&mut self, setup: &Setup, input: &StepInput<'_>, solved: &mut SolvedWindow) -> StepReport {
        self.monitors.calibration_sigmas = solved.solution.calibration_sigmas();
        let calibration = calibration_estimate(setup, &self.state.calibration, &self.monitors.calibration_sigmas);
        self.state.report(setup, input, solved, calibration)
    }

    /// Skips an image that is not later than the newest one.
    fn skip(&self, setup: &Setup, input: &StepInput<'_>, newest_stamp_ns: i64) -> StepReport {
        let calibration = calibration_estimate(setup, &self.state.calibration, &self.monitors.calibration_sigmas);
        let mut report = empty_report(setup, input, Phase::Tracking, calibration);
        report.window = self.state.window_report();
        let stamp_s = seconds_from_ns(input.stamp_ns);
        let message =
            format!("image {} is stamped {stamp_s:.3} s, not after the newest one: skipped", input.frame_index);
        let newest_s = seconds_from_ns(newest_stamp_ns);
        report.events.push(Event::decided(EventKind::MeasurementMissing, message, stamp_s, newest_s));
        report
    }

    fn failed(&self, input: &StepInput<'_>, events: Vec<Event>) -> WindowFailure {
        let pose = |frame: &Frame| frame.state.navigation.world_from_imu;
        let is_good = |frame: &&Frame| {
            frame.index != input.frame_index && pose(frame).translation_m.iter().all(|x| x.is_finite())
        };
        WindowFailure { events, last_pose: self.state.frames.iter().rev().find(is_good).map(pose) }
    }

    /// Adds the frame of `input` with a predicted state; fails when IMU samples are missing.
    fn push_frame(&mut self, setup: &Setup, input: &StepInput<'_>) -> Result<(), Event> {
        let window = &mut self.state;
        let last = window.frames.newest();
        let interval_s = seconds_from_ns(input.stamp_ns - last.stamp_ns);
        let errors = window.calibration.imu_errors().copied();
        let mut motion = Preintegration::with_intrinsics(setup.imu_noise, last.state.navigation.bias, errors);
        motion.extend(input.imu);
        let covered = motion.duration_s();
        if covered < 0.5 * interval_s || interval_s <= 0.0 {
            let message = format!("IMU samples cover {covered:.3} s of the {interval_s:.3} s since the last image");
            return Err(Event::failure(FailureCause::Imu, message, covered, 0.5 * interval_s));
        }
        let navigation = motion.predict(&last.state.navigation, &setup.gravity_in_world);
        let encoder = setup.encoder_reading(input, window.calibration.of(MAIN).joint_count());
        let mut predicted = window.predict_gimbal_imu(setup, input, &navigation);
        let joints_rad = predicted.joints_rad.take().unwrap_or_else(|| {
            encoder.as_ref().map_or_else(|| last.state.joints_rad.clone(), |encoder| encoder.angles_rad.clone())
        });
        let joint_motion = setup.initial_joint_motion(encoder.as_ref(), joints_rad.len());
        let profile = setup.motion_profile([input.imu, input.imu_after], input.image_times_s, navigation.bias);
        let rates = Rates::at(input.imu, encoder.as_ref(), profile, input.image_times_s);
        let state = FrameState { navigation, joints_rad, joint_motion, gimbal_imu: predicted.state, rates };
        let frame = Frame::new(input.frame_index, input.stamp_ns, state, encoder, motion);
        window.frames.push(Frame { keyframe: false, ..frame.with_gimbal_motion(predicted.motion) });
        let slot = window.frames.newest_slot();
        for (camera, features) in window.features.iter_mut().enumerate() {
            let matched = window.calibration.matched(camera, input.matched(camera));
            features::observe(features, slot, input.features(camera), matched);
        }
        window.align_newest_joints(setup);
        Ok(())
    }

    /// Detects a stationary vehicle at the newest frame.
    fn detect_stationary(&mut self, setup: &Setup, input: &StepInput<'_>) -> Option<Event> {
        let newest = self.state.frames.newest();
        let navigation = newest.state.navigation;
        let camera = self.state.calibration.leading();
        let observed = Observed {
            features: input.features(camera),
            noise: &setup.imu_noise,
            bias: &navigation.bias,
            velocity_norm_m_per_s: navigation.velocity_m_per_s.norm(),
            imu_from_camera: self.state.calibration.of(camera).imu_from_camera(&newest.state.joints_rad).rotation,
            distance_m: usual_distance_m(&self.state.features),
        };
        let (stationary, event) = self.monitors.stationary.observe(input, &observed)?;
        self.state.frames.newest_mut().stationary = Some(stationary);
        Some(event)
    }

    /// Switches the minimal parameterization near its singularity, if the configuration allows it.
    fn switch_near_singularity(&mut self, setup: &Setup) -> Option<Event> {
        if !setup.config.auto_parameterize || self.state.calibration.dof() == 0 {
            return None;
        }
        let chain = self.state.calibration.of(MAIN).chain();
        let better = chain.should_switch()?;
        let margin = chain.margins().iter().map(|(_, margin)| *margin).fold(1.0, f64::min);
        self.state.switch_parameterization(better);
        let message =
            format!("parameterization switched to {better}: singularity margin {margin:.2} < {SWITCH_MARGIN:.2}");
        Some(Event::decided(EventKind::ParameterizationSwitched, message, margin, SWITCH_MARGIN))
    }
}

impl Monitors {
    pub(super) fn heap_bytes(&self) -> usize {
        allocated_bytes(self.calibration_sigmas.capacity() * size_of::<f64>()) + self.stationary.heap_bytes()
    }
}

/// Median distance of the landmarks from their anchors, in metres.
fn usual_distance_m(features: &[FeatureMap]) -> f64 {
    let features = features.iter().flat_map(FeatureMap::values);
    median(features.filter_map(|feature| Some(feature.landmark?.inverse_distance)))
        .map_or(UNKNOWN_DISTANCE_M, |inverse_distance| 1.0 / inverse_distance.max(1.0 / FARTHEST_USUAL_M))
}
