//! A log, the runs over it, and the reports they left.
//!
//! A [`Recording`] is what has been computed so far; the window and the exports draw it at a cursor.
//! [`compute`] fills one without a window; a [`Session`] plays one while it still grows.

pub mod accuracy;
pub mod breakpoints;
mod engine;
mod plan;
mod playback;
mod record;
#[cfg(test)]
mod tests;

pub use engine::{
    CalibrationRequest, CalibrationRun, CalibrationRunError, EngineMessage, History, SnapshotFigures, Stopwatch,
    calibrate, image_rotations,
};
pub use plan::{
    DEFAULT_MEMORY_BUDGET_BYTES, FORK_PARAMETERIZATIONS, ForkChanges, ForkError, MAX_RUNS, ParameterizationChoice,
    RunSpec, RunSpecError, SessionError, SessionPlan, SessionRequest,
};
pub use playback::{
    Command, PlaybackSpeed, SavedBreakpoint, SavedFork, SavedLog, SavedSession, SavedSessionError, Session,
};
pub use record::{
    ChainDistance, Comparison, ForkOrigin, Parting, Quantity, RELATIVE_LENGTHS_M, Recording, RelativeAccuracy,
    RunMemory, RunRecord, RunWarning, SolverPosition, SolverTrace, StepRecord, TrajectoryAccuracy,
};

use breakpoints::{Breakpoints, Condition, Hit, NamedValue};
use engine::Engine;

/// Computes every run of the plan until a condition comes true in one of them, and says where that was.
///
/// All runs end at that instant, whatever the threads did: steps after it are taken back.
pub fn compute_until(
    plan: &SessionPlan,
    condition: &Condition,
    on_step: &mut dyn FnMut(&Recording),
) -> Result<(Recording, Option<BreakpointHit>), SessionError> {
    let mut recording = Recording::new(plan);
    let mut engine = Engine::start(plan, &recording)?;
    engine.no_more_runs();
    let mut breakpoints = Breakpoints::default();
    breakpoints.add(condition.clone());
    let mut until_ns = i64::MAX;
    while let Some(message) = engine.receive() {
        match message {
            EngineMessage::Step { run, record } if record.report.stamp_ns > until_ns => {
                recording.take(EngineMessage::Finished { run, error: None });
            }
            message => recording.take(message),
        }
        breakpoints.read(&recording);
        if let Some(hit) = breakpoints.next_after(&recording, i64::MIN).filter(|hit| hit.stamp_ns < until_ns) {
            until_ns = hit.stamp_ns;
            recording.end_at(until_ns);
        }
        on_step(&recording);
        if recording.runs.iter().all(|run| run.finished || run.ends_at(until_ns)) {
            break;
        }
    }
    for run in &mut recording.runs {
        run.finished = true;
    }
    // The threads read ahead by as much as they are let.
    recording.warnings.retain(|warning| warning.stamp_ns <= until_ns);
    let hit = breakpoints.next_after(&recording, i64::MIN).map(|hit| {
        let values = breakpoints.values_at(&recording, hit);
        BreakpointHit { hit, values, description: breakpoints.describe(&recording, hit) }
    });
    Ok((recording, hit))
}

/// Where [`compute_until`] ended, and what was true there.
#[derive(Clone, Debug, PartialEq)]
pub struct BreakpointHit {
    /// The step.
    pub hit: Hit,
    /// What the condition asks for, with the values of that step.
    pub values: Vec<NamedValue>,
    /// All of it in one line.
    pub description: String,
}

/// Computes every run of the plan and returns all their reports; `on_step` is called after each step.
///
/// `until_ns` ends the work once every run has passed that time (for a picture of one instant).
pub fn compute(
    plan: &SessionPlan,
    until_ns: Option<i64>,
    on_step: &mut dyn FnMut(&Recording),
) -> Result<Recording, SessionError> {
    let mut recording = Recording::new(plan);
    let mut engine = Engine::start(plan, &recording)?;
    engine.no_more_runs();
    while let Some(message) = engine.receive() {
        // Steps after the wanted time would depend on how the threads are scheduled.
        let late = |stamp_ns: i64| until_ns.is_some_and(|until_ns| stamp_ns > until_ns);
        match message {
            EngineMessage::Step { run, record } if late(record.report.stamp_ns) => {
                recording.take(EngineMessage::Finished { run, error: None });
            }
            message => recording.take(message),
        }
        on_step(&recording);
        if recording.runs.iter().all(|run| run.finished) {
            break;
        }
    }
    if let Some(until_ns) = until_ns {
        // The threads read ahead by as much as they are let.
        recording.warnings.retain(|warning| warning.stamp_ns <= until_ns);
    }
    Ok(recording)
}
