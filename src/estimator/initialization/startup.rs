//! Before the window runs: frames are kept until the initialization has a solution, which then becomes the first window.

use std::borrow::Cow;

use nalgebra::{DMatrix, DVector, UnitQuaternion, Vector3};

use crate::estimator::estimator::Estimator;
use crate::estimator::factors::preintegration::Preintegration;
use crate::estimator::factors::prior::StartPrior;
use crate::estimator::initialization::{
    InitializationFrame, InitializationInput, InitializationOptions, InitializationOrigin, InitializationOutcome,
    InitializationSolution, WaitReason, try_initialize,
};
use crate::estimator::state::calibration::Calibration;
use crate::estimator::state::calibrations::MAIN;
use crate::estimator::state::frame_state::{FrameState, Rates};
use crate::estimator::state::navigation::NavigationState;
use crate::estimator::window::frames::Frame;
use crate::estimator::window::joints::UNKNOWN_TURN_RAD;
use crate::estimator::{Event, EventKind, Phase, StepInput, StepReport, window::features};
use crate::frontend::{FeatureId, TrackedFeature};
use crate::geometry::{RigidTransform, seconds_from_ns, so3};
use crate::sensors::{ImuSample, JointAngles};

/// A frame kept until the initialization succeeds.
#[derive(Clone, Debug)]
pub(crate) struct WaitingFrame {
    index: usize,
    stamp_ns: i64,
    /// By camera.
    features: Vec<Vec<TrackedFeature>>,
    encoder: Option<JointAngles>,
    /// Of the leading camera.
    imu_from_camera: RigidTransform,
    imu: Vec<ImuSample>,
}

impl WaitingFrame {
    /// Forgets what a camera saw of some features.
    pub(crate) fn forget_features(&mut self, camera: usize, gone: &impl Fn(FeatureId) -> bool) {
        if let Some(seen) = self.features.get_mut(camera) {
            seen.retain(|feature| !gone(feature.id));
        }
    }

    /// Bytes that it takes.
    pub(crate) fn bytes(&self) -> usize {
        let features: usize = self.features.iter().map(|seen| seen.capacity() * size_of::<TrackedFeature>()).sum();
        let encoder = self.encoder.as_ref().map_or(0, JointAngles::heap_bytes);
        size_of::<Self>() + features + encoder + self.imu.capacity() * size_of::<ImuSample>()
    }
}

/// Longest hole in the inertial samples that frames on both sides may be used together.
const LONGEST_HOLE_S: f64 = 0.1;
/// Standard deviation with which the joint angles are fitted to the mounts that the initialization found.
const MOUNT_FIT_SIGMA_RAD: f64 = 0.01;
/// Solves of the first window: the first from far, the later ones after outliers have been taken out.
const FIRST_SOLVES: [usize; 3] = [15, 10, 5];

impl Estimator {
    /// One step while there is no window.
    pub(crate) fn wait(&mut self, input: &StepInput<'_>, mut events: Vec<Event>) -> StepReport {
        let begin_ms = (self.config.clock_ms)();
        self.keep_waiting_frame(input, &mut events);
        let outcome = self.attempt();
        let mut report = match outcome {
            InitializationOutcome::Initialized(solution) => self.begin(input, &solution, &mut events),
            InitializationOutcome::Waiting { reasons, standstill, .. } => {
                if let Some(standing) = standstill {
                    events.push(Event {
                        kind: EventKind::Standstill,
                        message: "standing still: the gyroscope's bias is measured, motion is awaited".to_owned(),
                        value: Some(standing.gyroscope_bias_rad_per_s.norm()),
                        threshold: None,
                    });
                    self.standstill = Some(standing);
                }
                events.extend(reasons.into_iter().map(|reason| waits(&reason)));
                self.empty_report(input, Phase::Initializing)
            }
        };
        let reporting_ms = report.times.report_ms + report.times.linearize_ms;
        report.times.optimize_ms = (self.config.clock_ms)() - begin_ms - reporting_ms;
        let own = std::mem::take(&mut report.events);
        report.events = events;
        report.events.extend(own);
        report
    }

    fn keep_waiting_frame(&mut self, input: &StepInput<'_>, events: &mut Vec<Event>) {
        let encoder = self.encoder_reading(input);
        let joints = self.angles_to_start_from(encoder.as_ref());
        if let Some(last) = self.waiting.back() {
            let interval_s = seconds_from_ns(input.stamp_ns - last.stamp_ns);
            let hole_s = longest_hole_s(input, last.stamp_ns);
            if interval_s <= 0.0 || hole_s > LONGEST_HOLE_S {
                events.push(Event {
                    kind: EventKind::MeasurementMissing,
                    message: format!(
                        "a hole of {hole_s:.3} s in the inertial samples: the frames before it are forgotten"
                    ),
                    value: Some(hole_s),
                    threshold: Some(LONGEST_HOLE_S),
                });
                self.waiting.clear();
                self.standstill = None;
            }
        }
        self.waiting.push_back(WaitingFrame {
            index: input.frame_index,
            stamp_ns: input.stamp_ns,
            features: (0..self.calibration.cameras()).map(|camera| input.features(camera).to_vec()).collect(),
            imu_from_camera: self.calibration.of(self.calibration.leading()).imu_from_camera(&joints),
            encoder,
            imu: input.imu.to_vec(),
        });
        let longest_ns = (self.initialization_options().longest_window_s * 1e9) as i64;
        while self.waiting.front().is_some_and(|first| input.stamp_ns - first.stamp_ns > longest_ns) {
            self.waiting.pop_front();
        }
    }

    fn angles_to_start_from(&self, encoder: Option<&JointAngles>) -> Vec<f64> {
        encoder.map_or_else(|| vec![0.0; self.calibration.of(MAIN).joint_count()], |encoder| encoder.angles_rad.clone())
    }

    /// The largest standard deviation of the angles that the waiting frames start from, `None` when one has none.
    fn largest_encoder_sigma_rad(&self) -> Option<f64> {
        self.waiting.iter().try_fold(0.0, |largest: f64, frame| {
            frame.encoder.as_ref().map(|encoder| encoder.sigmas_rad.iter().copied().fold(largest, f64::max))
        })
    }

    fn initialization_options(&self) -> InitializationOptions {
        let options = &self.config.options;
        let camera = self.calibration.leading();
        let (translation_m, rotation_rad) = self.config.mount_sigmas(camera);
        let base = InitializationOptions {
            accelerometer_bias_sigma_m_per_s2: options.accelerometer_bias_sigma,
            ..InitializationOptions::default()
        }
        .for_camera(self.config.model(camera).focal_length_px(), options.pixel_sigma_px);
        let joints = self.calibration.of(camera).joint_count();
        if joints == 0 {
            return base.for_rigid_mount(rotation_rad, translation_m);
        }
        // The rig's bounds are those of uniform errors.
        let bounds = crate::sensors::ChainPrior {
            translation_bound_m: translation_m * 3.0_f64.sqrt(),
            rotation_bound_rad: rotation_rad * 3.0_f64.sqrt(),
        };
        base.for_gimbal(&bounds, joints, self.largest_encoder_sigma_rad())
    }

    fn attempt(&self) -> InitializationOutcome {
        let leading = self.calibration.leading();
        // Beside other cameras the leading one may lack an image; its motion goes to the next frame.
        let looked = |frame: &WaitingFrame| frame.features.len() == 1 || !frame.features[leading].is_empty();
        if !self.waiting.back().is_some_and(looked) {
            return InitializationOutcome::Waiting { reasons: Vec::new(), passed: Vec::new(), standstill: None };
        }
        let mut motions: Vec<Cow<'_, [ImuSample]>> = Vec::new();
        let mut pending: Vec<ImuSample> = Vec::new();
        for frame in &self.waiting {
            if !looked(frame) {
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
            .filter(|frame| looked(frame))
            .zip(&motions)
            .map(|(frame, imu)| InitializationFrame {
                frame_index: frame.index,
                stamp_ns: frame.stamp_ns,
                features: &frame.features[leading],
                imu_from_camera: frame.imu_from_camera,
                imu,
            })
            .collect();
        let input = InitializationInput {
            frames: &frames,
            gravity_m_per_s2: self.config.gravity_m_per_s2,
            imu_noise: self.noise,
            standstill: self.standstill,
        };
        try_initialize(&input, &self.initialization_options())
    }

    /// The solution becomes the window, which is solved right away.
    fn begin(
        &mut self,
        input: &StepInput<'_>,
        solution: &InitializationSolution,
        events: &mut Vec<Event>,
    ) -> StepReport {
        let joining = self.fill_window(solution);
        self.phase = Phase::Tracking;
        let mut solved = self.solve_window(FIRST_SOLVES[0]);
        if self.join(&joining) {
            self.forget_rejected(&solved, events);
            solved = self.solve_window(FIRST_SOLVES[0]);
        }
        for iterations in &FIRST_SOLVES[1..] {
            self.forget_rejected(&solved, events);
            solved = self.solve_window(*iterations);
        }
        if let Some(start) = &mut self.start {
            start.reference = self.frames[0].state.clone();
        }
        let (kind, how) = match solution.origin {
            InitializationOrigin::FromMotion => (EventKind::InitializedFromMotion, "motion"),
            InitializationOrigin::FromStandstill => (EventKind::InitializedFromStandstill, "standstill"),
        };
        events.push(Event {
            kind,
            message: format!(
                "initialized from {how}: {} frames, {} landmarks, scale known to {:.1} %",
                solution.frames.len(),
                solution.landmarks.len(),
                100.0 * solution.diagnostics.scale_sigma
            ),
            value: Some(solution.diagnostics.scale_sigma),
            threshold: Some(self.initialization_options().most_scale_sigma),
        });
        let (keyframe, chosen) = self.choose_keyframe();
        if let Some(newest) = self.frames.last_mut() {
            newest.keyframe = keyframe;
        }
        events.push(chosen);
        let report = self.tracking_report(input, &mut solved);
        self.forget_rejected(&solved, events);
        self.make_room(events);
        report
    }

    /// Makes the window of the solution's views, with the features of the leading camera; returns by view what each camera
    /// has seen.
    fn fill_window(&mut self, solution: &InitializationSolution) -> Vec<Vec<Vec<TrackedFeature>>> {
        let leading = self.calibration.leading();
        let mut seen = Vec::new();
        let world = self.world_of(solution);
        let views = &solution.frames[solution.frames.len().saturating_sub(self.room() + 1)..];
        let mut imu = Preintegration::new(self.noise, solution.bias);
        let mut mounts = Vec::new();
        for waiting in std::mem::take(&mut self.waiting) {
            let Some(view) = views.iter().find(|view| view.frame_index == waiting.index) else {
                imu.extend(&waiting.imu);
                continue;
            };
            imu.extend(&waiting.imu);
            let motion = std::mem::replace(&mut imu, Preintegration::new(self.noise, solution.bias));
            let first = self.frames.is_empty();
            let motion = if first { Preintegration::new(self.noise, solution.bias) } else { motion };
            let joints_rad = self.angles_to_start_from(waiting.encoder.as_ref());
            let navigation = NavigationState {
                world_from_imu: world * view.world_from_imu,
                velocity_m_per_s: world.rotation * view.velocity_m_per_s,
                bias: solution.bias,
            };
            let slot = self.frames.len();
            self.frames.push(Frame {
                index: waiting.index,
                stamp_ns: waiting.stamp_ns,
                state: FrameState { navigation, joints_rad, rates: Rates::at(&waiting.imu, waiting.encoder.as_ref()) },
                first_estimate: None,
                encoder: waiting.encoder,
                rest: None,
                keyframe: true,
                motion_information: motion.square_root_information(),
                motion,
            });
            mounts.push(view.imu_from_camera);
            features::observe(&mut self.features[leading], slot, &waiting.features[leading]);
            seen.push(waiting.features);
        }
        if let Some(newest) = self.frames.last_mut() {
            newest.keyframe = false;
        }
        if leading == MAIN {
            self.fit_mounts(&mounts);
        }
        let options = &self.config.options;
        self.start = self.frames.first().map(|first| StartPrior {
            reference: first.state.clone(),
            bias: crate::estimator::ImuBias {
                gyroscope_rad_per_s: solution.bias.gyroscope_rad_per_s,
                accelerometer_m_per_s2: Vector3::zeros(),
            },
            accelerometer_bias_sigma: options.accelerometer_bias_sigma,
            gyroscope_bias_sigma: options.gyroscope_bias_sigma,
        });
        seen
    }

    /// The cameras beside the leading one join the window that it has begun, and say whether there are any: what the rig
    /// says about their mounts may be far off, so that they do not take part in finding out where the vehicle is.
    fn join(&mut self, seen: &[Vec<Vec<TrackedFeature>>]) -> bool {
        let leading = self.calibration.leading();
        for (slot, by_camera) in seen.iter().enumerate() {
            for (camera, features) in by_camera.iter().enumerate().filter(|(camera, _)| *camera != leading) {
                features::observe(&mut self.features[camera], slot, features);
            }
        }
        self.calibration.cameras() > 1
    }

    /// Where the solution's world lies: at the origin, or where the window before a failure ended.
    fn world_of(&self, solution: &InitializationSolution) -> RigidTransform {
        let (Some(resume), Some(first)) = (&self.resume_at, solution.frames.first()) else {
            return RigidTransform::identity();
        };
        let yaw = |rotation: &UnitQuaternion<f64>| {
            let forward = rotation * Vector3::x();
            forward.y.atan2(forward.x)
        };
        let turn = yaw(&resume.rotation) - yaw(&first.world_from_imu.rotation);
        let rotation = so3::exp(&Vector3::new(0.0, 0.0, turn));
        RigidTransform::new(rotation, resume.translation_m - rotation * first.world_from_imu.translation_m)
    }

    /// Joint angles and chain that explain the mounts' rotations, between encoder readings and the rig's prior.
    fn fit_mounts(&mut self, mounts: &[RigidTransform]) {
        let joints = self.calibration.of(MAIN).joint_count();
        if joints == 0 || mounts.len() != self.frames.len() {
            return;
        }
        let dof = self.calibration.of(MAIN).dof();
        let total = dof + joints * mounts.len();
        let sigma = |slot: usize, joint: usize| -> f64 {
            self.frames[slot].encoder.as_ref().map_or(UNKNOWN_TURN_RAD, |encoder| encoder.sigmas_rad[joint])
        };
        let starts: Vec<Vec<f64>> = self.frames.iter().map(|frame| frame.state.joints_rad.clone()).collect();
        let mut angles = starts.clone();
        let mut calibration: Calibration = self.calibration.of(MAIN).clone();
        for _ in 0..10 {
            let mut hessian = DMatrix::zeros(total, total);
            let mut gradient = DVector::zeros(total);
            if dof > 0 {
                let rows = calibration.prior_jacobian();
                hessian.view_mut((0, 0), (dof, dof)).copy_from(&rows.tr_mul(&rows));
                gradient.rows_mut(0, dof).copy_from(&rows.tr_mul(&calibration.prior_residual()));
            }
            for (slot, mount) in mounts.iter().enumerate() {
                let chain = calibration.linearize(&angles[slot]);
                let error = so3::log(&(mount.rotation.inverse() * chain.imu_from_camera.rotation));
                let mut rows = DMatrix::zeros(3, total);
                let place = dof + joints * slot;
                rows.columns_mut(0, dof).copy_from(&chain.by_parameters.fixed_rows::<3>(0));
                rows.columns_mut(place, joints).copy_from(&chain.by_joints.fixed_rows::<3>(0));
                let rows = so3::right_jacobian_inverse(&error) * rows / MOUNT_FIT_SIGMA_RAD;
                hessian += rows.tr_mul(&rows);
                gradient += rows.tr_mul(&(error / MOUNT_FIT_SIGMA_RAD));
                for joint in 0..joints {
                    let weight = sigma(slot, joint).powi(-2);
                    hessian[(place + joint, place + joint)] += weight;
                    gradient[place + joint] += (angles[slot][joint] - starts[slot][joint]) * weight;
                }
            }
            let Some(factor) = hessian.cholesky() else { return };
            let step = -factor.solve(&gradient);
            calibration = calibration.stepped(&step.as_slice()[..dof]);
            for (slot, angles) in angles.iter_mut().enumerate() {
                for (joint, angle) in angles.iter_mut().enumerate() {
                    *angle += step[dof + joints * slot + joint];
                }
            }
            if step.amax() < 1e-6 {
                break;
            }
        }
        if angles.iter().flatten().all(|angle| angle.is_finite()) {
            for (frame, angles) in self.frames.iter_mut().zip(angles) {
                frame.state.joints_rad = angles;
            }
            *self.calibration.of_mut(MAIN) = calibration;
        }
    }
}

fn waits(reason: &WaitReason) -> Event {
    Event {
        kind: EventKind::InitializationWaits,
        message: reason.message.clone(),
        value: Some(reason.value),
        threshold: Some(reason.threshold),
    }
}

/// The longest time without an inertial sample between the last image and this one.
fn longest_hole_s(input: &StepInput<'_>, last_stamp_ns: i64) -> f64 {
    let stamps = std::iter::once(last_stamp_ns)
        .chain(input.imu.iter().map(|sample| sample.stamp_ns).filter(|stamp| *stamp > last_stamp_ns))
        .chain(std::iter::once(input.stamp_ns));
    let stamps: Vec<i64> = stamps.collect();
    stamps.windows(2).map(|pair| seconds_from_ns(pair[1] - pair[0])).fold(0.0, f64::max)
}
