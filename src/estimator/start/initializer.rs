//! Initialization phase: keeps frames until an attempt has a solution, then creates the first window from it.

use std::borrow::Cow;
use std::collections::VecDeque;

use super::first_window::{FirstWindow, WaitingFrame, initial_joints_rad};
use crate::estimator::initialization::{
    InitializationFrame, InitializationInput, InitializationOptions, InitializationOutcome, InitializationSolution,
    StationaryEstimate, StereoPair, WaitReason, try_initialize,
};
use crate::estimator::report::{Event, EventKind, Phase, StepReport};
use crate::estimator::state::calibrations::{Calibrations, MAIN};
use crate::estimator::step_input::StepInput;
use crate::estimator::window::reporting::{calibration_estimate, empty_report};
use crate::estimator::window::setup::Setup;
use crate::estimator::window::sliding_window::SlidingWindow;
use crate::frontend::FeatureId;
use crate::geometry::{RigidTransform, seconds_from_ns};
use crate::sensors::{ChainPrior, ImuSample};

/// Longest gap between IMU samples within the kept frames; a longer one drops the frames before it.
const LONGEST_GAP_S: f64 = 0.1;

/// Time without a feature of the leading camera after which another camera starts the window.
const NO_FEATURES_S: f64 = 2.0;

/// Keeps the frames of the last seconds and tries to initialize from them.
#[derive(Clone, Debug)]
pub(crate) struct Initializer {
    /// Given calibration; a user may fix or set parameters before the window exists.
    pub(crate) calibration: Calibrations,
    /// Last pose before the failure, at which a restarted window starts.
    resume_at: Option<RigidTransform>,
    /// Frames before the first window, oldest first.
    waiting: VecDeque<WaitingFrame>,
    stationary: Option<StationaryEstimate>,
}

/// Result of a step without a window.
#[derive(Debug)]
pub(crate) enum InitializationStep {
    /// The initialization waits; the report has the reasons.
    Waiting(StepReport),
    /// The solved window with its report.
    Initialized(Box<SlidingWindow>, StepReport),
}

impl Initializer {
    pub(crate) fn new(calibration: Calibrations, resume_at: Option<RigidTransform>) -> Self {
        Self { calibration, resume_at, waiting: VecDeque::new(), stationary: None }
    }

    /// Processes the tracks of one image with the IMU samples before it; `events` are earlier events of the step.
    pub(crate) fn step(&mut self, setup: &Setup, input: &StepInput<'_>, mut events: Vec<Event>) -> InitializationStep {
        let begin_ms = setup.clock_ms();
        self.keep(setup, input, &mut events);
        let options = self.options(setup);
        let mut step = match self.attempt(setup, &options) {
            InitializationOutcome::Initialized(solution) => match self.first_window(setup, &solution) {
                Some(first) => {
                    let max_scale_sigma = options.max_scale_sigma;
                    let (window, report) = first.solve(setup, input, max_scale_sigma, &mut events);
                    InitializationStep::Initialized(Box::new(window), report)
                }
                None => InitializationStep::Waiting(self.report(setup, input)),
            },
            InitializationOutcome::Waiting { reasons, stationary, .. } => {
                if let Some(stationary) = stationary {
                    let bias = stationary.gyroscope_bias_rad_per_s.norm();
                    events.push(Event {
                        kind: EventKind::Stationary,
                        message: "stationary: gyroscope bias measured, waiting for motion".to_owned(),
                        value: Some(bias),
                        threshold: None,
                        cause: None,
                    });
                    self.stationary = Some(stationary);
                }
                events.extend(reasons.into_iter().map(waiting_for));
                InitializationStep::Waiting(self.report(setup, input))
            }
        };
        let (InitializationStep::Waiting(report) | InitializationStep::Initialized(_, report)) = &mut step;
        let reporting_ms = report.times.report_ms + report.times.linearize_ms;
        report.times.optimize_ms = setup.clock_ms() - begin_ms - reporting_ms;
        events.append(&mut report.events);
        report.events = events;
        step
    }

    /// Creates the window of a solution; consumes the waiting frames.
    fn first_window<'a>(&mut self, setup: &Setup, solution: &'a InitializationSolution) -> Option<FirstWindow<'a>> {
        let waiting = std::mem::take(&mut self.waiting);
        FirstWindow::new(setup, solution, waiting, self.calibration.clone(), self.resume_at.as_ref())
    }

    pub(crate) fn drop_features(&mut self, camera: usize, dropped: &impl Fn(FeatureId) -> bool) {
        for frame in &mut self.waiting {
            for features in frame.features.get_mut(camera).into_iter().flatten() {
                features.retain(|feature| !dropped(feature.id));
            }
        }
    }

    pub(crate) fn heap_bytes(&self) -> usize {
        self.waiting.iter().map(WaitingFrame::bytes).sum()
    }

    fn report(&self, setup: &Setup, input: &StepInput<'_>) -> StepReport {
        let calibration = calibration_estimate(setup, &self.calibration, &[]);
        empty_report(setup, input, Phase::Initializing, calibration)
    }

    fn joints(&self) -> usize {
        self.calibration.of(MAIN).joint_count()
    }

    /// Keeps the frame of this image; drops frames that are too old or lie before a gap.
    fn keep(&mut self, setup: &Setup, input: &StepInput<'_>, events: &mut Vec<Event>) {
        let encoder = setup.encoder_reading(input, self.joints());
        let joints_rad = initial_joints_rad(encoder.as_ref(), self.joints());
        if let Some(last) = self.waiting.back() {
            let interval_s = seconds_from_ns(input.stamp_ns - last.stamp_ns);
            let gap_s = longest_gap_s(input, last.stamp_ns);
            if interval_s <= 0.0 || gap_s > LONGEST_GAP_S {
                let message = format!("gap of {gap_s:.3} s in the IMU samples: earlier frames discarded");
                events.push(Event::decided(EventKind::MeasurementMissing, message, gap_s, LONGEST_GAP_S));
                self.waiting.clear();
                self.stationary = None;
            }
        }
        self.waiting.push_back(WaitingFrame {
            index: input.frame_index,
            stamp_ns: input.stamp_ns,
            features: (0..self.calibration.cameras())
                .map(|camera| {
                    let matched = self.calibration.matched(camera, input.matched(camera));
                    [input.features(camera), matched].map(<[_]>::to_vec)
                })
                .collect(),
            imu_from_camera: self.calibration.of(self.calibration.leading()).imu_from_camera(&joints_rad),
            encoder,
            imu: input.imu.to_vec(),
            imu_after: if setup.has_moving_rows() { input.imu_after.to_vec() } else { Vec::new() },
            image_times_s: input.image_times_s.to_vec(),
            gimbal_imu: if setup.config.gimbal_imu.is_some() { input.gimbal_imu.to_vec() } else { Vec::new() },
        });
        let longest_ns = (self.options(setup).longest_window_s * 1e9) as i64;
        while self.waiting.front().is_some_and(|first| input.stamp_ns - first.stamp_ns > longest_ns) {
            self.waiting.pop_front();
        }
        self.replace_leading_camera(events);
    }

    /// Lets another camera start the window where the leading one has had no feature for a while, preferably a rigid one.
    fn replace_leading_camera(&mut self, events: &mut Vec<Event>) {
        let (Some(first), Some(newest)) = (self.waiting.front(), self.waiting.back()) else { return };
        let span_s = seconds_from_ns(newest.stamp_ns - first.stamp_ns);
        let sees = |camera: usize, frame: &WaitingFrame| !frame.features[camera][0].is_empty();
        let leading = self.calibration.leading();
        if span_s < NO_FEATURES_S || self.waiting.iter().any(|frame| sees(leading, frame)) {
            return;
        }
        let has_own_pose = |camera: &usize| self.calibration.of(*camera).base().is_none();
        let seeing = (0..self.calibration.cameras()).filter(has_own_pose).filter(|camera| sees(*camera, newest));
        let Some(other) = seeing.min_by_key(|camera| self.calibration.of(*camera).joint_count()) else { return };
        let message = "the camera that starts the window has no features: another one starts it".to_owned();
        events.push(Event::decided(EventKind::MeasurementMissing, message, span_s, NO_FEATURES_S));
        self.calibration = self.calibration.clone().led_by(Some(other));
        let joints = self.joints();
        for frame in &mut self.waiting {
            let joints_rad = frame.initial_joints_rad(joints);
            frame.imu_from_camera = self.calibration.of(other).imu_from_camera(&joints_rad);
        }
    }

    /// Largest standard deviation of the encoder angles of the kept frames, `None` when a frame has no encoder reading.
    fn largest_encoder_sigma_rad(&self) -> Option<f64> {
        self.waiting.iter().try_fold(0.0, |largest: f64, frame| {
            frame.encoder.as_ref().map(|encoder| encoder.sigmas_rad.iter().copied().fold(largest, f64::max))
        })
    }

    fn options(&self, setup: &Setup) -> InitializationOptions {
        let options = &setup.config.options;
        let camera = self.calibration.leading();
        let calibration = self.calibration.of(camera);
        let base = InitializationOptions {
            accelerometer_bias_sigma_m_per_s2: options.accelerometer_bias_sigma,
            ..InitializationOptions::default()
        }
        .for_camera(setup.config.model(camera).focal_length_px(), options.pixel_sigma_px);
        let joints = calibration.joint_count();
        let joints_rad = self.waiting.back().map_or_else(Vec::new, |newest| newest.initial_joints_rad(joints));
        if let Some((translation_m, rotation_rad)) = calibration.found_extrinsics_sigmas(&joints_rad) {
            return if joints == 0 {
                base.for_rigid_camera(rotation_rad, translation_m)
            } else {
                base.for_gimbal_with(rotation_rad, translation_m, self.largest_encoder_sigma_rad())
            };
        }
        let (translation_m, rotation_rad) = setup.config.extrinsics_sigmas(camera);
        if joints == 0 {
            return base.for_rigid_camera(rotation_rad, translation_m);
        }
        // The rig's bounds belong to uniform errors (σ·√3).
        let bounds = ChainPrior {
            translation_bound_m: translation_m * 3.0_f64.sqrt(),
            rotation_bound_rad: rotation_rad * 3.0_f64.sqrt(),
        };
        base.for_gimbal(&bounds, joints, self.largest_encoder_sigma_rad())
    }

    fn attempt(&self, setup: &Setup, options: &InitializationOptions) -> InitializationOutcome {
        let leading = self.calibration.leading();
        // With several cameras the leading one may lack an image; its IMU samples are added to the next frame.
        let has_image = |frame: &WaitingFrame| frame.features.len() == 1 || !frame.features[leading][0].is_empty();
        if !self.waiting.back().is_some_and(has_image) {
            return InitializationOutcome::Waiting { reasons: Vec::new(), passed: Vec::new(), stationary: None };
        }
        let mut motions: Vec<Cow<'_, [ImuSample]>> = Vec::new();
        let mut pending: Vec<ImuSample> = Vec::new();
        for frame in &self.waiting {
            if !has_image(frame) {
                pending.extend(&frame.imu);
            } else if pending.is_empty() {
                motions.push(Cow::Borrowed(&frame.imu));
            } else {
                pending.extend(&frame.imu);
                motions.push(Cow::Owned(std::mem::take(&mut pending)));
            }
        }
        let frames: Vec<InitializationFrame<'_>> = self
            .waiting
            .iter()
            .filter(|frame| has_image(frame))
            .zip(&motions)
            .map(|(frame, imu)| InitializationFrame {
                frame_index: frame.index,
                stamp_ns: frame.stamp_ns,
                features: &frame.features[leading][0],
                matched: &frame.features[leading][1],
                imu_from_camera: frame.imu_from_camera,
                imu,
            })
            .collect();
        let input = InitializationInput {
            frames: &frames,
            gravity_m_per_s2: setup.config.gravity_m_per_s2,
            imu_noise: setup.imu_noise,
            stationary: self.stationary,
            bias: setup.found_bias(),
            pair: self.calibration.of(leading).partner().map(|partner| StereoPair {
                camera_from_other: self.calibration.of(partner).imu_from_camera(&[]),
                sigmas: setup.config.extrinsics_sigmas(partner),
            }),
        };
        try_initialize(&input, options)
    }
}

fn waiting_for(reason: WaitReason) -> Event {
    Event::decided(EventKind::InitializationWaits, reason.message, reason.value, reason.threshold)
}

/// Longest time without an IMU sample between the previous image and this one.
fn longest_gap_s(input: &StepInput<'_>, last_stamp_ns: i64) -> f64 {
    let stamps = std::iter::once(last_stamp_ns)
        .chain(input.imu.iter().map(|sample| sample.stamp_ns).filter(|stamp| *stamp > last_stamp_ns))
        .chain(std::iter::once(input.stamp_ns));
    let stamps: Vec<i64> = stamps.collect();
    stamps.windows(2).map(|pair| seconds_from_ns(pair[1] - pair[0])).fold(0.0, f64::max)
}
