use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::flight_log::LogError;
use crate::session::SavedSessionError;

/// Why something could not be written or evaluated.
#[derive(Debug, Error)]
pub enum ExportError {
    /// A file or folder could not be written.
    #[error("cannot write: {source}: {path}")]
    Write {
        /// What the system said.
        source: io::Error,
        /// Which file.
        path: PathBuf,
    },
    /// A file could not be read.
    #[error("cannot read: {source}: {path}")]
    Read {
        /// What the system said.
        source: io::Error,
        /// Which file.
        path: PathBuf,
    },
    /// A file is no saved session that this version reads.
    #[error("cannot open: {problem}: {path}")]
    Session {
        /// What is wrong with it.
        problem: Box<SavedSessionError>,
        /// Which file.
        path: PathBuf,
    },
    /// An MCAP file could not be written.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A line of a trajectory is not `t x y z qx qy qz qw`.
    #[error("line {line} {problem}; expected 't x y z qx qy qz qw': {path}")]
    TrajectoryLine {
        /// Line number from 1.
        line: usize,
        /// What is wrong with it.
        problem: String,
        /// Which file.
        path: PathBuf,
    },
    /// Two trajectories cannot be compared.
    #[error("{problem}")]
    NotComparable {
        /// Why, and what to do.
        problem: String,
    },
}

impl ExportError {
    /// For `map_err` behind a write.
    pub(super) fn write(path: &Path) -> impl FnOnce(io::Error) -> Self + '_ {
        move |source| Self::Write { source, path: path.to_owned() }
    }
}
