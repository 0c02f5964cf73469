use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use super::antenna_record::PositionTruth;
use super::run::RunRecord;
use super::trajectory_lane::TrajectoryLane;
use crate::flight_log::{LogWarning, WarningKind};
use crate::geometry::ns_from_seconds;
use crate::gimbal::ParameterId;
use crate::log_check::{Agreement, Finding};
use crate::sensors::Rig;
use crate::session::plan::{FlightPrior, LoadedTrajectory, RunSpec, SessionPlan, chain_parameters};

/// Reports of all runs on one log so far.
#[derive(Clone, Debug)]
pub struct Recording {
    pub log_path: PathBuf,
    pub rig: Arc<Rig>,
    /// The ground-truth rig, if known.
    pub ground_truth_rig: Option<Arc<Rig>>,
    /// Length of the log in nanoseconds.
    pub duration_ns: i64,
    /// Start of the runs, in nanoseconds since the log began.
    pub start_ns: i64,
    /// Header stamp of the log's start, in nanoseconds since the Unix epoch.
    pub epoch_ns: i64,
    /// Calibration of earlier flights that the runs started from.
    pub prior: Option<Arc<FlightPrior>>,
    /// The runs in the order of the request; added runs and forks follow.
    pub runs: Vec<RunRecord>,
    /// True if the ground truth of the trajectory is the reference of an offline calibration of the same log.
    pub truth_is_batch: bool,
    /// Antenna positions that are the ground truth instead of poses.
    pub position_truth: Option<Arc<PositionTruth>>,
    /// Trajectories of other programs, shown with the runs.
    pub trajectories: Vec<Arc<TrajectoryLane>>,
    /// Findings of the check of the log and its rig, most severe first; `None` as long as they are not known.
    pub check: Option<Arc<Vec<Finding>>>,
    /// Agreement of the sources that measure one quantity, by the check; empty as long as it is not known.
    pub agreement: Arc<Agreement>,
    /// True while the log and its rig are being checked beside the runs.
    pub is_being_checked: bool,
    /// True while another program is writing the log.
    pub is_being_written: bool,
    /// Reason why no messages of a log come that is being received; `None` while they come.
    pub interruption: Option<String>,
    /// Warnings about the log so far, in time order.
    pub warnings: Vec<LogWarning>,
    pub memory_budget_bytes: usize,
}

impl Recording {
    /// The calibration parameters of its runs: the parameters of their chains in all parameterizations, and the
    /// parameters of their last steps.
    pub fn parameters(&self) -> Vec<ParameterId> {
        let mut parameters: Vec<ParameterId> = Vec::new();
        for run in &self.runs {
            parameters.extend(chain_parameters(&self.rig, &run.camera_key));
            parameters.extend(run.steps.last().iter().flat_map(|step| &step.report.calibration.parameters));
        }
        parameters.sort();
        parameters.dedup();
        parameters
    }

    /// True while a run has further steps to come.
    pub fn is_computing(&self) -> bool {
        self.runs.iter().any(|run| !run.has_ended())
    }

    pub fn log_name(&self) -> String {
        self.log_path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
    }

    /// Name of the log without its extension, for the names of files.
    pub fn log_stem(&self) -> String {
        self.log_path.file_stem().map_or_else(|| "log".to_owned(), |stem| stem.to_string_lossy().into_owned())
    }

    /// The runs of a plan before their first step.
    pub fn new(plan: &SessionPlan) -> Self {
        let position_truth = plan.position_truth.as_ref().map(|loaded| {
            let (source, samples) = (loaded.source.clone(), loaded.samples.clone());
            Arc::new(PositionTruth { source, samples, lever_arm: loaded.lever_arm })
        });
        let run = |spec: &RunSpec, camera_key: &String| {
            RunRecord::new(spec.clone(), camera_key.clone()).with_position_truth(position_truth.clone())
        };
        let lane = |loaded: &LoadedTrajectory| {
            let (label, source) = (loaded.spec.label.clone(), loaded.spec.source.to_string());
            let track = loaded.track.clone();
            match &position_truth {
                Some(truth) => TrajectoryLane::against_positions(label, source, track, truth),
                None => TrajectoryLane::new(label, source, track, plan.ground_truth_track.as_deref()),
            }
        };
        let mut recording = Self {
            log_path: plan.log_path.clone(),
            rig: Arc::clone(&plan.rig),
            ground_truth_rig: plan.ground_truth_rig.clone(),
            duration_ns: plan.log.duration_ns(),
            start_ns: ns_from_seconds(plan.start_s),
            epoch_ns: plan.log.epoch_ns(),
            prior: plan.prior.clone(),
            runs: plan.runs.iter().map(|(spec, camera_key)| run(spec, camera_key)).collect(),
            truth_is_batch: plan.truth_is_batch,
            position_truth: position_truth.clone(),
            trajectories: plan.trajectories.iter().map(|loaded| Arc::new(lane(loaded))).collect(),
            check: None,
            agreement: Arc::default(),
            is_being_checked: false,
            is_being_written: false,
            interruption: None,
            warnings: Vec::new(),
            memory_budget_bytes: plan.memory_budget_bytes,
        };
        let replaced =
            |warning: &&LogWarning| warning.kind == WarningKind::Stamps && plan.rig.uses_log_time(&warning.subject);
        recording.add_warnings(plan.log.warnings().iter().filter(|warning| !replaced(warning)).cloned().collect());
        recording.add_warnings(plan.warnings.clone());
        recording
    }

    /// This recording of a log that was being written, with what only the complete log tells: its length, ground truth
    /// and trajectories.
    #[must_use]
    pub fn of_complete_log(self, plan: &SessionPlan) -> Self {
        let mut complete = Self { runs: self.runs, ..Self::new(plan) };
        complete.add_warnings(self.warnings);
        complete
    }

    /// Name of the reference of the trajectories.
    pub fn truth_name(&self) -> &'static str {
        if self.truth_is_batch { "batch reference" } else { "ground truth" }
    }

    /// Adds warnings about the log in time order without duplicates: two cameras read the same log and report the same
    /// problems, in an order that depends on the scheduling of threads.
    pub(in crate::session) fn add_warnings(&mut self, warnings: Vec<LogWarning>) {
        for warning in warnings {
            let key = |known: &LogWarning| (known.stamp_ns, known.message.clone());
            if let Err(index) = self.warnings.binary_search_by_key(&key(&warning), key) {
                self.warnings.insert(index, warning);
            }
        }
    }

    /// Removes all steps and warnings after a stamp.
    pub(in crate::session) fn end_at(&mut self, stamp_ns: i64) {
        for run in &mut self.runs {
            run.end_at(stamp_ns);
        }
        self.warnings.retain(|warning| warning.stamp_ns <= stamp_ns);
    }

    /// Memory in bytes; tracks that runs share are counted once.
    pub fn memory_bytes(&self) -> usize {
        let mut tracks: BTreeMap<&str, usize> = BTreeMap::new();
        for run in &self.runs {
            let shared = tracks.entry(&run.camera_key).or_default();
            *shared = run.memory.tracks.max(*shared);
        }
        tracks.values().sum::<usize>() + self.runs.iter().map(RunRecord::own_bytes).sum::<usize>()
    }

    /// Latest stamp computed by every run, in nanoseconds since the log began; the last stamp if all are finished.
    pub fn computed_ns(&self) -> i64 {
        let reached = |run: &RunRecord| run.steps.last().map_or(0, |step| step.report.stamp_ns);
        self.runs.iter().filter(|run| !run.finished).map(reached).min().unwrap_or_else(|| self.last_stamp_ns())
    }

    /// Stamp of the first step of any run; the start of the runs if there is none.
    pub fn first_stamp_ns(&self) -> i64 {
        let first = self.runs.iter().filter_map(|run| run.steps.first()).map(|step| step.report.stamp_ns).min();
        first.unwrap_or(self.start_ns)
    }

    pub fn is_finished(&self) -> bool {
        self.runs.iter().all(|run| run.finished)
    }

    /// Stamp of the last step of any run.
    pub fn last_stamp_ns(&self) -> i64 {
        self.runs.iter().filter_map(|run| run.steps.last()).map(|step| step.report.stamp_ns).max().unwrap_or(0)
    }
}
