use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::files::FileError;
use crate::flight_log::LogError;
use crate::session::SavedSessionError;

/// Reason why a file could not be written or evaluated.
#[derive(Debug, Error)]
pub enum ExportError {
    #[error("cannot write: {source}: {path}")]
    Write { source: io::Error, path: PathBuf },
    /// The folder or file contains something other than results that may be replaced.
    #[error("{problem}; give --force to overwrite, or another output path: {path}")]
    Existing { problem: String, path: PathBuf },
    #[error("cannot read: {source}: {path}")]
    Read { source: io::Error, path: PathBuf },
    /// A file is not a saved session that this version can read.
    #[error("cannot open: {problem}: {path}")]
    Session { problem: Box<SavedSessionError>, path: PathBuf },
    /// A file is not a motion of joints and vehicle.
    #[error("cannot read the motion: {problem}: {path}")]
    Motion { problem: String, path: PathBuf },
    /// A file is not the posterior of a calibration.
    #[error("cannot start from this calibration: {problem}: {path}")]
    Posterior { problem: String, path: PathBuf },
    /// Folders have no calibrations that can be compared.
    #[error("no calibration to compare: {problem}: {path}")]
    History { problem: String, path: PathBuf },
    #[error(transparent)]
    Log(#[from] LogError),
    #[error(transparent)]
    File(#[from] FileError),
    /// Two trajectories cannot be compared.
    #[error("{problem}")]
    NotComparable { problem: String },
}

impl ExportError {
    /// For `map_err` behind [`OutputSet::commit`](crate::files::output::OutputSet::commit).
    pub(crate) fn commit((path, source): (PathBuf, io::Error)) -> Self {
        Self::Write { source, path }
    }

    /// For `map_err` of a write.
    pub(crate) fn write(path: &Path) -> impl FnOnce(io::Error) -> Self + '_ {
        move |source| Self::Write { source, path: path.to_owned() }
    }
}
