//! Recomputation of steps for the view at the cursor.

use std::sync::Arc;

use super::background_images::WINDOW_WAIT;
use super::session::{FactorRowsView, Session};
use crate::session::engine::{Detail, RecomputeRequest, STEPS_AT_ONCE};
use crate::session::record::RunRecord;

impl Session {
    /// Blocks until the record has all data that the view at the cursor needs.
    pub fn settle(&self) {
        self.request_recomputation();
        self.recompute.settle();
        // Solver states may have been requested in the meantime; they are shown from here on.
        self.request_recomputation();
    }

    /// Waits a few milliseconds for the data that the view at the cursor needs: most steps are recomputed within that
    /// time, so the window draws one frame instead of one before and one after.
    pub fn settle_shortly(&self) {
        self.recompute.settle_within(WINDOW_WAIT);
    }

    /// True while steps at the cursor are being recomputed.
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
            let request = |first: usize, step: usize, detail, prefetch| RecomputeRequest {
                run: run.id,
                history: Arc::clone(history),
                step,
                count: step + 1 - first,
                detail,
                prefetch,
            };
            let missing = |step: &usize| run.has_only_summary(*step);
            // The steps up to the next snapshot are computed from the same one.
            let spacing = history.spacing();
            let last_with = |first: usize| {
                let others = (first + 1..first + STEPS_AT_ONCE).take_while(|step| !step.is_multiple_of(spacing));
                others.take_while(missing).last().unwrap_or(first)
            };
            let last = if cursor.playing { last_with(step) } else { step };
            if missing(&step) {
                requests.push(request(step, last, Detail::Step, false));
            }
            if let Some(shown) = cursor.solver
                && run.trace.as_ref().is_none_or(|trace| trace.step != step)
            {
                requests.push(request(step, step, Detail::SolverStates(shown), false));
            }
            let rows = self.factor_rows.filter(|view| view.run == run.id && view.step == step);
            if rows.is_some() && run.factor_rows.as_ref().is_none_or(|rows| rows.step != step) {
                requests.push(request(step, step, Detail::FactorRows, false));
            }
            // The steps that will be shown next are prefetched, the nearest first: during playback those ahead, else
            // those before the cursor.
            let next: Vec<usize> = if cursor.playing {
                (last + 1..last + STEPS_AT_ONCE).filter(missing).collect()
            } else {
                (step.saturating_sub(STEPS_AT_ONCE)..step).rev().filter(missing).collect()
            };
            let of_one_snapshot = next.chunk_by(|one, other| one / spacing == other / spacing);
            prefetched.extend(of_one_snapshot.map(|steps| {
                let (one, other) = (steps[0], steps[steps.len() - 1]);
                request(one.min(other), one.max(other), Detail::Step, true)
            }));
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
        // Released before the record changes; otherwise the record would be copied.
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
