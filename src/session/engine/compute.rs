//! Computation of runs to their end or to a condition; blocks until done.

use std::sync::atomic::Ordering;

use super::computation::{Computation, EngineMessage};
use super::threads::Engine;
use crate::session::breakpoints::{Breakpoints, Condition, Hit, NamedValue};
use crate::session::plan::{SessionError, SessionPlan};
use crate::session::record::Recording;

/// The hit that ended [`compute_until`].
#[derive(Clone, Debug, PartialEq)]
pub struct BreakpointHit {
    pub hit: Hit,
    /// Quantities of the condition and their values in that step.
    pub values: Vec<NamedValue>,
    /// One line of text for the terminal.
    pub description: String,
}

/// Computes every run of the plan until a condition becomes true in one of them, and returns that hit.
///
/// All runs end at that stamp: later steps of threads that were ahead are removed.
pub fn compute_until(
    plan: &SessionPlan,
    condition: &Condition,
    on_step: &mut dyn FnMut(&Recording),
) -> Result<(Computation, Option<BreakpointHit>), SessionError> {
    let mut computation = Computation::new(plan);
    let mut engine = Engine::start(plan, &computation)?;
    engine.no_more_runs();
    let mut breakpoints = Breakpoints::default();
    breakpoints.add(condition.clone());
    let mut until_ns = i64::MAX;
    while let Some(message) = engine.receive() {
        computation.apply(ended_at(message, until_ns));
        breakpoints.read(computation.recording());
        let hit = breakpoints.next_after(computation.recording(), i64::MIN);
        if let Some(hit) = hit.filter(|hit| hit.stamp_ns < until_ns) {
            until_ns = hit.stamp_ns;
            computation.recording_mut().end_at(until_ns);
        }
        on_step(computation.recording());
        let interrupted = plan.interrupted.load(Ordering::Relaxed);
        if interrupted || computation.recording().runs.iter().all(|run| run.finished || run.ends_at(until_ns)) {
            break;
        }
    }
    let recording = computation.recording_mut();
    for run in &mut recording.runs {
        run.finished = true;
    }
    // The threads may be ahead by the length of their queues.
    recording.warnings.retain(|warning| warning.stamp_ns <= until_ns);
    let hit = breakpoints.next_after(recording, i64::MIN).map(|hit| {
        let values = breakpoints.values_at(recording, hit);
        BreakpointHit { hit, values, description: breakpoints.describe(recording, hit) }
    });
    Ok((computation, hit))
}

/// Computes every run of the plan and returns the reports. `on_step` is called after each step.
pub fn compute(plan: &SessionPlan, on_step: &mut dyn FnMut(&Recording)) -> Result<Computation, SessionError> {
    let mut computation = Computation::new(plan);
    let mut engine = Engine::start(plan, &computation)?;
    engine.no_more_runs();
    while let Some(message) = engine.receive() {
        computation.apply(message);
        on_step(computation.recording());
        let interrupted = plan.interrupted.load(Ordering::Relaxed);
        if interrupted || computation.recording().runs.iter().all(|run| run.finished) {
            break;
        }
    }
    Ok(computation)
}

/// Replaces a step after `until_ns` by the end of its run: the number of such steps depends on the scheduling of
/// threads.
fn ended_at(message: EngineMessage, until_ns: i64) -> EngineMessage {
    match message {
        EngineMessage::Step { run, record } if record.report.stamp_ns > until_ns => {
            EngineMessage::Finished { run, error: None, posterior: None }
        }
        message => message,
    }
}
