use std::sync::Arc;

use super::instants::Instant;
use super::recording::StepRecord;
use super::stopwatch::Stopwatch;
use crate::estimator::{Estimator, EstimatorConfig, StepInput, StepReport};
use crate::frontend::TrackedFrame;
use crate::gimbal::Chain;
use crate::observability::{RankReport, analyse};

/// Columns of a rigid camera beside the main one: its pose on the IMU.
const RIGID_COLUMNS: usize = 6;

/// One estimator and the analysis of each of its steps.
#[derive(Clone, Debug)]
pub(super) struct RunEngine {
    estimator: Estimator,
    has_joints: bool,
    joints_free: bool,
    /// What a camera without an image has seen.
    nothing: Arc<TrackedFrame>,
    /// One report in so many frames keeps its linearization.
    keep_linearization_every: Option<usize>,
}

impl RunEngine {
    /// A fresh estimator.
    pub(super) fn new(config: EstimatorConfig, keep_linearization_every: Option<usize>) -> Self {
        let has_joints = !config.chain.links.is_empty();
        let joints_free = has_joints && !config.use_encoder;
        let estimator = Estimator::new(config);
        Self { estimator, has_joints, joints_free, nothing: Arc::default(), keep_linearization_every }
    }

    /// The images of one instant through the estimator and the observability analysis.
    pub(super) fn step(&mut self, instant: &Instant) -> StepRecord {
        let tracks = |camera: usize| instant.tracks(camera).unwrap_or(&self.nothing);
        let main = Arc::clone(tracks(0));
        let rigid: Vec<Arc<TrackedFrame>> = (1..instant.cameras()).map(|camera| Arc::clone(tracks(camera))).collect();
        let rigid: Vec<&TrackedFrame> = rigid.iter().map(Arc::as_ref).collect();
        let watch = Stopwatch::start();
        let mut report = self.estimator.step(&StepInput {
            frame_index: instant.frame_index(),
            stamp_ns: instant.stamp_ns(),
            imu: instant.imu(),
            joint_angles: instant.joint_angles().filter(|_| self.has_joints),
            tracks: &main,
            rigid_tracks: &rigid,
        });
        let estimated_ms = watch.elapsed_ms();
        let rank = self.rank(&mut report);
        report.times.observability_ms = watch.elapsed_ms() - estimated_ms;
        report.times.frontend_ms = instant.frontend_ms();
        report.times.step_ms = instant.frontend_ms() + watch.elapsed_ms();
        StepRecord { report, rank, tracks: main, truth: instant.truth(), log_time_ns: instant.log_time_ns() }
    }

    /// Analyses the step's linearization and lets go of it unless it is to be kept: one a frame would fill the memory.
    fn rank(&self, report: &mut StepReport) -> Option<RankReport> {
        let linearization = report.linearization.take()?;
        let angles: Vec<&[f64]> = report.window.iter().map(|frame| frame.joint_angles_rad.as_slice()).collect();
        let calibration = &report.calibration;
        let parameterization = calibration.parameterization.parse().ok()?;
        let chain = Chain::from_classical(&calibration.classical, parameterization);
        let rigid = RIGID_COLUMNS * calibration.rigid_cameras.len();
        let chain = if chain.dof() + rigid == calibration.names.len() { chain } else { chain.without_joint_offsets() };
        let rank = analyse(&linearization, &chain, &angles, self.joints_free);
        let kept = self.keep_linearization_every.is_some_and(|every| report.frame_index.is_multiple_of(every));
        report.linearization = kept.then_some(linearization);
        rank
    }
}
