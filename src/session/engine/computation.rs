//! The record of a session together with what its steps are recomputed from.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::history::{History, SnapshotUse};
use super::message::EngineMessage;
use super::recompute::{Detail, RecomputeRequest, Recomputed};
use crate::session::plan::SessionPlan;
use crate::session::record::{Recording, RunRecord, SolverPosition, SolverTrace, StepFactorRows, StepRecord};

/// Of the memory of a recording, one part in so many is for snapshots.
const SNAPSHOT_PART: usize = 4;

/// The runs of a session as far as they are computed: their record, and by run the history from which any step of it can
/// be recomputed to the same bits.
///
/// A clone shares record and histories.
#[derive(Clone, Debug)]
pub struct Computation {
    recording: Arc<Recording>,
    /// By [`RunRecord::id`].
    histories: BTreeMap<u64, Arc<History>>,
}

impl Computation {
    /// The runs of a plan before their first steps.
    pub(in crate::session) fn new(plan: &SessionPlan) -> Self {
        let recording = Arc::new(Recording::new(plan));
        let history = |run: &RunRecord| (run.id, Arc::new(History::new(plan.memory_budget_bytes)));
        let histories = recording.runs.iter().map(history).collect();
        let computation = Self { recording, histories };
        computation.divide_snapshot_memory();
        computation
    }

    /// The reports so far.
    pub fn recording(&self) -> &Arc<Recording> {
        &self.recording
    }

    /// The reports alone.
    pub fn into_recording(self) -> Recording {
        Arc::unwrap_or_clone(self.recording)
    }

    /// The reports, to be changed; whoever holds the record keeps it as it is.
    pub(in crate::session) fn recording_mut(&mut self) -> &mut Recording {
        Arc::make_mut(&mut self.recording)
    }

    /// The history of a run by its number.
    pub(in crate::session) fn history(&self, run: usize) -> Option<&Arc<History>> {
        self.histories.get(&self.recording.runs.get(run)?.id)
    }

    /// Adds a run that is to be computed, with its history.
    pub(in crate::session) fn add_run(&mut self, run: RunRecord, history: Arc<History>) {
        self.histories.insert(run.id, history);
        self.recording_mut().runs.push(run);
        self.divide_snapshot_memory();
    }

    /// Removes the last run.
    pub(in crate::session) fn remove_last_run(&mut self) {
        if let Some(run) = self.recording_mut().runs.pop() {
            self.histories.remove(&run.id);
        }
    }

    /// Adds what a thread reports.
    pub(in crate::session) fn apply(&mut self, message: EngineMessage) {
        match message {
            EngineMessage::Step { run, record } => {
                if let Some(run) = self.recording_mut().runs.get_mut(run) {
                    run.push(*record);
                }
                self.keep_within_budget();
            }
            EngineMessage::Finished { run, error } => {
                if let Some(run) = self.recording_mut().runs.get_mut(run) {
                    run.finished = true;
                    run.error = error;
                }
            }
            EngineMessage::Warnings(warnings) => self.recording_mut().add_warnings(warnings),
        }
    }

    /// Adds what has been recomputed of a run.
    pub(in crate::session) fn add_recomputed(&mut self, request: &RecomputeRequest, recomputed: Recomputed) {
        let Some(run) = self.recording_mut().runs.iter_mut().find(|run| run.id == request.run) else { return };
        match recomputed {
            Recomputed::Steps(steps) => run.add_recomputed(request.step, steps),
            Recomputed::SolverStates(records) => {
                let shown = match request.detail {
                    Detail::SolverStates(shown) => shown,
                    Detail::Step | Detail::FactorRows => SolverPosition::BeforeLast(0),
                };
                let records: Vec<_> = records.into_iter().map(Arc::new).collect();
                let at = shown.of(records.len().saturating_sub(1));
                run.trace = Some(SolverTrace { step: request.step, records, at });
            }
            Recomputed::FactorRows(rows) => run.factor_rows = Some(StepFactorRows { step: request.step, rows }),
        }
    }

    /// Sets how much memory record and histories may take, in bytes; steps that do not fit any more become summaries.
    pub(in crate::session) fn set_memory_budget(&mut self, bytes: usize) {
        self.recording_mut().memory_budget_bytes = bytes;
        self.divide_snapshot_memory();
        self.keep_within_budget();
    }

    /// Divides the memory for snapshots among the runs.
    fn divide_snapshot_memory(&self) {
        let each = self.recording.memory_budget_bytes / SNAPSHOT_PART / self.recording.runs.len().max(1);
        self.histories.values().for_each(|history| history.set_budget(each));
    }

    /// Replaces steps by their summaries until everything fits into its memory, or only the newest steps are left.
    fn keep_within_budget(&mut self) {
        let recording = Arc::make_mut(&mut self.recording);
        for run in &mut recording.runs {
            run.memory.history = self.histories.get(&run.id).map_or(0, |history| history.bytes());
        }
        while recording.memory_bytes() > recording.memory_budget_bytes {
            // The largest run goes first; forks come after the run that they share steps with.
            let mut runs: Vec<usize> = (0..recording.runs.len()).collect();
            runs.sort_by_key(|run| std::cmp::Reverse(recording.runs[*run].memory.own));
            let summarized = runs.into_iter().any(|run| {
                let run = &mut recording.runs[run];
                let history = self.histories.get(&run.id);
                history.is_some_and(|history| run.summarize_one(history.begin(), history.spacing()))
            });
            if !summarized {
                return;
            }
        }
    }

    /// Recomputes the steps at a time of which only summaries are kept, so that drawings of that time show everything.
    pub fn fill_in(&mut self, stamp_ns: i64) {
        for run in 0..self.recording.runs.len() {
            let record = &self.recording.runs[run];
            let Some(number) = record.index_at(stamp_ns).filter(|number| record.lacks(*number)) else { continue };
            let steps = self.recompute(run, number, 1);
            self.recording_mut().runs[run].add_recomputed(number, steps);
        }
    }

    /// Recomputes the step `last` of a run, and before it up to `most - 1` others, from the nearest snapshot of the
    /// estimator, whatever is kept of them; with their numbers, in order. Empty for a step that has not been computed.
    pub fn recompute(&self, run: usize, last: usize, most: usize) -> Vec<(usize, StepRecord)> {
        self.history(run).map_or_else(Vec::new, |history| history.recompute(last, most))
    }

    /// A step of a run with everything, recomputed where only its summary is kept: the same bits, but for the measured
    /// times.
    pub fn whole_step(&self, run: usize, number: usize) -> Option<Arc<StepRecord>> {
        let step = self.recording.runs.get(run)?.steps.get(number)?;
        if !step.summary_only {
            return Some(Arc::clone(step));
        }
        let (_, record) = self.recompute(run, number, 1).pop()?;
        Some(Arc::new(record))
    }

    /// The states of the solver in a step: before its first iteration, after it, and so on to the last, which is the step
    /// itself. A step that initializes the window has only that.
    pub fn solver_states(&self, run: usize, number: usize) -> Vec<StepRecord> {
        self.history(run).map_or_else(Vec::new, |history| history.solver_states(number))
    }

    /// How much the estimator snapshots of a run take; forks count their own.
    pub fn snapshots(&self, run: usize) -> Option<SnapshotUse> {
        self.history(run).map(|history| history.snapshots())
    }
}
