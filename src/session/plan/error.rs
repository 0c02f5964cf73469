//! Errors of the start of a session.

use std::path::PathBuf;

use thiserror::Error;

use super::run_spec::MAX_RUNS;
use super::trajectory_spec::MAX_TRAJECTORIES;
use crate::flight_log::LogError;

/// Reason why a session cannot start.
#[derive(Debug, Error)]
pub enum SessionError {
    /// The log, its rig or its ground truth cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// The rig has no camera for the run.
    #[error("run '{run}' needs {wanted}, but the rig '{rig}' has only {present}")]
    NoCamera {
        run: String,
        /// Description of the required camera.
        wanted: String,
        rig: String,
        /// Keys and kinds of the rig's cameras.
        present: String,
    },
    /// More than [`MAX_RUNS`] runs.
    #[error("{count} runs requested, at most {MAX_RUNS} are possible")]
    TooManyRuns {
        /// Requested number of runs.
        count: usize,
    },
    /// More than [`MAX_TRAJECTORIES`] trajectories.
    #[error("{count} trajectories requested, at most {MAX_TRAJECTORIES} are possible")]
    TooManyTrajectories {
        /// Requested number of trajectories.
        count: usize,
    },
    /// A trajectory cannot be used with the log.
    #[error("cannot use the trajectory '{source_name}': {problem}")]
    Trajectory {
        /// The file or topic.
        source_name: String,
        /// Problem and remedy.
        problem: String,
    },
    /// The start is after the end of the log.
    #[error("--start {start_s} s is after the end of the log ({end_s:.3} s): {}", path.display())]
    StartBeyondEnd {
        /// Requested start in seconds.
        start_s: f64,
        /// Length of the log in seconds.
        end_s: f64,
        path: PathBuf,
    },
    /// A thread could not be started.
    #[error("cannot start a thread: {source}")]
    Thread {
        /// The error of the operating system.
        source: std::io::Error,
    },
}
