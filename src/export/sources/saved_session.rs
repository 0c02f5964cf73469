//! Saved sessions on logs of the cache folder, which are converted again when their entry is gone.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use super::{ConversionStage, ConvertedLogs, LogSources, SourceError, prepare_log};
use crate::flight_log::LogLimits;
use crate::session::{SavedLog, SavedSession};

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
