//! Several passes of a run over the log (`passes=2`): calibration and biases estimated in one pass are the prior of the
//! next.
//!
//! Only the last pass is recorded. The others process the same inputs without the observability analysis.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::mpsc::SyncSender;

use super::computation::EngineMessage;
use super::run_engine::RunEngine;
use super::step_inputs::OwnedStepInput;
use crate::estimator::{EarlierPass, EstimatorConfig};
use crate::geometry::seconds_from_ns;
use crate::session::record::PassProgress;

/// Steps between two readings of the biases and two reports of the progress.
const STEPS_BETWEEN_READINGS: usize = 20;

/// The passes of a run before its last one.
pub(in crate::session) struct EarlierPasses<'a> {
    pub(in crate::session) run: usize,
    /// Channel for the progress.
    pub(in crate::session) results: &'a SyncSender<EngineMessage>,
}

/// Reason why a pass has no result.
pub(in crate::session) enum PassFailure {
    /// The session was closed.
    Closed,
    /// A step failed; the reason for the record.
    Failed(String),
}

impl EarlierPasses<'_> {
    /// Runs pass `number`, counted from 1, and returns the configuration of the next one; unchanged if the pass has not
    /// initialized a window.
    pub(in crate::session) fn run(
        &self,
        number: usize,
        config: &EstimatorConfig,
        inputs: impl Iterator<Item = Arc<OwnedStepInput>>,
    ) -> Result<EstimatorConfig, PassFailure> {
        let mut engine = RunEngine::new(config.clone(), None);
        let (mut begin_ns, mut newest_ns) = (None, 0);
        let mut found: Option<EarlierPass> = None;
        for (step, input) in inputs.enumerate() {
            newest_ns = input.stamp_ns;
            begin_ns.get_or_insert(newest_ns);
            guarded(newest_ns, || engine.step_without_rank(&input)).map_err(PassFailure::Failed)?;
            if step.is_multiple_of(STEPS_BETWEEN_READINGS) {
                found = latest_findings(found, &engine, begin_ns, newest_ns);
                let progress = PassProgress { number, reached_ns: newest_ns };
                self.results
                    .send(EngineMessage::Pass { run: self.run, progress })
                    .map_err(|_closed| PassFailure::Closed)?;
            }
        }
        let found = latest_findings(found, &engine, begin_ns, newest_ns).map(Arc::new);
        Ok(EstimatorConfig { earlier_pass: found.or_else(|| config.earlier_pass.clone()), ..config.clone() })
    }
}

/// Findings of the engine since `begin_ns`, with the best biases so far, or `before` while it is not initialized.
fn latest_findings(
    before: Option<EarlierPass>,
    engine: &RunEngine,
    begin_ns: Option<i64>,
    now_ns: i64,
) -> Option<EarlierPass> {
    let now = begin_ns.and_then(|begin_ns| engine.estimator().findings(seconds_from_ns(now_ns - begin_ns)));
    match (now, before) {
        (Some(now), Some(before)) => Some(now.with_best_bias(&before)),
        (now, before) => now.or(before),
    }
}

/// Runs a step; a panic inside it ends the run with a message instead of the program.
pub(in crate::session) fn guarded<T>(stamp_ns: i64, step: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(step)).map_err(|_panic| {
        let time_s = seconds_from_ns(stamp_ns);
        format!("internal error in the estimator at {time_s:.3} s; please report it with the log")
    })
}
