//! One job: the estimator on its log with its rig, and the rows of its result.

use crate::files::RigFile as _;
use crate::flight_log::RigOfLog as _;
use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use super::error::StudyFileError;
use super::folder::StudyFolder;
use super::inputs::rig_sha256;
use crate::calibration::CalibrationOptions;
use crate::export::ExportError;
use crate::export::calibration_files::{STATIC_TRAJECTORY, TRAJECTORY, write_calibration};
use crate::export::calibration_report::report_calibration;
use crate::export::masks;
use crate::export::run_files::{RunFileOptions, write_run};
use crate::files::output::OutputSet;
use crate::flight_log::{FlightLog, LogError};
use crate::sensors::Rig;
use crate::session::{
    self, CalibrationRequest, CalibrationRun, CalibrationRunError, Recording, RunSpec, SessionError, SessionPlan,
    SessionRequest, Stopwatch, TrajectorySource, TrajectorySpec, summarize,
};
use crate::study::{
    Bundle, JobCosts, JobLog, JobResult, JobStatus, JobSubject, KeyedJob, PerturbationStart, RunResult, StudyJob,
    StudyOutput, StudyTables,
};
use crate::text::Named as _;

/// Number of frames between two samples of the consistency of poses: about the length of a window, so that samples have
/// few common measurements.
const CONSISTENCY_EVERY: usize = 30;
/// Memory budget of the record of a job in bytes: beyond it only the summaries of steps are kept, from which the rows
/// are made.
const RECORD_BYTES: usize = 64 << 20;

/// Reason why a job has no result.
#[derive(Debug, thiserror::Error)]
pub enum JobError {
    /// The log cannot be opened, or has no camera for the run.
    #[error(transparent)]
    Session(#[from] SessionError),
    #[error(transparent)]
    File(Box<StudyFileError>),
    /// The files of the run could not be written.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// The offline calibration for the job's rig failed.
    #[error(transparent)]
    Calibration(Box<CalibrationRunError>),
    #[error(transparent)]
    Log(#[from] LogError),
    /// The estimator stopped early.
    #[error("{0}")]
    Estimator(String),
    #[error("the flight of the job is not rendered: {}", .0.display())]
    NoFlight(PathBuf),
    #[error("no image of the log could be used; reasons: 'dcvins check {}'", .0.display())]
    NoImage(PathBuf),
}

impl From<CalibrationRunError> for JobError {
    fn from(error: CalibrationRunError) -> Self {
        Self::Calibration(Box::new(error))
    }
}

impl From<StudyFileError> for JobError {
    fn from(error: StudyFileError) -> Self {
        Self::File(Box::new(error))
    }
}

struct JobFiles {
    log: PathBuf,
    rig: Option<PathBuf>,
    truth: Option<PathBuf>,
}

/// A job while it is executed.
struct Execution<'a> {
    key: &'a str,
    job: &'a StudyJob,
    files: JobFiles,
    log_sha256: String,
    program: &'a str,
    attempts: usize,
    output: StudyOutput,
    stopwatch: Stopwatch,
}

impl Execution<'_> {
    /// Session on the log of the job, without runs and trajectories.
    fn request(&self) -> SessionRequest {
        let (start_s, duration_s) = span(self.job);
        SessionRequest {
            log_path: self.files.log.clone(),
            rig_path: self.files.rig.clone(),
            ground_truth_path: self.files.truth.clone(),
            start_s,
            duration_s,
            ..SessionRequest::default()
        }
    }
}

impl StudyFolder {
    fn files_of(&self, job: &StudyJob) -> JobFiles {
        match &job.log {
            JobLog::Recorded(log) => JobFiles { log: log.path.clone(), rig: log.rig.clone(), truth: log.truth.clone() },
            JobLog::Simulated(flight) => JobFiles { log: self.flight_log(flight), rig: None, truth: None },
        }
    }

    /// Runs a job in this process and writes its rows; returns its status.
    ///
    /// # Errors
    /// If the log or its rig cannot be read, the estimator stops early, or the rows cannot be written.
    pub fn run_job(
        &self,
        key: &str,
        program: &str,
        attempts: usize,
        output: StudyOutput,
    ) -> Result<JobStatus, JobError> {
        let stopwatch = Stopwatch::start();
        let job = self.read_job(key)?;
        let mut files = self.files_of(&job);
        let log_sha256 = self.log_sha256(&job).ok_or_else(|| JobError::NoFlight(files.log.clone()))?;
        let offline = if job.perturbation.start == PerturbationStart::Calibrated {
            let run = self.calibrate(key, &job, &files, false)?;
            files.rig = Some(self.job(key).join("rig.yaml"));
            Some(run)
        } else {
            None
        };
        if !job.perturbation.is_none() {
            files.rig = Some(self.write_perturbed_rig(key, &job, &files)?);
        }
        let execution = &Execution { key, job: &job, files, log_sha256, program, attempts, output, stopwatch };
        match &job.subject {
            JobSubject::Run(spec) => self.run_estimator(execution, spec, offline.as_ref()),
            JobSubject::Trajectory(trajectory) => self.evaluate_trajectory(execution, &trajectory.spec),
            JobSubject::Bundle(bundle) => {
                self.calibrate(key, &job, &execution.files, true)?;
                let source = TrajectorySource::File(self.bundle_trajectory(key, *bundle));
                self.evaluate_trajectory(execution, &TrajectorySpec { source, label: bundle.name().to_owned() })
            }
        }
    }

    fn run_estimator(
        &self,
        execution: &Execution<'_>,
        spec: &RunSpec,
        offline: Option<&CalibrationRun>,
    ) -> Result<JobStatus, JobError> {
        let mut plan = SessionPlan::open(&SessionRequest { specs: vec![spec.clone()], ..execution.request() })?;
        plan.keep_linearization_every = Some(CONSISTENCY_EVERY);
        plan.memory_budget_bytes = RECORD_BYTES;
        let recording = session::compute(&plan, &mut |_| ())?.into_recording();
        plan.log.require_unshortened()?;
        let &Execution { key, job, ref files, output, .. } = execution;
        let run = recording.runs.first().ok_or_else(|| JobError::NoImage(files.log.clone()))?;
        if let Some(error) = &run.error {
            return Err(JobError::Estimator(error.clone()));
        }
        if run.steps.is_empty() {
            return Err(JobError::NoImage(files.log.clone()));
        }
        let summary = summarize(&recording, run, true);
        let costs = self.costs_of(execution, &plan);
        let consistency = run.pose_consistency();
        let initialized = summary.frames.initialized_at_s.is_some();
        let status = if initialized { JobStatus::Ok } else { JobStatus::NotInitialized };
        let result = JobResult {
            key,
            job,
            status,
            message: summary.accuracy_missing.as_deref().filter(|_| !initialized).unwrap_or_default(),
            costs: &costs,
            run: Some(RunResult {
                recording: &recording,
                record: run,
                summary: &summary,
                consistency: &consistency,
                offline,
            }),
            trajectory: None,
        };
        let tables = StudyTables::of(&result, output.frames);
        if output.files {
            write_run(&recording, run, &self.job(key), RunFileOptions::default())?;
        }
        self.write_rows(key, &tables, output)?;
        Ok(status)
    }

    /// Evaluates a trajectory against the ground truth of its log and writes its row.
    fn evaluate_trajectory(&self, execution: &Execution<'_>, spec: &TrajectorySpec) -> Result<JobStatus, JobError> {
        let request = SessionRequest { trajectories: vec![spec.clone()], ..execution.request() };
        let plan = SessionPlan::open(&request)?;
        let recording = Recording::new(&plan);
        plan.log.require_unshortened()?;
        let costs = self.costs_of(execution, &plan);
        let lane = &recording.trajectories[0];
        let &Execution { key, job, output, .. } = execution;
        let result = JobResult {
            key,
            job,
            status: JobStatus::Ok,
            message: lane.accuracy_missing.as_deref().unwrap_or_default(),
            costs: &costs,
            run: None,
            trajectory: Some(lane),
        };
        self.write_rows(key, &StudyTables::of(&result, output.frames), output)?;
        Ok(JobStatus::Ok)
    }

    /// Costs of a job that has a result so far.
    fn costs_of(&self, execution: &Execution<'_>, plan: &SessionPlan) -> JobCosts {
        let Execution { key, job, files, program, attempts, .. } = execution;
        JobCosts {
            log_sha256: Some(execution.log_sha256.clone()),
            rig_sha256: Some(rig_sha256(&plan.rig)),
            wall_s: execution.stopwatch.elapsed_ms() * 1e-3,
            peak_memory_bytes: peak_memory_bytes(),
            ..self.costs(key, job, files, program, *attempts)
        }
    }

    /// Path of the trajectory of a bundle adjustment.
    fn bundle_trajectory(&self, key: &str, bundle: Bundle) -> PathBuf {
        self.job(key).join(match bundle {
            Bundle::Both => TRAJECTORY,
            Bundle::Static => STATIC_TRAJECTORY,
        })
    }

    /// SHA-256 of the log of a job, `None` for a flight that is not rendered.
    fn log_sha256(&self, job: &StudyJob) -> Option<String> {
        match &job.log {
            JobLog::Recorded(log) => Some(log.sha256.clone()),
            JobLog::Simulated(flight) => self.rendered(flight).map(|rendered| rendered.sha256),
        }
    }

    /// Costs of a job by its inputs.
    fn costs(&self, key: &str, job: &StudyJob, files: &JobFiles, program: &str, attempts: usize) -> JobCosts {
        let relative = |path: &Option<PathBuf>| path.as_ref().map(|path| self.relative(path));
        let trajectory_path = match &job.subject {
            JobSubject::Run(_) => None,
            JobSubject::Bundle(bundle) => Some(self.relative(&self.bundle_trajectory(key, *bundle))),
            JobSubject::Trajectory(trajectory) => Some(match &trajectory.spec.source {
                TrajectorySource::File(path) => self.relative(path),
                topic @ TrajectorySource::Topic(_) => topic.to_string(),
            }),
        };
        JobCosts {
            trajectory_path,
            log_path: self.relative(&files.log),
            rig_path: relative(&files.rig),
            truth_path: relative(&files.truth),
            program: program.to_owned(),
            attempts,
            ..JobCosts::default()
        }
    }

    /// Writes the row of a job without a result.
    ///
    /// # Errors
    /// If the row cannot be written.
    pub fn write_failure(
        &self,
        KeyedJob { key, job }: &KeyedJob,
        status: JobStatus,
        message: &str,
        costs: &JobCosts,
        output: StudyOutput,
    ) -> Result<(), JobError> {
        let costs = JobCosts {
            log_sha256: self.log_sha256(job),
            wall_s: costs.wall_s,
            ..self.costs(key, job, &self.files_of(job), &costs.program, costs.attempts)
        };
        let result = JobResult { key, job, status, message, costs: &costs, run: None, trajectory: None };
        Ok(self.write_rows(key, &StudyTables::of(&result, output.frames), output)?)
    }

    /// Calibrates offline from the log of a job and writes the files of `dcvins calibrate` into its folder.
    fn calibrate(
        &self,
        key: &str,
        job: &StudyJob,
        files: &JobFiles,
        trajectory: bool,
    ) -> Result<CalibrationRun, JobError> {
        let (start_s, duration_s) = span(job);
        let request = CalibrationRequest {
            log_path: files.log.clone(),
            rig_path: files.rig.clone(),
            ground_truth_path: files.truth.clone(),
            start_s,
            duration_s,
            ..CalibrationRequest::default()
        };
        let options = CalibrationOptions { pose_covariances: trajectory, ..CalibrationOptions::default() };
        let run = session::calibrate(&request, &options, &mut |_| ControlFlow::Continue(()))?;
        write_calibration(&run, &report_calibration(&run), &self.job(key), trajectory)?;
        Ok(run)
    }

    /// Writes the rig of a job with its errors, and its masks.
    fn write_perturbed_rig(&self, key: &str, job: &StudyJob, files: &JobFiles) -> Result<PathBuf, JobError> {
        let log = FlightLog::open(&files.log)?;
        let given = Rig::for_log(&log, files.rig.as_deref())?;
        let truth = given.own_ground_truth(&log, files.truth.as_deref())?;
        let seed = job.seed.unwrap_or(0);
        let mut rig = job.perturbation.apply(&given, truth.as_ref(), seed).map_err(StudyFileError::from)?;
        let folder = self.job(key);
        fs::create_dir_all(&folder).map_err(StudyFileError::write(&folder))?;
        let mut outputs = OutputSet::default();
        for (name, png) in masks::beside(&mut rig)? {
            let path = folder.join(name);
            outputs.write(&path, &png).map_err(StudyFileError::write(&path))?;
        }
        let path = folder.join("perturbed.rig.yaml");
        outputs.write(&path, rig.to_yaml().as_bytes()).map_err(StudyFileError::write(&path))?;
        outputs.commit().map_err(StudyFileError::commit)?;
        Ok(path)
    }
}

/// Start in the log and duration of a job, in seconds.
fn span(job: &StudyJob) -> (f64, Option<f64>) {
    match &job.log {
        JobLog::Recorded(log) => (log.start_s, log.duration_s),
        JobLog::Simulated(_) => (0.0, None),
    }
}

/// Largest resident memory of this process so far; `None` if the system does not report it.
fn peak_memory_bytes() -> Option<u64> {
    let status = fs::read_to_string(Path::new("/proc/self/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024)
}
