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
    #[error("run '{run}' needs {wanted}, but the rig '{rig}' has only {present}")]
    NoCamera { run: String, wanted: String, rig: String, present: String },
    #[error("{count} runs requested, at most {MAX_RUNS} are possible")]
    TooManyRuns { count: usize },
    #[error("{count} trajectories requested, at most {MAX_TRAJECTORIES} are possible")]
    TooManyTrajectories { count: usize },
    #[error("cannot use the trajectory '{source_name}': {problem}")]
    Trajectory {
        /// The file or topic.
        source_name: String,
        problem: String,
    },
    #[error("--start {start_s} s is after the end of the log ({end_s:.3} s): {}", path.display())]
    StartBeyondEnd {
        start_s: f64,
        /// Length of the log in seconds.
        end_s: f64,
        path: PathBuf,
    },
    /// The posterior of earlier flights belongs to another mechanism.
    #[error("this prior does not fit {user}: {problem}: {}", folder.display())]
    Prior { user: String, problem: String, folder: PathBuf },
    #[error("cannot use the required accuracy: {problem}")]
    RequiredAccuracy { problem: String },
    #[error("no motion can be planned for the run '{run}': {problem}")]
    Unplannable { run: String, problem: String },
    #[error("cannot start a thread: {source}")]
    Thread { source: std::io::Error },
}
