//! The data from which the steps of a run are recomputed: their inputs and snapshots of the estimator.
//!
//! The estimator is a plain value and its steps are deterministic, so any step can be recomputed from the nearest
//! snapshot before it to the same bits.

use std::collections::BTreeMap;
use std::sync::Arc;

use parking_lot::Mutex;

use super::run_engine::{PackedEngine, RunEngine};
use super::step_inputs::{OwnedStepInput, StepInputs};
use crate::estimator::FactorRows;
use crate::session::record::StepRecord;

/// Steps between two snapshots while the budget allows all of them.
const MIN_SPACING: usize = 5;
/// Number of steps before a snapshot in which it looks up its measurements: at least ten seconds.
const PAST: usize = 256;
/// Divisor of the budget of the snapshots that gives the budget of the step inputs.
const INPUT_BUDGET_DIVISOR: usize = 2;

/// Number and memory of the kept estimator snapshots.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SnapshotUse {
    pub count: usize,
    pub bytes: usize,
    /// Steps between two snapshots, in the newer part of the run; in the older part up to twice as many.
    pub spacing: usize,
}

/// The history of one run, shared by the threads.
#[derive(Debug)]
pub(in crate::session) struct History {
    inputs: Arc<StepInputs>,
    /// Index of the first step that is not shared with the parent.
    begin: usize,
    /// History of a fork's parent, which holds the steps before `begin`.
    parent: Option<Arc<Self>>,
    snapshots: Mutex<Snapshots>,
}

/// Snapshots by the index of the step before which they were taken.
#[derive(Debug)]
struct Snapshots {
    kept: BTreeMap<usize, (Arc<PackedEngine>, usize)>,
    spacing: usize,
    bytes: usize,
    budget_bytes: usize,
}

impl History {
    /// The history of a run from the start of the log, with a budget for its snapshots.
    pub(in crate::session) fn new(budget_bytes: usize) -> Self {
        Self::with(Arc::default(), 0, None, budget_bytes)
    }

    /// History of a fork whose first step after the parent's is `begin`.
    pub(in crate::session) fn fork(parent: &Arc<Self>, begin: usize, budget_bytes: usize) -> Self {
        Self::with(Arc::clone(&parent.inputs), begin, Some(Arc::clone(parent)), budget_bytes)
    }

    fn with(inputs: Arc<StepInputs>, begin: usize, parent: Option<Arc<Self>>, budget_bytes: usize) -> Self {
        let snapshots = Snapshots { kept: BTreeMap::new(), spacing: MIN_SPACING, bytes: 0, budget_bytes };
        Self { inputs, begin, parent, snapshots: Mutex::new(snapshots) }
    }

    pub(in crate::session) fn inputs(&self) -> &Arc<StepInputs> {
        &self.inputs
    }

    /// Index of the first step that is not shared with the parent.
    pub(in crate::session) fn begin(&self) -> usize {
        self.begin
    }

    /// Stores a snapshot of the engine where one is due.
    pub(in crate::session) fn before_step(&self, step: usize, engine: &RunEngine) {
        let snapshots = self.snapshots.lock();
        if step != self.begin && !step.is_multiple_of(snapshots.spacing) {
            return;
        }
        drop(snapshots);
        let packed = engine.packed(&self.past(step));
        let bytes = packed.bytes();
        let mut snapshots = self.snapshots.lock();
        snapshots.bytes += bytes;
        snapshots.kept.insert(step, (Arc::new(packed), bytes));
        snapshots.keep_within_budget(self.begin);
    }

    /// Inputs of the steps before `step`, in which its snapshot looks up measurements.
    fn past(&self, step: usize) -> Vec<Arc<OwnedStepInput>> {
        self.inputs.range(step.saturating_sub(PAST)..step)
    }

    /// Sets the memory budget of the snapshots in bytes; the inputs may take half of it.
    pub(in crate::session) fn set_budget(&self, budget_bytes: usize) {
        if self.parent.is_none() {
            self.inputs.set_budget(budget_bytes / INPUT_BUDGET_DIVISOR);
        }
        let mut snapshots = self.snapshots.lock();
        snapshots.budget_bytes = budget_bytes;
        snapshots.keep_within_budget(self.begin);
    }

    /// Evicts one more snapshot if the snapshots take more than `least_bytes`. Returns true if one was evicted.
    pub(super) fn evict_above(&self, least_bytes: usize) -> bool {
        let mut snapshots = self.snapshots.lock();
        snapshots.bytes > least_bytes && snapshots.evict_one(self.begin)
    }

    /// Steps between two snapshots.
    pub(in crate::session) fn spacing(&self) -> usize {
        self.snapshots.lock().spacing
    }

    /// Number and memory of the snapshots of this run, without its parent's.
    pub(in crate::session) fn snapshots(&self) -> SnapshotUse {
        let snapshots = self.snapshots.lock();
        SnapshotUse { count: snapshots.kept.len(), bytes: snapshots.bytes, spacing: snapshots.spacing }
    }

    /// Bytes of snapshots and step inputs.
    pub(in crate::session) fn bytes(&self) -> usize {
        let of_inputs = if self.parent.is_none() { self.inputs.own_bytes() } else { 0 };
        self.snapshots.lock().bytes + of_inputs
    }

    /// Bytes of the main camera's tracks in memory, which all runs on the camera share.
    pub(in crate::session) fn tracks_bytes(&self) -> usize {
        self.inputs.tracks_bytes()
    }

    /// The engine in its state before a step, `None` for a step that has not been computed.
    pub(in crate::session) fn engine_before(&self, step: usize) -> Option<RunEngine> {
        if step < self.begin {
            return self.parent.as_ref()?.engine_before(step);
        }
        let (at, mut engine) = self.snapshot_before(step)?;
        for number in at..step {
            engine.step_without_rank(&*self.inputs.get(number)?);
        }
        Some(engine)
    }

    /// Last snapshot at or before a step, and the step before which it was taken.
    fn snapshot_before(&self, step: usize) -> Option<(usize, RunEngine)> {
        let snapshots = self.snapshots.lock();
        let (at, packed) =
            snapshots.kept.range(..=step).next_back().map(|(at, (packed, _))| (*at, Arc::clone(packed)))?;
        drop(snapshots);
        Some((at, packed.unpacked(&self.past(at))))
    }

    /// Recomputes the steps up to `last` from the snapshot before it. Returns the last `max_count` of them with their
    /// indices; empty for a step that has not been computed.
    pub(in crate::session) fn recompute(&self, last: usize, max_count: usize) -> Vec<(usize, StepRecord)> {
        self.recompute_while(last, max_count, &|| true)
    }

    /// As [`History::recompute`], but ends as soon as `wanted` returns false, with the steps so far.
    pub(in crate::session) fn recompute_while(
        &self,
        last: usize,
        max_count: usize,
        wanted: &dyn Fn() -> bool,
    ) -> Vec<(usize, StepRecord)> {
        if last < self.begin {
            return self.parent.as_ref().map_or_else(Vec::new, |it| it.recompute_while(last, max_count, wanted));
        }
        let Some((at, mut engine)) = self.snapshot_before(last) else { return Vec::new() };
        let first = (last + 1).saturating_sub(max_count.max(1)).max(at);
        let mut steps = Vec::new();
        for number in at..=last {
            let Some(input) = self.inputs.get(number) else { break };
            if !wanted() {
                break;
            }
            if number < first {
                engine.step_without_rank(&input);
            } else {
                steps.push((number, engine.step(&input)));
            }
        }
        steps
    }

    /// The linearized rows of a step's factors other than reprojection, recomputed; `None` for a step that has not been
    /// computed or has none.
    pub(in crate::session) fn factor_rows(&self, step: usize) -> Option<Vec<FactorRows>> {
        let (mut engine, input) = (self.engine_before(step)?, self.inputs.get(step)?);
        engine.estimator_mut().set_keep_factor_rows();
        engine.step(&input).report.factor_rows
    }

    /// The states of the solver in a step as records: before the first iteration and after each iteration. The last one
    /// is the step itself.
    pub(in crate::session) fn solver_states(&self, step: usize) -> Vec<StepRecord> {
        let (Some(engine), Some(input)) = (self.engine_before(step), self.inputs.get(step)) else {
            return Vec::new();
        };
        let whole = engine.clone().step(&input);
        // The first window is solved several times, with outlier rejection in between.
        let begins = whole.report.events.iter().any(|event| event.kind.initializes_window());
        let iterations = if begins { 0 } else { whole.report.iterations.len() };
        let mut records: Vec<StepRecord> = (0..iterations)
            .map(|count| {
                let mut engine = engine.clone();
                engine.set_iterations(count);
                engine.step(&input)
            })
            .collect();
        records.push(whole);
        records
    }
}

impl Snapshots {
    /// Evicts every other snapshot, the oldest first, until the rest fits into the budget. The first snapshot is always
    /// kept:
    /// every recomputation could need it.
    fn keep_within_budget(&mut self, begin: usize) {
        while self.bytes > self.budget_bytes && self.evict_one(begin) {}
    }

    /// Evicts the next snapshot; returns true if there was one other than the first.
    fn evict_one(&mut self, begin: usize) -> bool {
        while self.kept.len() > 1 {
            let doubled = 2 * self.spacing;
            let evicted = self.kept.keys().copied().find(|step| *step != begin && !step.is_multiple_of(doubled));
            if let Some((_, bytes)) = evicted.and_then(|step| self.kept.remove(&step)) {
                self.bytes -= bytes;
                return true;
            }
            self.spacing = doubled;
        }
        false
    }
}
