use std::sync::Arc;

use super::recording::StepRecord;
use super::stopwatch::Stopwatch;
use super::tracker::TrackedSensorFrame;
use crate::estimator::{Estimator, EstimatorConfig, StepInput};

/// One estimator and the analysis of each of its steps.
#[derive(Clone, Debug)]
pub struct RunEngine {
    estimator: Estimator,
    has_joints: bool,
}

impl RunEngine {
    /// A fresh estimator.
    pub fn new(config: EstimatorConfig) -> Self {
        let has_joints = !config.chain.links.is_empty();
        Self { estimator: Estimator::new(config), has_joints }
    }

    /// One image through the estimator and the observability analysis.
    pub fn step(&mut self, tracked: &TrackedSensorFrame) -> StepRecord {
        let frame = &tracked.frame;
        let watch = Stopwatch::start();
        let mut report = self.estimator.step(&StepInput {
            frame_index: frame.index,
            stamp_ns: frame.stamp_ns,
            imu: &frame.imu,
            joint_angles_rad: frame.joint_angles_rad.as_deref().filter(|_| self.has_joints),
            tracks: &tracked.tracks,
        });
        // One linearization a frame would fill the memory.
        report.linearization = None;
        report.times.frontend_ms = tracked.frontend_ms;
        report.times.step_ms = tracked.frontend_ms + watch.elapsed_ms();
        StepRecord {
            report,
            rank: None,
            tracks: Arc::clone(&tracked.tracks),
            truth: frame.truth,
            log_time_ns: frame.log_time_ns,
        }
    }
}
