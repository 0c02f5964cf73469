//! A job that has ended: what its rows are made from.

use crate::estimator::{EventKind, FailureCause};
use crate::geometry::{median, seconds_from_ns};
use crate::session::{
    CalibrationRun, PoseConsistency, RankSummary, Recording, RelativeAccuracy, RunRecord, RunSpec, RunSummary,
    TimingSummary, TrajectoryAccuracy, TrajectoryLane,
};
use crate::study::StudyJob;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum JobStatus {
    Ok,
    /// The estimator never initialized.
    NotInitialized,
    /// The job ended with an error.
    Failed,
    /// The job ended by a panic, or by a signal of a fault.
    Crashed,
    Killed,
    /// The job exceeded the plan's time limit and was killed.
    Timeout,
}

impl JobStatus {
    /// Text in the column `status`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::NotInitialized => "not-initialized",
            Self::Failed => "failed",
            Self::Crashed => "crashed",
            Self::Killed => "killed",
            Self::Timeout => "timeout",
        }
    }
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct JobCosts {
    /// SHA-256 of the log, if it is known.
    pub log_sha256: Option<String>,
    /// SHA-256 of the rig that was used.
    pub rig_sha256: Option<String>,
    pub log_path: String,
    /// Path of the rig, `None` for the default rig of the log.
    pub rig_path: Option<String>,
    /// Path of the ground-truth rig, `None` for the default one of the log.
    pub truth_path: Option<String>,
    /// File of the trajectory, or its topic; `None` for a run.
    pub trajectory_path: Option<String>,
    /// Version and SHA-256 of the program.
    pub program: String,
    /// Number of times that the job was started.
    pub attempts: usize,
    pub wall_s: f64,
    /// Largest resident memory in bytes.
    pub peak_memory_bytes: Option<u64>,
}

/// A job that has ended, with its run or its trajectory where it has a result.
#[derive(Clone, Debug)]
pub struct JobResult<'a> {
    pub key: &'a str,
    pub job: &'a StudyJob,
    pub status: JobStatus,
    /// Reason for a missing result; empty with a result.
    pub message: &'a str,
    pub costs: &'a JobCosts,
    pub run: Option<RunResult<'a>>,
    /// The evaluated trajectory of another program.
    pub trajectory: Option<&'a TrajectoryLane>,
}

#[derive(Clone, Debug)]
pub struct RunResult<'a> {
    pub recording: &'a Recording,
    pub record: &'a RunRecord,
    pub summary: &'a RunSummary,
    /// [`RunRecord::pose_consistency`] of the run.
    pub consistency: &'a [PoseConsistency],
    /// The offline calibration that its rig comes from.
    pub offline: Option<&'a CalibrationRun>,
}

/// The frame with the largest position error, or without ground truth with the largest reprojection RMS.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct WorstFrame {
    /// Stamp in seconds since the log began.
    pub(super) at_s: f64,
    pub(super) error_m: Option<f64>,
    /// Reprojection RMS after the solve.
    pub(super) reprojection_px: Option<f64>,
}

impl JobResult<'_> {
    pub(super) fn seed(&self) -> Option<usize> {
        self.job.seed.and_then(|seed| usize::try_from(seed).ok())
    }

    pub(super) fn spec(&self) -> Option<&RunSpec> {
        self.job.subject.run()
    }

    pub(super) fn summary(&self) -> Option<&RunSummary> {
        Some(self.run.as_ref()?.summary)
    }

    pub(super) fn rank(&self) -> Option<&RankSummary> {
        self.summary()?.rank.as_ref()
    }

    pub(super) fn timing(&self) -> Option<&TimingSummary> {
        self.summary()?.timing_ms.as_ref()
    }

    pub(super) fn accuracy(&self) -> Option<&TrajectoryAccuracy> {
        let of_trajectory = || self.trajectory?.evaluation.accuracy.as_ref();
        self.summary().map_or_else(of_trajectory, |summary| summary.accuracy.as_ref())
    }

    pub(super) fn relative(&self, delta_m: f64) -> Option<&RelativeAccuracy> {
        self.accuracy()?.rpe.iter().find(|over| over.delta_m == delta_m)
    }

    pub(super) fn offline(&self) -> Option<&CalibrationRun> {
        self.run.as_ref()?.offline
    }

    pub(super) fn worst_frame(&self) -> Option<WorstFrame> {
        self.run.as_ref().map_or_else(|| worst_pair(self.trajectory?), RunResult::worst_frame)
    }
}

impl RunResult<'_> {
    pub(super) fn failures(&self, cause: FailureCause) -> usize {
        let events = self.record.steps.iter().flat_map(|step| &step.report.events);
        events.filter(|event| event.kind == EventKind::Failure && event.cause == Some(cause)).count()
    }

    /// Time without a pose after the first one, in seconds; `None` without a pose.
    pub(super) fn lost_s(&self) -> Option<f64> {
        let steps = &self.record.steps;
        let first = steps.iter().position(|step| step.report.newest().is_some())?;
        let lost_ns: i64 = steps[first..]
            .windows(2)
            .filter(|pair| pair[1].report.newest().is_none())
            .map(|pair| pair[1].report.stamp_ns - pair[0].report.stamp_ns)
            .sum();
        Some(seconds_from_ns(lost_ns))
    }

    /// Mean squared error over covariance of the poses; `None` without a sample.
    pub(super) fn pose_nees(&self) -> Option<f64> {
        let sum = self.consistency.iter().map(|sample| sample.pose).sum::<f64>();
        (!self.consistency.is_empty()).then(|| sum / self.consistency.len() as f64)
    }

    /// Median over the frames of the reprojection RMS after the solve.
    pub(super) fn reprojection_rms_px(&self) -> Option<f64> {
        median(self.reprojections().map(|(_, px)| px).filter(|px| px.is_finite()))
    }

    /// Stamp and reprojection RMS after the solve of every frame with a pose.
    fn reprojections(&self) -> impl Iterator<Item = (i64, f64)> {
        let estimated = self.record.steps.iter().filter(|step| step.report.newest().is_some());
        estimated.map(|step| (step.report.stamp_ns, step.report.reprojection_rms_after_px))
    }

    fn worst_frame(&self) -> Option<WorstFrame> {
        let largest = |values: &mut dyn Iterator<Item = (i64, f64)>| {
            values.filter(|(_, value)| value.is_finite()).max_by(|a, b| a.1.total_cmp(&b.1))
        };
        let errors = self.record.steps.iter().filter_map(|step| {
            let [error_m, _] = self.record.aligned_error(step)?;
            Some((step.report.stamp_ns, error_m))
        });
        let worst = largest(&mut { errors });
        let (stamp_ns, _) = worst.or_else(|| largest(&mut self.reprojections()))?;
        Some(WorstFrame {
            at_s: seconds_from_ns(stamp_ns),
            error_m: worst.map(|(_, error_m)| error_m),
            reprojection_px: self.reprojections().find(|(stamp, _)| *stamp == stamp_ns).map(|(_, px)| px),
        })
    }
}

/// The pose of a trajectory with the largest position error.
fn worst_pair(lane: &TrajectoryLane) -> Option<WorstFrame> {
    let evaluation = &lane.evaluation;
    let errors = (0..evaluation.pairs.len()).filter_map(|pair| Some((pair, evaluation.error_m(pair)?)));
    let (pair, worst_m) = errors.max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(WorstFrame { at_s: evaluation.pairs[pair].0.stamp_s, error_m: Some(worst_m), reprojection_px: None })
}
