use crate::flight_log::LogWarning;
use crate::session::record::StepRecord;

/// A message of a thread.
#[derive(Debug)]
pub(in crate::session) enum EngineMessage {
    /// A run has computed a step.
    Step {
        /// Number of the run.
        run: usize,
        /// The step.
        record: Box<StepRecord>,
    },
    /// A run has reached the end of the log, or failed for a reason that no restart cures.
    Finished {
        /// Number of the run.
        run: usize,
        /// Why it ended early.
        error: Option<String>,
    },
    /// The log has something wrong with it.
    Warnings(Vec<LogWarning>),
}
