//! Saved sessions as files, on logs that are converted again when they are no longer in the cache.

use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::error::ExportError;
use super::posterior::read_prior;
use super::sources::{ConversionStage, ConvertedLogs, LogSources, SourceError, prepare_log};
use crate::files::LogLimits;
use crate::session::{SavedLog, SavedSession, Session};

/// Reads a saved session.
///
/// # Errors
/// If the file cannot be read, or is not a session that this version can read.
pub fn read_session(path: &Path) -> Result<SavedSession, ExportError> {
    let text = fs::read_to_string(path).map_err(|source| ExportError::Read { source, path: path.to_owned() })?;
    SavedSession::from_text(&text)
        .map_err(|problem| ExportError::Session { problem: Box::new(problem), path: path.to_owned() })
}

/// Starts the runs of a saved session, from the calibration of earlier flights if it has one; `path` is the session's
/// file.
///
/// # Errors
/// If the log or that calibration cannot be opened, or an entry of the session is invalid.
pub fn open_session(saved: &SavedSession, path: &Path) -> Result<Session, ExportError> {
    let prior = saved.prior.as_ref().map(|prior| read_prior(&prior.folder, prior.growth)).transpose()?;
    saved
        .open(prior.map(Arc::new))
        .map_err(|problem| ExportError::Session { problem: Box::new(problem), path: path.to_owned() })
}

/// The session with a log that exists: one that was converted from a recording, and is no longer in the cache, is
/// converted again, and its rig is looked up next to the new log if it lay next to the old one. Other sessions are returned
/// unchanged, also without their log.
///
/// # Errors
/// When the recording cannot be found or converted.
pub fn prepare_session(
    saved: SavedSession,
    cache: Result<&ConvertedLogs, &'static str>,
    limits: &LogLimits,
    progress: &mut dyn FnMut(&LogSources, ConversionStage, f64) -> ControlFlow<()>,
) -> Result<SavedSession, SourceError> {
    if saved.recording.is_empty() || saved.log.path.is_file() {
        return Ok(saved);
    }
    let gathered = LogSources::gather(&saved.recording, limits)?;
    let sources = LogSources { rig: saved.rig.clone().filter(|rig| rig.is_file()), ..gathered };
    let prepared = prepare_log(&sources, cache, limits, &mut |stage, ratio| progress(&sources, stage, ratio))?;
    let entry = saved.log.path.parent().map(Path::to_owned);
    let moved = |path: PathBuf| match path.file_name() {
        Some(name) if path.parent() == entry.as_deref() => prepared.log.with_file_name(name),
        _ => path,
    };
    Ok(SavedSession {
        rig: saved.rig.map(moved),
        ground_truth: saved.ground_truth.map(moved),
        log: SavedLog { path: prepared.log, ..saved.log },
        ..saved
    })
}
