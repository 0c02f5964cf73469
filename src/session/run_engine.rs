use std::sync::Arc;

use super::recording::StepRecord;
use super::stopwatch::Stopwatch;
use super::tracker::TrackedSensorFrame;
use crate::estimator::{Estimator, EstimatorConfig, StepInput, StepReport};
use crate::gimbal::Chain;
use crate::observability::{RankReport, analyse};

/// One estimator and the analysis of each of its steps.
#[derive(Clone, Debug)]
pub(super) struct RunEngine {
    estimator: Estimator,
    has_joints: bool,
    joints_free: bool,
}

impl RunEngine {
    /// A fresh estimator.
    pub(super) fn new(config: EstimatorConfig) -> Self {
        let has_joints = !config.chain.links.is_empty();
        let joints_free = has_joints && !config.use_encoder;
        Self { estimator: Estimator::new(config), has_joints, joints_free }
    }

    /// One image through the estimator and the observability analysis.
    pub(super) fn step(&mut self, tracked: &TrackedSensorFrame) -> StepRecord {
        let frame = &tracked.frame;
        let watch = Stopwatch::start();
        let mut report = self.estimator.step(&StepInput {
            frame_index: frame.index,
            stamp_ns: frame.stamp_ns,
            imu: &frame.imu,
            joint_angles: frame.joint_angles.as_ref().filter(|_| self.has_joints),
            tracks: &tracked.tracks,
        });
        let estimated_ms = watch.elapsed_ms();
        let rank = self.rank(&mut report);
        report.times.observability_ms = watch.elapsed_ms() - estimated_ms;
        report.times.frontend_ms = tracked.frontend_ms;
        report.times.step_ms = tracked.frontend_ms + watch.elapsed_ms();
        StepRecord {
            report,
            rank,
            tracks: Arc::clone(&tracked.tracks),
            truth: frame.truth,
            log_time_ns: frame.log_time_ns,
        }
    }

    /// Analyses the step's linearization and lets go of it: one a frame would fill the memory.
    fn rank(&self, report: &mut StepReport) -> Option<RankReport> {
        let linearization = report.linearization.take()?;
        let angles: Vec<&[f64]> = report.window.iter().map(|frame| frame.joint_angles_rad.as_slice()).collect();
        let calibration = &report.calibration;
        let parameterization = calibration.parameterization.parse().ok()?;
        let chain = Chain::from_classical(&calibration.classical, parameterization);
        let chain = if chain.dof() == calibration.names.len() { chain } else { chain.without_joint_offsets() };
        analyse(&linearization, &chain, &angles, self.joints_free)
    }
}
