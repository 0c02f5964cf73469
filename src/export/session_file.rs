//! Saved sessions as files.

use std::fs;
use std::path::Path;

use super::error::ExportError;
use crate::session::SavedSession;

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
