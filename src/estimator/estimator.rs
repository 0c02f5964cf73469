//! The estimator: what it holds between images, and the step from one image to the next.

use std::collections::VecDeque;

use nalgebra::Vector3;

use super::config::{EstimatorConfig, rigid_mount};
use super::initialization::StandstillEstimate;
use super::{Event, EventKind, Phase, StepInput, StepReport, gravity_in_world};
use crate::estimator::factors::prior::{Prior, StartPrior};
use crate::estimator::initialization::startup::WaitingFrame;
use crate::estimator::state::calibration::{Calibration, FreeClocks, GivenSigmas};
use crate::estimator::state::calibrations::{Calibrations, MAIN};
use crate::estimator::window::contradictions::Contradictions;
use crate::estimator::window::features::FeatureMap;
use crate::estimator::window::frames::Frame;
use crate::estimator::window::standstill::RestWatch;
use crate::geometry::{RigidTransform, seconds_from_ns};
use crate::gimbal::{ClassicalChain, Parameterization};
use crate::sensors::ImuNoise;

/// A sliding-window visual-inertial estimator for a camera on a gimbal, or on a rigid mount, and for rigid cameras beside it.
///
/// It is a plain value: a clone is a snapshot from which the same steps give the same bits.
#[derive(Clone, Debug)]
pub struct Estimator {
    pub(super) config: EstimatorConfig,
    pub(super) noise: ImuNoise,
    pub(super) gravity_in_world: Vector3<f64>,
    pub(super) calibration: Calibrations,
    pub(super) phase: Phase,
    pub(super) restarts: usize,
    /// Frames that wait for the initialization.
    pub(super) waiting: VecDeque<WaitingFrame>,
    pub(super) standstill: Option<StandstillEstimate>,
    /// Frames of the window, oldest first.
    pub(super) frames: Vec<Frame>,
    /// Features by camera: none is seen by two of them.
    pub(super) features: Vec<FeatureMap>,
    pub(super) prior: Option<Prior>,
    pub(super) start: Option<StartPrior>,
    /// Posterior standard deviations of the calibration after the last solve.
    pub(super) calibration_sigmas: Vec<f64>,
    /// Watches for rest while the window runs.
    pub(super) rest_watch: RestWatch,
    /// Watches whether residuals stay too large.
    contradictions: Contradictions,
    /// Since when too few landmarks have been in view.
    blind_since_ns: Option<i64>,
    /// Where a restarted window should begin: the last pose before the failure.
    pub(super) resume_at: Option<RigidTransform>,
}

impl Estimator {
    /// An estimator that waits for its first images.
    pub fn new(config: EstimatorConfig) -> Self {
        let factor = config.options.imu_noise_factor;
        let noise = ImuNoise {
            accelerometer_noise_density: config.imu_noise.accelerometer_noise_density * factor,
            accelerometer_random_walk: config.imu_noise.accelerometer_random_walk * factor,
            gyroscope_noise_density: config.imu_noise.gyroscope_noise_density * factor,
            gyroscope_random_walk: config.imu_noise.gyroscope_random_walk * factor,
        };
        let given = |camera: usize| {
            let (translation_m, rotation_rad) = config.mount_sigmas(camera);
            GivenSigmas { translation_m, rotation_rad }
        };
        let main = Calibration::new(
            &config.chain,
            config.parameterization,
            given(MAIN),
            config.calibrate,
            config.encoder_in_use().is_some(),
        );
        let clocks = |encoders: bool| match (config.estimate_timeshift, encoders) {
            (false, _) => FreeClocks::None,
            (true, false) => FreeClocks::Camera,
            (true, true) => FreeClocks::CameraAndEncoders,
        };
        let read = main.joint_count() > 0 && config.encoder_in_use().is_some();
        let main = main.with_clocks(clocks(read), config.timeshift_s);
        let rigid = config.rigid_cameras.iter().enumerate().map(|(index, camera)| {
            let mount = rigid_mount(&camera.imu_from_camera);
            Calibration::new(&mount, Parameterization::Minimal, given(index + 1), config.calibrate, false)
                .with_clocks(clocks(false), camera.timeshift_s)
        });
        let calibration = Calibrations::new(main, rigid);
        Self {
            noise,
            gravity_in_world: gravity_in_world(config.gravity_m_per_s2),
            calibration,
            phase: Phase::Initializing,
            restarts: 0,
            waiting: VecDeque::new(),
            standstill: None,
            frames: Vec::new(),
            features: vec![FeatureMap::new(); config.rigid_cameras.len() + 1],
            prior: None,
            start: None,
            calibration_sigmas: Vec::new(),
            rest_watch: RestWatch::default(),
            contradictions: Contradictions::default(),
            blind_since_ns: None,
            resume_at: None,
            config,
        }
    }

    /// What it was made from.
    pub fn config(&self) -> &EstimatorConfig {
        &self.config
    }

    /// Asks for [`StepReport::linearization`] from the next step on, or no longer.
    pub fn set_keep_linearization(&mut self, keep: bool) {
        self.config.options.keep_linearization = keep;
    }

    /// Asks for the linearization with [`StepReport::factor_rows`] from the next step on.
    pub fn set_keep_factor_rows(&mut self) {
        self.config.options.keep_linearization = true;
        self.config.options.keep_factor_rows = true;
    }

    /// Most steps that the solver tries from the next image on: with fewer than a step took, that step ends as it was in
    /// between.
    pub fn set_iterations(&mut self, iterations: usize) {
        self.config.options.iterations = iterations;
    }

    /// The chain as it is estimated now, in the classical form.
    pub fn classical_chain(&self) -> ClassicalChain {
        self.calibration.of(MAIN).chain().to_classical()
    }

    /// Takes in one image's tracks with the inertial samples before it, and tells everything about what came of it.
    pub fn step(&mut self, input: &StepInput<'_>) -> StepReport {
        let begin_ms = (self.config.clock_ms)();
        let mut report = match self.phase {
            Phase::Initializing => self.wait(input, Vec::new()),
            Phase::Tracking => self.track(input),
        };
        report.times.step_ms = (self.config.clock_ms)() - begin_ms;
        report
    }

    fn track(&mut self, input: &StepInput<'_>) -> StepReport {
        let newest_stamp_ns = self.frames.last().map_or(i64::MIN, |frame| frame.stamp_ns);
        if input.stamp_ns <= newest_stamp_ns {
            return self.skip(input, newest_stamp_ns);
        }
        let begin_ms = (self.config.clock_ms)();
        if let Err(failure) = self.push_frame(input) {
            return self.restart(input, vec![failure]);
        }
        let mut events: Vec<Event> = self.saturation().into_iter().collect();
        events.extend(self.watch_for_rest(input));
        let predicted = self.newest_state().navigation;
        let mut solved = self.solve_window(self.config.options.iterations);
        events.extend(self.watch_landmarks());
        if let Some(failure) = self.failure(&predicted) {
            events.push(failure);
            return self.restart(input, events);
        }
        let (keyframe, chosen) = self.choose_keyframe();
        if let Some(newest) = self.frames.last_mut() {
            newest.keyframe = keyframe;
        }
        events.push(chosen);
        let optimized_ms = (self.config.clock_ms)();

        let mut report = self.tracking_report(input, &mut solved);
        let marginalizing_ms = (self.config.clock_ms)();
        self.forget_rejected(&solved, &mut events);
        self.switch_chart_when_needed(&mut events);
        self.make_room(&mut events);
        report.times.optimize_ms = optimized_ms - begin_ms;
        report.times.marginalize_ms = (self.config.clock_ms)() - marginalizing_ms;
        report.events.extend(events);
        report.warnings = self.contradictions.watch(report.stamp_ns, &report.residuals, &self.config);
        report
    }

    /// An image that is not later than the newest one changes nothing.
    fn skip(&self, input: &StepInput<'_>, newest_stamp_ns: i64) -> StepReport {
        let mut report = self.empty_report(input, Phase::Tracking);
        report.window = self.window_report();
        report.events.push(Event {
            kind: EventKind::MeasurementMissing,
            message: format!(
                "image {} is stamped {:.3} s, not after the newest one: passed over",
                input.frame_index,
                crate::geometry::seconds_from_ns(input.stamp_ns)
            ),
            value: Some(crate::geometry::seconds_from_ns(input.stamp_ns)),
            threshold: Some(crate::geometry::seconds_from_ns(newest_stamp_ns)),
        });
        report
    }

    pub(super) fn newest_state(&self) -> &super::state::frame_state::FrameState {
        &self.frames.last().expect("a running window has frames").state
    }

    /// Inertial samples of the newest interval that were at the end of the sensor's range.
    fn saturation(&self) -> Option<Event> {
        let motion = &self.frames.last()?.motion;
        let (saturated, count) = (motion.saturated_samples(), motion.samples().len());
        (saturated > 0).then(|| Event {
            kind: EventKind::MeasurementMissing,
            message: format!(
                "the inertial sensor is saturated in {saturated} of {count} samples: an axis repeats a large value; it \
                 counts for little there"
            ),
            value: Some(saturated as f64),
            threshold: Some(0.0),
        })
    }

    /// Says when the landmarks in view become too few.
    fn watch_landmarks(&mut self) -> Option<Event> {
        let least = self.config.options.min_landmarks;
        let slot = self.frames.len() - 1;
        let seen = self
            .features
            .iter()
            .flat_map(FeatureMap::values)
            .filter(|feature| feature.landmark.is_some() && feature.observation(slot).is_some())
            .count();
        let newest = &self.frames[slot];
        // A vehicle at rest needs no landmarks to know where it is.
        if seen >= least || newest.rest.is_some() {
            self.blind_since_ns = None;
            return None;
        }
        if self.blind_since_ns.is_some() {
            return None;
        }
        self.blind_since_ns = Some(newest.stamp_ns);
        Some(Event {
            kind: EventKind::MeasurementMissing,
            message: format!(
                "{seen} landmarks in view, at least {least} are needed: until there are more, the inertial sensor alone \
                 tells the motion"
            ),
            value: Some(seen as f64),
            threshold: Some(least as f64),
        })
    }

    /// What says that the window has failed, against the newest state's prediction.
    fn failure(&self, predicted: &super::NavigationState) -> Option<Event> {
        let options = &self.config.options;
        let newest_ns = self.frames.last()?.stamp_ns;
        let blind_s = self.blind_since_ns.map_or(0.0, |since_ns| seconds_from_ns(newest_ns - since_ns));
        let state = self.newest_state().navigation;
        let checks = [
            (
                "the accelerometer's bias is out of bounds, m/s²",
                state.bias.accelerometer_m_per_s2.norm(),
                options.max_accelerometer_bias,
            ),
            (
                "the gyroscope's bias is out of bounds, rad/s",
                state.bias.gyroscope_rad_per_s.norm(),
                options.max_gyroscope_bias,
            ),
            ("the speed is out of bounds, m/s", state.velocity_m_per_s.norm(), options.max_speed),
            (
                "the newest position was corrected by too much, m",
                (state.world_from_imu.translation_m - predicted.world_from_imu.translation_m).norm(),
                options.max_position_correction_m,
            ),
            ("too few landmarks have been in view for too long, s", blind_s, options.max_blind_s),
        ];
        checks.into_iter().find(|(_, value, limit)| !value.is_finite() || value > limit).map(
            |(reason, value, limit)| Event {
                kind: EventKind::Failure,
                message: format!("{reason}: {value:.3} against {limit:.3}"),
                value: Some(value),
                threshold: Some(limit),
            },
        )
    }

    /// Forgets the window and begins anew with this image.
    fn restart(&mut self, input: &StepInput<'_>, events: Vec<Event>) -> StepReport {
        let good = self.frames.iter().rev().find(|frame| {
            let pose = &frame.state.navigation.world_from_imu;
            frame.index != input.frame_index && pose.translation_m.iter().all(|x| x.is_finite())
        });
        self.resume_at = good.map(|frame| frame.state.navigation.world_from_imu).or(self.resume_at);
        let resume_at = self.resume_at;
        let restarts = self.restarts + 1;
        let frozen = self.calibration.clone();
        *self = Self::new(self.config.clone());
        self.calibration.freeze_as(&frozen);
        self.resume_at = resume_at;
        self.restarts = restarts;
        self.wait(input, events)
    }

    fn switch_chart_when_needed(&mut self, events: &mut Vec<Event>) {
        if !self.config.auto_chart || self.calibration.dof() == 0 {
            return;
        }
        let chain = self.calibration.of(MAIN).chain();
        let Some(better) = chain.should_switch() else { return };
        let margin = chain.margins().iter().map(|(_, margin)| *margin).fold(1.0, f64::min);
        self.switch_chart(better);
        events.push(Event {
            kind: EventKind::ChartSwitched,
            message: format!("the chain goes over to the chart {better}: the old one is near its lock"),
            value: Some(margin),
            threshold: Some(crate::gimbal::SWITCH_MARGIN),
        });
    }

    /// Goes over to another chart: the calibration is the same, and the prior says the same about it.
    pub(super) fn switch_chart(&mut self, parameterization: Parameterization) {
        let layout = super::window::frames::layout(&self.frames, self.calibration.dof());
        let before = self.calibration.deviation();
        let old_from_new = self.calibration.switch_chart(parameterization);
        if let Some(prior) = &mut self.prior {
            let deviations = before.zip(self.calibration.deviation());
            prior.transport_calibration(&old_from_new, deviations.as_ref(), &layout);
        }
    }
}
