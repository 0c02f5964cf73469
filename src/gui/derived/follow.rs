//! Incremental reading of a run, so that a panel reads each step once.

use std::sync::Arc;

use crate::session::{RunRecord, StepRecord};

/// Number of steps of a run that a panel has read.
#[derive(Debug, Default)]
pub(crate) struct Follower {
    count: usize,
    run: Option<u64>,
}

pub(crate) struct NewSteps<'a> {
    /// True if the run was replaced or recomputed, so that everything read before is invalid.
    pub(crate) restarted: bool,
    /// The steps not read before.
    pub(crate) steps: &'a [Arc<StepRecord>],
}

impl Follower {
    /// The steps that are new since the last call.
    pub(crate) fn new_steps<'a>(&mut self, run: &'a RunRecord) -> NewSteps<'a> {
        // A read step may become a summary later; it still is the same step.
        let same = self.count <= run.steps.len() && self.run.is_none_or(|id| id == run.id);
        let read = if same { self.count } else { 0 };
        self.count = run.steps.len();
        self.run = Some(run.id);
        NewSteps { restarted: !same, steps: &run.steps[read..] }
    }
}

/// Values of a run's steps for plots over time, one column per value.
#[derive(Debug, Default)]
pub(crate) struct StepTable {
    follower: Follower,
    /// Stamps of the rows, in nanoseconds since the log began.
    pub(crate) stamps_ns: Vec<i64>,
    /// The columns; NaN where a step does not have the value.
    pub(crate) columns: Vec<Vec<f64>>,
    /// Changes when rows are removed.
    pub(crate) epoch: u64,
}

impl StepTable {
    /// Reads the new steps of the run into `N` columns; returns whether there were any.
    pub(crate) fn read<const N: usize>(&mut self, run: &RunRecord, row: impl Fn(&StepRecord) -> [f64; N]) -> bool {
        let new_steps = self.follower.new_steps(run);
        if new_steps.restarted {
            self.stamps_ns.clear();
            self.columns.clear();
            self.epoch += 1;
        }
        self.columns.resize_with(N, Vec::new);
        for step in new_steps.steps {
            self.stamps_ns.push(step.report.stamp_ns);
            for (column, value) in self.columns.iter_mut().zip(row(step)) {
                column.push(value);
            }
        }
        new_steps.restarted || !new_steps.steps.is_empty()
    }
}

/// One table per run; the table of a removed run is removed.
#[derive(Debug, Default)]
pub(crate) struct RunTables {
    tables: Vec<StepTable>,
}

impl RunTables {
    /// Reads the new steps of all runs and returns the tables in the order of the runs.
    pub(crate) fn read<const N: usize>(
        &mut self,
        runs: &[RunRecord],
        row: impl Fn(&StepRecord) -> [f64; N],
    ) -> &[StepTable] {
        self.tables.resize_with(runs.len(), StepTable::default);
        for (table, run) in self.tables.iter_mut().zip(runs) {
            table.read(run, &row);
        }
        &self.tables
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gui::samples::sample_recording_of;

    #[test]
    fn every_step_is_read_once_and_another_run_restarts() {
        let recording = sample_recording_of(60, &["auto"]);
        let whole = &recording.runs[0];
        let mut growing = whole.clone();
        growing.steps.truncate(20);
        let mut table = StepTable::default();
        let frame = |step: &StepRecord| [step.report.frame_index as f64];
        assert!(table.read(&growing, frame));
        assert!(!table.read(&growing, frame));
        growing.steps = whole.steps.clone();
        assert!(table.read(&growing, frame));
        assert_eq!(table.columns[0], (0..60).map(f64::from).collect::<Vec<_>>());
        assert_eq!(table.epoch, 0);

        let other = sample_recording_of(30, &["auto"]);
        assert!(table.read(&other.runs[0], frame));
        assert_eq!((table.stamps_ns.len(), table.epoch), (30, 1));
        growing.steps.clear();
        assert!(table.read(&growing, frame));
        assert!(table.stamps_ns.is_empty());
    }
}
