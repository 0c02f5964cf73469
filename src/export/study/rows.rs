//! The rows of one job: its inputs, and the results of its run.

use super::folder::StudyTables;
use crate::estimator::{EventKind, FailureCause};
use crate::export::calibration_report::CalibrationReport;
use crate::export::summary::{Accuracy, RunSummary, TrajectorySummary};
use crate::geometry::{median, seconds_from_ns, so3};
use crate::session::{Recording, RunRecord, TrajectoryLane};
use crate::study::{Cell, JobLog, StudyJob, TableError, relative_error_columns};
use crate::text::Named as _;

/// How a job ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum JobStatus {
    /// It has results.
    Ok,
    /// It ran, and the estimator never initialized.
    NotInitialized,
    /// It ended with an error.
    Failed,
    /// It ended by a panic, or by a signal of a fault.
    Crashed,
    /// It was killed.
    Killed,
    /// It took longer than the plan allows, and was killed for that.
    Timeout,
}

impl JobStatus {
    /// Its text in the column `status`.
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

    /// Whether the job has run to its end.
    pub fn has_run(self) -> bool {
        matches!(self, Self::Ok | Self::NotInitialized)
    }
}

/// The files and the costs of a job.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JobCosts {
    /// SHA-256 of the log, where it is known.
    pub log_sha256: Option<String>,
    /// SHA-256 of the rig that was used.
    pub rig_sha256: Option<String>,
    /// Path of the log.
    pub log_path: String,
    /// Path of the rig, where it is not the log's own.
    pub rig_path: Option<String>,
    /// Path of the ground-truth rig, where it is not the log's own.
    pub truth_path: Option<String>,
    /// File of the trajectory, or its topic; `None` for a run.
    pub trajectory_path: Option<String>,
    /// Version and SHA-256 of the program.
    pub program: String,
    /// Number of times that the job was started.
    pub attempts: usize,
    /// Wall time in seconds.
    pub wall_s: f64,
    /// Largest resident memory.
    pub peak_memory_bytes: Option<u64>,
}

/// Cells of a row by column.
type Cells = Vec<(&'static str, Cell)>;

/// Inputs, status and costs of a job.
fn inputs(key: &str, job: &StudyJob, status: JobStatus, message: &str, costs: &JobCosts) -> Cells {
    let spec = job.subject.run();
    let (start_s, duration_s) = match &job.log {
        JobLog::Recorded(log) => (log.start_s, log.duration_s),
        JobLog::Simulated(flight) => (0.0, flight.recipe.duration_s),
    };
    let mut cells: Cells = pairing(key, job);
    cells.extend([
        ("study", job.study.as_str().into()),
        ("label", job.subject.label().into()),
        ("parameterization", spec.map(|spec| spec.parameterization.name()).into()),
        ("encoder", spec.map(|spec| spec.encoder).into()),
        ("calibrate", spec.map(|spec| spec.calibrate).into()),
        ("timeshift", spec.map(|spec| spec.timeshift).into()),
        ("readout", spec.map(|spec| spec.readout).into()),
        ("intrinsics", spec.map(|spec| spec.intrinsics).into()),
        ("imu_intrinsics", spec.map(|spec| spec.imu_intrinsics).into()),
        ("first_estimates", spec.map(|spec| spec.first_estimates).into()),
        ("window", spec.map(|spec| spec.window).into()),
        ("camera", spec.and_then(|spec| spec.camera_key.clone()).into()),
        ("status", status.name().into()),
        ("message", Some(message).filter(|text| !text.is_empty()).into()),
        ("attempts", costs.attempts.into()),
        ("log_sha256", costs.log_sha256.clone().into()),
        ("rig_sha256", costs.rig_sha256.clone().into()),
        ("log_path", costs.log_path.as_str().into()),
        ("rig_path", costs.rig_path.clone().into()),
        ("truth_path", costs.truth_path.clone().into()),
        ("trajectory_path", costs.trajectory_path.clone().into()),
        ("start_s", start_s.into()),
        ("duration_s", duration_s.into()),
        ("program", costs.program.as_str().into()),
        ("wall_s", costs.wall_s.into()),
        ("peak_memory_bytes", costs.peak_memory_bytes.and_then(|bytes| i64::try_from(bytes).ok()).into()),
    ]);
    cells
}

/// The key, and the columns by which runs are paired.
fn pairing(key: &str, job: &StudyJob) -> Cells {
    vec![
        ("key", key.into()),
        ("log", job.log.name().into()),
        ("disturbance", job.disturbance.as_str().into()),
        ("perturbation", job.perturbation.name.as_str().into()),
        ("seed", job.seed.and_then(|seed| i64::try_from(seed).ok()).into()),
        ("run", job.subject.to_string().into()),
    ]
}

/// The row of a job without results.
pub(super) fn failed_rows(
    key: &str,
    job: &StudyJob,
    status: JobStatus,
    message: &str,
    costs: &JobCosts,
) -> Result<StudyTables, TableError> {
    let mut tables = StudyTables::default();
    tables.runs.push(inputs(key, job, status, message, costs))?;
    Ok(tables)
}

/// The rows of a job with results; `offline` is the calibration that its rig comes from.
pub(super) fn run_rows(
    key: &str,
    job: &StudyJob,
    costs: &JobCosts,
    recording: &Recording,
    run: &RunRecord,
    summary: &RunSummary,
    offline: Option<&CalibrationReport>,
) -> Result<StudyTables, TableError> {
    let mut tables = StudyTables::default();
    let initialized = summary.frames.initialized_at_s.is_some();
    let status = if initialized { JobStatus::Ok } else { JobStatus::NotInitialized };
    let message = summary.accuracy_missing.as_deref().filter(|_| !initialized).unwrap_or_default();
    let mut cells = inputs(key, job, status, message, costs);
    cells.retain(|(name, _)| *name != "camera");
    cells.push(("camera", summary.camera.as_str().into()));
    cells.extend(frames_and_losses(recording, run, summary));
    cells.extend(accuracy(run, summary));
    cells.extend(calibration(summary));
    cells.extend(times(summary));
    cells.extend(offline.map(offline_calibration).unwrap_or_default());
    push_run(&mut tables, cells, summary.accuracy.as_ref())?;
    for parameter in &summary.calibration.parameters {
        let mut cells = pairing(key, job);
        cells.extend([
            ("parameter", parameter.name.as_str().into()),
            ("unit", parameter.dimension.unit().into()),
            ("initial", parameter.initial.into()),
            ("final", parameter.last.into()),
            ("sigma", parameter.sigma.into()),
            ("truth", parameter.ground_truth.into()),
            ("error", parameter.error.into()),
        ]);
        tables.parameters.push(cells)?;
    }
    Ok(tables)
}

/// The row of a trajectory of another program.
pub(super) fn trajectory_rows(
    key: &str,
    job: &StudyJob,
    costs: &JobCosts,
    lane: &TrajectoryLane,
) -> Result<StudyTables, TableError> {
    let mut tables = StudyTables::default();
    let summary = TrajectorySummary::of(lane);
    let mut cells = inputs(key, job, JobStatus::Ok, summary.accuracy_missing.as_deref().unwrap_or_default(), costs);
    cells.extend([("estimated", summary.poses.into()), ("length_m", summary.length_m.into())]);
    cells.extend(summary.accuracy.as_ref().map(absolute_errors).unwrap_or_default());
    let errors = (0..lane.evaluation.pairs.len()).filter_map(|pair| Some((pair, lane.evaluation.error_m(pair)?)));
    if let Some((pair, worst_m)) = errors.max_by(|a, b| a.1.total_cmp(&b.1)) {
        let worst_s = lane.evaluation.pairs[pair].0.stamp_s;
        cells.extend([("worst_frame_s", worst_s.into()), ("worst_frame_m", worst_m.into())]);
    }
    push_run(&mut tables, cells, summary.accuracy.as_ref())?;
    Ok(tables)
}

/// Adds the row of a run or of a trajectory, with its relative errors.
fn push_run(tables: &mut StudyTables, cells: Cells, accuracy: Option<&Accuracy>) -> Result<(), TableError> {
    let relative = relative_errors(accuracy);
    let relative = relative.iter().map(|(name, value)| (name.as_str(), Cell::from(*value)));
    tables.runs.push(cells.into_iter().chain(relative))
}

/// Counts of frames, failures by cause and warnings.
fn frames_and_losses(recording: &Recording, run: &RunRecord, summary: &RunSummary) -> Cells {
    let frames = &summary.frames;
    let events = run.steps.iter().flat_map(|step| &step.report.events);
    let failures: Vec<Option<FailureCause>> =
        events.filter(|event| event.kind == EventKind::Failure).map(|event| event.cause).collect();
    let losses =
        |cause: FailureCause| -> Cell { failures.iter().filter(|found| **found == Some(cause)).count().into() };
    vec![
        ("initialized_at_s", frames.initialized_at_s.into()),
        ("frames", frames.total.into()),
        ("estimated", frames.estimated.into()),
        ("keyframes", frames.keyframes.into()),
        ("length_m", frames.initialized_at_s.map(|_| summary.length_m).into()),
        ("restarts", frames.restarts.into()),
        ("loss_features", losses(FailureCause::Features)),
        ("loss_imu", losses(FailureCause::Imu)),
        ("loss_accelerometer_bias", losses(FailureCause::AccelerometerBias)),
        ("loss_gyroscope_bias", losses(FailureCause::GyroscopeBias)),
        ("loss_velocity", losses(FailureCause::Velocity)),
        ("loss_correction", losses(FailureCause::Correction)),
        ("lost_s", lost_s(run).into()),
        ("warnings", (recording.warnings.len() + run.warnings.len()).into()),
    ]
}

/// Time without a pose after the first one, in seconds; `None` without a pose.
fn lost_s(run: &RunRecord) -> Option<f64> {
    let first = run.steps.iter().position(|step| step.report.newest().is_some())?;
    let lost_ns: i64 = run.steps[first..]
        .windows(2)
        .filter(|pair| pair[1].report.newest().is_none())
        .map(|pair| pair[1].report.stamp_ns - pair[0].report.stamp_ns)
        .sum();
    Some(seconds_from_ns(lost_ns))
}

/// Absolute errors of a trajectory.
fn absolute_errors(accuracy: &Accuracy) -> Cells {
    vec![
        ("ate_rmse_m", accuracy.ate_rmse_m.into()),
        ("ate_mean_m", accuracy.ate_mean_m.into()),
        ("ate_median_m", accuracy.ate_median_m.into()),
        ("ate_max_m", accuracy.ate_max_m.into()),
        ("ate_percent", accuracy.ate_percent_of_length.into()),
    ]
}

/// Errors of the trajectory, consistency, and the worst frame.
fn accuracy(run: &RunRecord, summary: &RunSummary) -> Cells {
    let mut cells = summary.accuracy.as_ref().map(absolute_errors).unwrap_or_default();
    let samples = run.pose_consistency();
    let nees = samples.iter().map(|sample| sample.pose).sum::<f64>() / samples.len() as f64;
    cells.extend([("pose_nees", nees.into()), ("pose_nees_samples", samples.len().into())]);
    let estimated = || run.steps.iter().filter(|step| step.report.newest().is_some());
    let reprojections = estimated().map(|step| step.report.reprojection_rms_after_px).filter(|px| px.is_finite());
    cells.push(("reprojection_rms_px", median(reprojections).into()));
    cells.extend(worst_frame(run));
    cells
}

/// Relative errors by column.
fn relative_errors(accuracy: Option<&Accuracy>) -> Vec<(String, f64)> {
    let errors = accuracy.into_iter().flat_map(|accuracy| &accuracy.rpe);
    let columns = errors.flat_map(|over| {
        let values = [over.translation_rmse_m, over.rotation_rmse_deg.to_radians()];
        relative_error_columns(over.delta_m).into_iter().zip(values)
    });
    columns.collect()
}

/// The frame with the largest position error, or without ground truth with the largest reprojection RMS.
fn worst_frame(run: &RunRecord) -> Cells {
    let errors = position_errors(run);
    let by_error = errors.iter().filter_map(|(stamp_ns, error)| Some((*stamp_ns, error.map(|[error_m, _]| error_m)?)));
    let reprojections = || {
        let estimated = run.steps.iter().filter(|step| step.report.newest().is_some());
        estimated.map(|step| (step.report.stamp_ns, step.report.reprojection_rms_after_px))
    };
    let largest = |values: &mut dyn Iterator<Item = (i64, f64)>| {
        values.filter(|(_, value)| value.is_finite()).max_by(|a, b| a.1.total_cmp(&b.1))
    };
    let worst = largest(&mut by_error.into_iter());
    let Some((stamp_ns, _)) = worst.or_else(|| largest(&mut reprojections())) else { return Vec::new() };
    let px = reprojections().find(|(stamp, _)| *stamp == stamp_ns).map(|(_, px)| px);
    vec![
        ("worst_frame_s", seconds_from_ns(stamp_ns).into()),
        ("worst_frame_m", worst.map(|(_, error_m)| error_m).into()),
        ("worst_frame_px", px.into()),
    ]
}

/// Position error in metres and angle in radians of every step by stamp, after the alignment of the whole run; `None` where
/// there is no pose or no ground truth.
pub(super) fn position_errors(run: &RunRecord) -> Vec<(i64, Option<[f64; 2]>)> {
    let error_of = |step: &crate::session::StepRecord| {
        let (alignment, truth) = (run.alignment?, step.ground_truth?);
        let aligned = alignment * step.report.newest()?.world_from_imu;
        let turn = so3::log(&(truth.rotation.inverse() * aligned.rotation));
        Some([(aligned.translation_m - truth.translation_m).norm(), turn.norm()])
    };
    run.steps.iter().map(|step| (step.report.stamp_ns, error_of(step))).collect()
}

/// Calibration and ranks.
fn calibration(summary: &RunSummary) -> Cells {
    let calibration = &summary.calibration;
    let mut cells: Cells = vec![
        ("final_parameterization", calibration.parameterization.as_str().into()),
        ("columns", calibration.columns.into()),
        ("parameter_error_sigma", calibration.parameter_error_sigma().into()),
    ];
    if let Some(error) = &calibration.chain_error_initial {
        cells.push(("chain_error_initial_m", error.translation_mean_m.into()));
        cells.push(("chain_error_initial_rad", error.rotation_mean_rad.into()));
    }
    if let Some(error) = &calibration.chain_error {
        cells.push(("chain_error_m", error.translation_mean_m.into()));
        cells.push(("chain_error_rad", error.rotation_mean_rad.into()));
    }
    if let Some(rank) = &summary.rank {
        cells.extend([
            ("rank_structural", rank.rank_structural.into()),
            ("rank_informed", rank.rank_informed.into()),
            ("deficit_parameterization", rank.deficit.parameterization.into()),
            ("deficit_joints", rank.deficit.joints.into()),
            ("deficit_absorbed", rank.deficit.absorbed.into()),
            ("deficit_motion", rank.deficit.motion.into()),
        ]);
    }
    cells
}

/// Residuals of the offline calibration, and the error of its first stage.
fn offline_calibration(report: &CalibrationReport) -> Cells {
    let mut cells: Cells = vec![("offline_static_alone_px", report.camera_imu_reprojection.error_px.mean.into())];
    for (column, camera) in ["offline_static_px", "offline_gimbal_px"].into_iter().zip(&report.reprojection) {
        cells.push((column, camera.error_px.mean.into()));
    }
    if let Some(truth) = &report.ground_truth {
        let error = &truth.static_camera_imu;
        cells.push(("offline_static_alone_error_m", error.translation_mean_m.into()));
        cells.push(("offline_static_alone_error_rad", error.rotation_mean_rad.into()));
    }
    cells
}

/// Times of the stages.
fn times(summary: &RunSummary) -> Cells {
    let mut cells: Cells = vec![("real_time_factor", summary.real_time_factor.into())];
    if let Some(timing) = &summary.timing_ms {
        cells.extend([
            ("frontend_ms", timing.frontend.p50.into()),
            ("optimize_ms", timing.optimize.p50.into()),
            ("linearize_ms", timing.linearize.p50.into()),
            ("report_ms", timing.report.p50.into()),
            ("marginalize_ms", timing.marginalize.p50.into()),
            ("observability_ms", timing.observability.p50.into()),
            ("step_ms", timing.step.p50.into()),
            ("step_p95_ms", timing.step.p95.into()),
        ]);
    }
    cells
}

/// Adds one row per step to the table of frames.
pub(super) fn add_frames(tables: &mut StudyTables, key: &str, run: &RunRecord) -> Result<(), TableError> {
    for (step, (_, error)) in run.steps.iter().zip(position_errors(run)) {
        let report = &step.report;
        let newest = report.newest();
        let position = |axis: usize| -> Cell { newest.map(|frame| frame.world_from_imu.translation_m[axis]).into() };
        let rms_px = newest.map(|_| report.reprojection_rms_after_px);
        tables.frames.push([
            ("key", key.into()),
            ("frame", report.frame_index.into()),
            ("t_s", seconds_from_ns(report.stamp_ns).into()),
            ("estimated", newest.is_some().into()),
            ("keyframe", report.keyframe.into()),
            ("x_m", position(0)),
            ("y_m", position(1)),
            ("z_m", position(2)),
            ("position_error_m", error.map(|[error_m, _]| error_m).into()),
            ("rotation_error_rad", error.map(|[_, angle_rad]| angle_rad).into()),
            ("reprojection_rms_px", rms_px.into()),
            ("tracked", step.tracks.features.len().into()),
            ("rank_structural", step.rank.as_ref().map(|rank| rank.rank_structural).into()),
            ("rank_informed", step.rank.as_ref().map(|rank| rank.rank_informed).into()),
            ("step_ms", report.times.step_ms.into()),
        ])?;
    }
    Ok(())
}
