use crate::flight_log::LogWarning;
use crate::session::record::{PassProgress, StepRecord};

/// A message from a thread of the engine to the collector.
#[derive(Debug)]
pub(in crate::session) enum EngineMessage {
    /// A run has computed a step.
    Step {
        /// Index of the run.
        run: usize,
        /// The step.
        record: Box<StepRecord>,
    },
    /// A run with several passes is at a stamp of a pass before the last one.
    Pass {
        /// Index of the run.
        run: usize,
        /// The pass and the stamp.
        progress: PassProgress,
    },
    /// A run has reached the end of the log, or has failed without a possible restart.
    Finished {
        /// Index of the run.
        run: usize,
        /// The reason of an early end.
        error: Option<String>,
    },
    /// New warnings about the log.
    Warnings(Vec<LogWarning>),
}
