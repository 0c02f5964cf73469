//! The record of a session together with the histories from which its steps can be recomputed.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::history::{History, SnapshotUse};
use super::recompute::{Detail, RecomputeRequest, Recomputed};
use crate::estimator::CalibrationPosterior;
use crate::flight_log::LogWarning;
use crate::log_check::CheckReport;
use crate::sensors::RequiredAccuracy;
use crate::session::plan::SessionPlan;
use crate::session::record::{
    Diagnosis, PassProgress, Recording, RunRecord, SolverPosition, SolverTrace, StepFactorRows, StepRecord,
};

/// Divisor of the memory budget: estimator snapshots may take half of it. They take precedence over complete steps:
/// from a snapshot any step is recomputed quickly, while a complete step helps only at the cursor.
const SNAPSHOT_BUDGET_DIVISOR: usize = 2;

/// Runs of a session as far as they are computed: their record, and for each run the history from which any of its
/// steps can be recomputed bit by bit.
///
/// A clone shares record and histories.
#[derive(Clone, Debug)]
pub struct Computation {
    recording: Arc<Recording>,
    /// Snapshots of each run by [`RunRecord::id`].
    histories: BTreeMap<u64, Arc<History>>,
}

impl Computation {
    /// Runs of a plan before their first step.
    pub(in crate::session) fn new(plan: &SessionPlan) -> Self {
        let recording = Arc::new(Recording::new(plan));
        let history = |run: &RunRecord| (run.id, Arc::new(History::new(plan.memory_budget_bytes)));
        let histories = recording.runs.iter().map(history).collect();
        let computation = Self { recording, histories };
        computation.divide_snapshot_memory();
        computation
    }

    pub fn recording(&self) -> &Arc<Recording> {
        &self.recording
    }

    pub fn into_recording(self) -> Recording {
        Arc::unwrap_or_clone(self.recording)
    }

    /// The record for modification (copy on write: clones keep the old state).
    pub(in crate::session) fn recording_mut(&mut self) -> &mut Recording {
        Arc::make_mut(&mut self.recording)
    }

    pub(in crate::session) fn history(&self, run: usize) -> Option<&Arc<History>> {
        self.histories.get(&self.recording.runs.get(run)?.id)
    }

    pub(in crate::session) fn add_run(&mut self, run: RunRecord, history: Arc<History>) {
        self.histories.insert(run.id, history);
        self.recording_mut().runs.push(run);
        self.divide_snapshot_memory();
    }

    pub(in crate::session) fn remove_last_run(&mut self) {
        if let Some(run) = self.recording_mut().runs.pop() {
            self.histories.remove(&run.id);
        }
    }

    /// Stores the result of the check of the log and its rig, on which the answers of the runs depend.
    pub fn set_check(&mut self, checked: CheckReport) {
        let recording = self.recording_mut();
        recording.agreement = Arc::new(checked.agreement);
        (recording.check, recording.is_being_checked) = (Some(Arc::new(checked.findings)), false);
    }

    /// Length of a log that another program is writing, or has completed, and the reason why no messages come.
    pub(in crate::session) fn set_written(&mut self, duration_ns: i64, is_being_written: bool, gap: Option<String>) {
        let recording = self.recording_mut();
        (recording.duration_ns, recording.is_being_written) = (duration_ns, is_being_written);
        recording.interruption = gap;
    }

    /// The check of the log has been started beside the runs.
    pub(in crate::session) fn begin_check(&mut self) {
        self.recording_mut().is_being_checked = true;
    }

    /// Accuracy with which the calibration is compared from now on.
    pub fn set_required_accuracy(&mut self, required: RequiredAccuracy) {
        Arc::make_mut(&mut self.recording_mut().rig).required_accuracy = required;
    }

    /// Stores the result of a diagnosis of the run with an id, on which its answer depends.
    pub(in crate::session) fn set_diagnosis(&mut self, run: u64, diagnosis: Option<Diagnosis>) {
        if let Some(run) = self.recording_mut().runs.iter_mut().find(|it| it.id == run) {
            run.diagnosis = diagnosis.map(Arc::new);
        }
    }

    /// Stores a message of the engine in the record.
    pub(in crate::session) fn apply(&mut self, message: EngineMessage) {
        match message {
            EngineMessage::Step { run, record } => {
                if let Some(run) = self.recording_mut().runs.get_mut(run) {
                    run.push(*record);
                }
                self.keep_within_budget();
            }
            EngineMessage::Pass { run, progress } => {
                if let Some(run) = self.recording_mut().runs.get_mut(run) {
                    run.earlier_pass = Some(progress);
                }
            }
            EngineMessage::Finished { run, error, posterior } => {
                if let Some(run) = self.recording_mut().runs.get_mut(run) {
                    run.finished = true;
                    run.error = error;
                    run.posterior = posterior;
                }
            }
            EngineMessage::Warnings(warnings) => self.recording_mut().add_warnings(warnings),
        }
    }

    /// Stores recomputed steps of a run.
    pub(in crate::session) fn add_recomputed(&mut self, request: &RecomputeRequest, recomputed: Recomputed) {
        let Some(run) = self.recording_mut().runs.iter_mut().find(|run| run.id == request.run) else { return };
        match recomputed {
            Recomputed::Steps(steps) => run.add_recomputed(request.step, steps),
            Recomputed::SolverStates(records) => {
                let shown = match request.detail {
                    Detail::SolverStates(shown) => shown,
                    Detail::Step | Detail::FactorRows => SolverPosition::BeforeLast(0),
                };
                let scaled = records.into_iter().map(|mut record| {
                    run.scale_as(request.step, &mut record);
                    Arc::new(record)
                });
                let records: Vec<_> = scaled.collect();
                let at = shown.of(records.len().saturating_sub(1));
                run.trace = Some(SolverTrace { step: request.step, records, at });
            }
            Recomputed::FactorRows(rows) => run.factor_rows = Some(StepFactorRows { step: request.step, rows }),
        }
    }

    /// Sets the memory budget of record and histories in bytes. Steps beyond it are replaced by their summaries.
    pub(in crate::session) fn set_memory_budget(&mut self, bytes: usize) {
        self.recording_mut().memory_budget_bytes = bytes;
        self.divide_snapshot_memory();
        self.keep_within_budget();
    }

    /// Divides the snapshot memory equally among the runs.
    fn divide_snapshot_memory(&self) {
        let each = self.recording.memory_budget_bytes / SNAPSHOT_BUDGET_DIVISOR / self.recording.runs.len().max(1);
        self.histories.values().for_each(|history| history.set_budget(each));
    }

    /// Replaces steps by their summaries until the record fits into its budget or only the newest steps are complete.
    fn keep_within_budget(&mut self) {
        let recording = Arc::make_mut(&mut self.recording);
        for run in &mut recording.runs {
            let history = self.histories.get(&run.id);
            run.memory.history = history.map_or(0, |history| history.bytes());
            run.memory.tracks = history.map_or(run.memory.tracks, |history| history.tracks_bytes());
        }
        while recording.memory_bytes() > recording.memory_budget_bytes {
            // The largest run goes first; forks come after the run that they share steps with.
            let mut runs: Vec<usize> = (0..recording.runs.len()).collect();
            runs.sort_by_key(|run| std::cmp::Reverse(recording.runs[*run].memory.steps));
            let summarized = runs.into_iter().any(|run| {
                let run = &mut recording.runs[run];
                let history = self.histories.get(&run.id);
                history.is_some_and(|history| run.summarize_one(history.begin(), history.spacing()))
            });
            // If no step is left to summarize, snapshots are evicted, down to half of their budget.
            let least_bytes =
                recording.memory_budget_bytes / (2 * SNAPSHOT_BUDGET_DIVISOR) / recording.runs.len().max(1);
            let evicted = !summarized && self.histories.values().any(|history| history.evict_above(least_bytes));
            if !summarized && !evicted {
                return;
            }
            for run in recording.runs.iter_mut().filter(|_| evicted) {
                run.memory.history = self.histories.get(&run.id).map_or(0, |history| history.bytes());
            }
        }
    }

    /// Recomputes the steps at a stamp of which only the summary is kept, so that drawings of that time are complete.
    pub fn fill_in(&mut self, stamp_ns: i64) {
        for run in 0..self.recording.runs.len() {
            let record = &self.recording.runs[run];
            let Some(number) = record.index_at(stamp_ns).filter(|number| record.has_only_summary(*number)) else {
                continue;
            };
            let steps = self.recompute(run, number, 1);
            self.recording_mut().runs[run].add_recomputed(number, steps);
        }
    }

    /// Recomputes step `last` of a run and up to `max_count - 1` steps before it from the nearest snapshot of the
    /// estimator. Returns the steps with their indices in ascending order; empty for a step that has not been computed.
    pub fn recompute(&self, run: usize, last: usize, max_count: usize) -> Vec<(usize, StepRecord)> {
        let mut steps = self.history(run).map_or_else(Vec::new, |history| history.recompute(last, max_count));
        if let Some(run) = self.recording.runs.get(run) {
            for (number, record) in &mut steps {
                run.scale_as(*number, record);
            }
        }
        steps
    }

    /// A complete step of a run, recomputed where only its summary is kept. The result is identical to the bit except
    /// for the measured times.
    pub fn whole_step(&self, run: usize, number: usize) -> Option<Arc<StepRecord>> {
        let step = self.recording.runs.get(run)?.steps.get(number)?;
        if !step.summary_only {
            return Some(Arc::clone(step));
        }
        let (_, record) = self.recompute(run, number, 1).pop()?;
        Some(Arc::new(record))
    }

    /// The states of the solver in a step: before its first iteration, after each iteration. The last one is the step
    /// itself. A step that initializes the window has only that.
    pub fn solver_states(&self, run: usize, number: usize) -> Vec<StepRecord> {
        self.history(run).map_or_else(Vec::new, |history| history.solver_states(number))
    }

    /// Number and memory of the estimator snapshots of a run; a fork counts its own snapshots separately.
    pub fn snapshots(&self, run: usize) -> Option<SnapshotUse> {
        self.history(run).map(|history| history.snapshots())
    }
}

/// A message from a thread of the engine to the collector.
#[derive(Debug)]
pub(in crate::session) enum EngineMessage {
    /// A run has computed a step.
    Step {
        run: usize,
        record: Box<StepRecord>,
    },
    /// A run with several passes is at a stamp of a pass before the last one.
    Pass {
        run: usize,
        progress: PassProgress,
    },
    /// A run has reached the end of the log, or has failed without a possible restart.
    Finished {
        run: usize,
        /// Reason of an early end, `None` at the end of the log.
        error: Option<String>,
        /// Calibration at its end, `None` without a window or with a fixed calibration.
        posterior: Option<Arc<CalibrationPosterior>>,
    },
    Warnings(Vec<LogWarning>),
}
