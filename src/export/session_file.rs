//! Saved sessions as files.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use super::error::ExportError;
use super::posterior::read_prior;
use crate::session::{SavedSession, Session};

/// True for the path of a saved session, `*.session.json`.
pub fn is_session(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().ends_with(".session.json"))
}

/// Reads a saved session.
///
/// # Errors
/// If the file cannot be read, or is not a session that this version can read.
pub fn read_session(path: &Path) -> Result<SavedSession, ExportError> {
    let text = fs::read_to_string(path).map_err(|source| ExportError::Read { source, path: path.to_owned() })?;
    SavedSession::from_text(&text)
        .map_err(|problem| ExportError::Session { problem: Box::new(problem), path: path.to_owned() })
}

/// Starts the runs of a saved session, from the calibration of earlier flights if it has one; `path` is that of the session.
///
/// # Errors
/// If the log or that calibration cannot be opened, or an entry of the session is invalid.
pub fn open_session(saved: &SavedSession, path: &Path) -> Result<Session, ExportError> {
    let prior = saved.prior.as_ref().map(|prior| read_prior(&prior.folder, prior.growth)).transpose()?;
    saved
        .open(prior.map(Arc::new))
        .map_err(|problem| ExportError::Session { problem: Box::new(problem), path: path.to_owned() })
}
