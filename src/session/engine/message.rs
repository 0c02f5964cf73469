use std::sync::Arc;

use crate::estimator::CalibrationPosterior;
use crate::flight_log::LogWarning;
use crate::session::record::{PassProgress, StepRecord};

/// A message from a thread of the engine to the collector.
#[derive(Debug)]
pub(in crate::session) enum EngineMessage {
    /// A run has computed a step.
    Step {
        run: usize,
        record: Box<StepRecord>,
    },
    /// A run with several passes is at a stamp of a pass before the last one.
    Pass {
        run: usize,
        progress: PassProgress,
    },
    /// A run has reached the end of the log, or has failed without a possible restart.
    Finished {
        run: usize,
        /// Reason of an early end, `None` at the end of the log.
        error: Option<String>,
        /// Calibration at its end, `None` without a window or with a fixed calibration.
        posterior: Option<Arc<CalibrationPosterior>>,
    },
    Warnings(Vec<LogWarning>),
}
