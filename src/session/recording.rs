use std::path::PathBuf;
use std::sync::Arc;

use super::RunSpec;
use crate::estimator::StepReport;
use crate::flight_log::{LogWarning, Rig};
use crate::frontend::TrackedFrame;
use crate::geometry::RigidTransform;
use crate::observability::RankReport;

/// One step of one run with what it was computed from.
#[derive(Clone, Debug)]
pub struct StepRecord {
    /// The estimator's report; its `linearization` has been analysed and dropped.
    pub report: StepReport,
    /// Observability of the calibration in this step, `None` while initializing.
    pub rank: Option<RankReport>,
    /// The tracks the step was given.
    pub tracks: Arc<TrackedFrame>,
    /// True pose of the IMU, for drawing and comparing.
    pub truth: Option<RigidTransform>,
    /// Log time of the image since the log began, beside the report's header stamp.
    pub log_time_ns: i64,
}

/// One run: an estimator over the log, and all its steps so far in time order.
#[derive(Clone, Debug)]
pub struct RunRecord {
    /// What was asked for; its `label` is the run's name on screen.
    pub spec: RunSpec,
    /// Key of the camera it watches (`cam0`).
    pub camera_key: String,
    /// Steps in time order.
    pub steps: Vec<Arc<StepRecord>>,
    /// Whether the log's end has been reached.
    pub finished: bool,
    /// Why it ended early, when it did.
    pub error: Option<String>,
    /// `true_from_estimate`: the yaw and translation that lay the estimated trajectory on the truth, once there are
    /// enough frames with truth.
    pub alignment: Option<RigidTransform>,
}

impl RunRecord {
    /// The last step at or before a time, as a cursor shows it.
    pub fn step_at(&self, stamp_ns: i64) -> Option<&Arc<StepRecord>> {
        let after = self.steps.partition_point(|step| step.report.stamp_ns <= stamp_ns);
        after.checked_sub(1).and_then(|index| self.steps.get(index))
    }
}

/// Everything computed so far about one log.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Where the log lies.
    pub log_path: PathBuf,
    /// The rig the runs were given.
    pub rig: Arc<Rig>,
    /// The rig with the true values, when known.
    pub truth_rig: Option<Arc<Rig>>,
    /// Length of the log in nanoseconds.
    pub duration_ns: i64,
    /// Absolute header stamp of the log's begin, in nanoseconds since the epoch.
    pub epoch_ns: i64,
    /// Runs in the order they were asked for.
    pub runs: Vec<RunRecord>,
    /// What is wrong with the log, as found so far.
    pub warnings: Vec<LogWarning>,
}
