use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::flight_log::LogError;
use crate::session::SavedSessionError;

/// The reason why a file could not be written or evaluated.
#[derive(Debug, Error)]
pub enum ExportError {
    /// A file or folder could not be written.
    #[error("cannot write: {source}: {path}")]
    Write {
        /// The error of the operating system.
        source: io::Error,
        /// Path of the file or folder.
        path: PathBuf,
    },
    /// The folder or file holds something else than results that may be replaced.
    #[error("{problem}; give --force to overwrite, or another place to write to: {path}")]
    Existing {
        /// What is there.
        problem: String,
        /// Where.
        path: PathBuf,
    },
    /// A file could not be read.
    #[error("cannot read: {source}: {path}")]
    Read {
        /// The error of the operating system.
        source: io::Error,
        /// Path of the file.
        path: PathBuf,
    },
    /// A file is no saved session that this version can read.
    #[error("cannot open: {problem}: {path}")]
    Session {
        /// The problem.
        problem: Box<SavedSessionError>,
        /// Path of the file.
        path: PathBuf,
    },
    /// An MCAP file could not be written.
    #[error(transparent)]
    Log(#[from] LogError),
    /// Two trajectories cannot be compared.
    #[error("{problem}")]
    NotComparable {
        /// The problem and its remedy.
        problem: String,
    },
}

impl ExportError {
    /// For `map_err` behind [`OutputSet::commit`](crate::flight_log::output::OutputSet::commit).
    pub(crate) fn commit((path, source): (PathBuf, io::Error)) -> Self {
        Self::Write { source, path }
    }

    /// For `map_err` of a write.
    pub(crate) fn write(path: &Path) -> impl FnOnce(io::Error) -> Self + '_ {
        move |source| Self::Write { source, path: path.to_owned() }
    }
}
