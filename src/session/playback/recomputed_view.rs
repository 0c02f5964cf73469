//! Recomputation of steps for the view at the cursor.

use std::sync::Arc;

use super::session::{FactorRowsView, Session};
use crate::session::engine::{Detail, RecomputeRequest, STEPS_AT_ONCE};
use crate::session::record::RunRecord;

impl Session {
    /// Waits until the record has everything that the view at the cursor needs.
    pub fn settle(&self) {
        self.request_recomputation();
        self.recompute.settle();
        // A solver state that was requested meanwhile is shown from here on.
        self.request_recomputation();
    }

    /// Whether steps at the cursor are being recomputed.
    pub fn is_recomputing(&self) -> bool {
        self.recompute.is_busy()
    }

    pub(super) fn request_factor_rows(&mut self, run: usize, step: usize) {
        self.factor_rows = self.recording().runs.get(run).map(|run| FactorRowsView { run: run.id, step });
    }

    /// Requests the data that the view at the cursor needs and the record lacks, and removes solver states that are no
    /// longer shown.
    pub(super) fn request_recomputation(&self) {
        let computation = self.computation();
        let cursor = self.cursor;
        let (mut requests, mut prefetched) = (Vec::new(), Vec::new());
        for (number, run) in computation.recording().runs.iter().enumerate() {
            let (Some(step), Some(history)) = (run.index_at(cursor.stamp_ns), computation.history(number)) else {
                continue;
            };
            let request = |step, detail, prefetch| RecomputeRequest {
                run: run.id,
                history: Arc::clone(history),
                step,
                detail,
                prefetch,
            };
            if run.has_only_summary(step) {
                // Playback also needs the next steps; recomputing all of them takes no longer than the last one.
                let end = step + if cursor.playing { STEPS_AT_ONCE } else { 1 };
                let last = (step..end).take_while(|step| run.has_only_summary(*step)).last().unwrap_or(step);
                requests.push(request(last, Detail::Step, false));
            }
            if let Some(shown) = cursor.solver
                && run.trace.as_ref().is_none_or(|trace| trace.step != step)
            {
                requests.push(request(step, Detail::SolverStates(shown), false));
            }
            let rows = self.factor_rows.filter(|view| view.run == run.id && view.step == step);
            if rows.is_some() && run.factor_rows.as_ref().is_none_or(|rows| rows.step != step) {
                requests.push(request(step, Detail::FactorRows, false));
            }
            // Users step back: the steps before the cursor are prefetched.
            let before = (step.saturating_sub(STEPS_AT_ONCE)..step).rev().find(|step| run.has_only_summary(*step));
            if let Some(before) = before.filter(|_| !cursor.playing) {
                prefetched.push(request(before, Detail::Step, true));
            }
        }
        requests.extend(prefetched);
        self.recompute.request(requests);
        let is_stale = |run: &RunRecord| match (&run.trace, cursor.solver) {
            (None, _) => false,
            (Some(_), None) => true,
            (Some(trace), Some(shown)) => {
                run.index_at(cursor.stamp_ns) != Some(trace.step) || trace.at != shown.of(trace.iterations())
            }
        };
        let stale = computation.recording().runs.iter().any(is_stale);
        // Released before the record changes, which would copy it otherwise.
        drop(computation);
        if stale {
            self.shared.change(|computation| {
                for run in &mut computation.recording_mut().runs {
                    let here = run.index_at(cursor.stamp_ns);
                    run.trace = run.trace.take().filter(|trace| Some(trace.step) == here).and_then(|mut trace| {
                        trace.at = cursor.solver?.of(trace.iterations());
                        Some(trace)
                    });
                }
            });
        }
    }
}
