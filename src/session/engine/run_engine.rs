use std::borrow::Cow;
use std::sync::Arc;

use super::altered_measurements::AlteredMeasurements;
use super::shifted_imu::ShiftedImu;
use super::step_inputs::{InputImage, OwnedStepInput};
use super::stopwatch::Stopwatch;
use crate::estimator::{Estimator, EstimatorConfig, PackedEstimator, StepInput, StepMeasurements, StepReport};
use crate::frontend::TrackedFrame;
use crate::gimbal::{Chain, ParameterGroup, ParameterId};
use crate::observability::{RankReport, analyse};
use crate::session::record::StepRecord;

/// Jacobian columns of the extrinsics of a further camera.
const POSE_COLUMNS: usize = 6;

/// An estimator with the observability analysis of its steps.
#[derive(Clone, Debug)]
pub(in crate::session) struct RunEngine {
    estimator: Estimator,
    settings: EngineSettings,
}

/// Constant settings of an engine.
#[derive(Clone, Debug)]
struct EngineSettings {
    has_joints: bool,
    joints_free: bool,
    /// Every n-th report keeps its linearization; `None` keeps none.
    keep_linearization_every: Option<usize>,
    altered_measurements: AlteredMeasurements,
    /// IMU samples of a fork with another time offset of its cameras.
    shifted_imu: ShiftedImu,
}

/// A snapshot of a [`RunEngine`] with a packed estimator.
#[derive(Clone, Debug)]
pub(super) struct PackedEngine {
    estimator: PackedEstimator,
    settings: EngineSettings,
}

impl PackedEngine {
    /// Restores the engine; `past` are the steps that it was packed with.
    pub(super) fn unpacked(&self, past: &[Arc<OwnedStepInput>]) -> RunEngine {
        RunEngine { estimator: self.estimator.unpacked(&measurements(past)), settings: self.settings.clone() }
    }

    pub(super) fn bytes(&self) -> usize {
        size_of::<Self>() - size_of::<PackedEstimator>() + self.estimator.bytes()
    }
}

fn measurements(past: &[Arc<OwnedStepInput>]) -> Vec<&dyn StepMeasurements> {
    past.iter().map(|step| &**step as &dyn StepMeasurements).collect()
}

impl RunEngine {
    /// An engine whose estimator is not initialized yet.
    pub(in crate::session) fn new(config: EstimatorConfig, keep_linearization_every: Option<usize>) -> Self {
        let has_joints = !config.chain.links.is_empty();
        let joints_free = has_joints && !config.use_encoder;
        let estimator = Estimator::new(config);
        let settings = EngineSettings {
            has_joints,
            joints_free,
            keep_linearization_every,
            altered_measurements: AlteredMeasurements::default(),
            shifted_imu: ShiftedImu::default(),
        };
        Self { estimator, settings }
    }

    /// The estimator, for changes between two steps.
    pub(in crate::session) fn estimator_mut(&mut self) -> &mut Estimator {
        &mut self.estimator
    }

    pub(in crate::session) fn estimator(&self) -> &Estimator {
        &self.estimator
    }

    pub(in crate::session) fn cameras(&self) -> usize {
        1 + self.estimator.config().further_cameras.len()
    }

    /// Keys of the estimator's cameras; `main` is the key of the main camera.
    pub(in crate::session) fn camera_keys(&self, main: &str) -> Vec<String> {
        let rigid = self.estimator.config().further_cameras.iter().map(|camera| camera.key.clone());
        std::iter::once(main.to_owned()).chain(rigid).collect()
    }

    /// Adds changes of a fork to the measurements.
    pub(super) fn alter(&mut self, changes: AlteredMeasurements) {
        self.settings.altered_measurements.add(changes);
    }

    /// Runs one step of the estimator and the observability analysis.
    pub(in crate::session) fn step(&mut self, input: &OwnedStepInput) -> StepRecord {
        let watch = Stopwatch::start();
        let mut report = self.estimate(input);
        let estimated_ms = watch.elapsed_ms();
        let rank = self.rank(&mut report);
        report.times.observability_ms = watch.elapsed_ms() - estimated_ms;
        report.times.frontend_ms = input.frontend_ms;
        report.times.step_ms = input.frontend_ms + watch.elapsed_ms();
        input.record(report, rank)
    }

    /// Runs the same step without the observability analysis; the estimator ends in the same state.
    pub(in crate::session) fn step_without_rank(&mut self, input: &OwnedStepInput) {
        let keep = self.estimator.config().options.keep_linearization;
        self.estimator.set_keep_linearization(false);
        drop(self.estimate(input));
        self.estimator.set_keep_linearization(keep);
    }

    /// Runs the same step without the observability analysis and returns the estimator's report.
    pub(in crate::session) fn report_without_rank(&mut self, input: &OwnedStepInput) -> StepReport {
        self.estimator.set_keep_linearization(false);
        self.estimate(input)
    }

    /// Limits the iterations of the solver from the next step on.
    pub(in crate::session) fn set_iterations(&mut self, iterations: usize) {
        self.estimator.set_iterations(iterations);
    }

    /// Snapshot of the engine; `past` are the steps before the next one, the newest last.
    pub(super) fn packed(&self, past: &[Arc<OwnedStepInput>]) -> PackedEngine {
        PackedEngine { estimator: self.estimator.packed(&measurements(past)), settings: self.settings.clone() }
    }

    fn estimate(&mut self, input: &OwnedStepInput) -> StepReport {
        let unread = self.settings.altered_measurements.corrections.begin_step(input.stamp_ns);
        let alterations = &self.settings.altered_measurements;
        let altered: Vec<Cow<'_, TrackedFrame>> = input
            .images
            .iter()
            .enumerate()
            .map(|(camera, InputImage { tracks, .. })| {
                let altered = alterations.tracks(camera, tracks).map_or(Cow::Borrowed(&**tracks), Cow::Owned);
                let partner = self.estimator.config().partner(camera);
                if partner.is_some_and(|partner| alterations.is_disabled(partner)) && !altered.matched.is_empty() {
                    return Cow::Owned(TrackedFrame { matched: Vec::new(), ..altered.into_owned() });
                }
                altered
            })
            .collect();
        let further: Vec<&TrackedFrame> = altered.iter().skip(1).map(Cow::as_ref).collect();
        let read = self.settings.has_joints && !unread && !self.settings.altered_measurements.encoder_off();
        let angles = input.joint_angles.as_ref().filter(|_| read);
        let noisy = angles.and_then(|angles| self.settings.altered_measurements.joint_angles(angles, input.stamp_ns));
        let corrections = &self.settings.altered_measurements.corrections;
        let (mut imu, mut imu_after) = (Cow::Borrowed(&*input.imu), Cow::Borrowed(&*input.imu_after));
        let shift_ns = corrections.camera_shift_ns();
        if shift_ns != 0 {
            let (cut, cut_after) = self.settings.shifted_imu.cut(&imu, &imu_after, shift_ns);
            (imu, imu_after) = (Cow::Owned(cut), Cow::Owned(cut_after));
        }
        if let (Some(corrected), Some(corrected_after)) = (corrections.imu(&imu), corrections.imu(&imu_after)) {
            (imu, imu_after) = (Cow::Owned(corrected), Cow::Owned(corrected_after));
        }
        // A shifted camera has other intervals than the samples of the IMU on the gimbal.
        let gimbal_imu = if shift_ns == 0 { input.gimbal_imu.as_slice() } else { &[] };
        self.estimator.step(&StepInput {
            frame_index: input.frame_index,
            stamp_ns: input.stamp_ns,
            imu: &imu,
            imu_after: &imu_after,
            image_times_s: &input.image_times_s,
            gimbal_imu,
            joint_angles: noisy.as_ref().or(angles),
            tracks: &altered[0],
            further_tracks: &further,
        })
    }

    /// Analyses the step's linearization and drops it unless it is to be kept, because linearizations take much memory.
    fn rank(&self, report: &mut StepReport) -> Option<RankReport> {
        let linearization = report.linearization.take()?;
        let angles: Vec<&[f64]> = report.window.iter().map(|frame| frame.joint_angles_rad.as_slice()).collect();
        let calibration = &report.calibration;
        let chain = Chain::from_classical(&calibration.classical, calibration.parameterization);
        let further = POSE_COLUMNS * calibration.further_cameras.len();
        let is_of_chain = |parameter: &&ParameterId| parameter.group() == ParameterGroup::Chain;
        let chain_columns = calibration.parameters.iter().filter(is_of_chain).count();
        let chain = if chain.dof() + further == chain_columns { chain } else { chain.without_joint_offsets() };
        // In a fork without encoders, frames of the window may still have encoder readings that the parent used.
        let unread = || report.window.iter().all(|frame| frame.encoder_angles_rad.is_none());
        let joints_free = self.settings.joints_free
            || self.settings.has_joints && self.settings.altered_measurements.encoder_off() && unread();
        let rank = analyse(&linearization, &chain, &angles, joints_free);
        let kept = self.settings.keep_linearization_every.is_some_and(|every| report.frame_index.is_multiple_of(every));
        report.linearization = kept.then_some(linearization);
        rank
    }
}
