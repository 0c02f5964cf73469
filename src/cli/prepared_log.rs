//! Sources of commands: a recording is converted into the cache folder before the command runs on its log.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use anyhow::Result;
use dcvins::export::{ConversionStage, ConvertedLogs, LogSources, PreparedLog, SourceError, prepare_log};
#[cfg(feature = "gui")]
use dcvins::export::{prepare_session, read_session};
use dcvins::files::LogLimits;
use dcvins::flight_log::convert::ConvertError;
#[cfg(feature = "gui")]
use dcvins::session::SavedSession;
use dcvins::text::log_name;

use crate::cli::estimation_arguments::EstimationArguments;
use crate::cli::interrupt::Interrupt;
use crate::cli::result_cache::FOLDER_VARIABLE;
use crate::cli::terminal::{Progress, notify};

/// Folder of converted logs, or the reason why there is none.
pub(crate) fn converted_logs() -> Result<ConvertedLogs, &'static str> {
    match std::env::var_os(FOLDER_VARIABLE) {
        Some(folder) if folder.is_empty() => Err("DCVINS_CACHE_DIR is empty"),
        Some(folder) => Ok(ConvertedLogs::in_folder(Path::new(&folder))),
        None => ConvertedLogs::of_user().ok_or("the user has no home folder"),
    }
}

/// Work of a conversion in a few words.
pub(crate) fn stage_text(stage: ConversionStage, sources: &LogSources) -> String {
    let name = log_name(&sources.main);
    match (stage, &sources.autopilot) {
        (ConversionStage::Aligning, Some(log)) => format!("Aligning {name} with {}", log_name(&log.path)),
        (ConversionStage::Aligning, None) => format!("Aligning {name}"),
        (ConversionStage::Converting, _) => {
            let kind = sources.kind.map_or("log", |kind| kind.name());
            format!("Converting {name} ({kind})")
        }
    }
}

/// Flight log of the sources of a command, and its arguments with the rigs found with the sources. Notes of a conversion
/// go to standard error.
///
/// # Errors
/// When the sources cannot be opened or converted, or after Ctrl+C.
pub(crate) fn prepared_log(
    sources: &[PathBuf],
    estimation: &EstimationArguments,
) -> Result<(PathBuf, EstimationArguments)> {
    let prepared = prepare(sources, estimation.rig.as_deref(), &estimation.limits.limits())?;
    let estimation = EstimationArguments {
        rig: estimation.rig.clone().or(prepared.rig),
        ground_truth: estimation.ground_truth.clone().or(prepared.ground_truth),
        ..estimation.clone()
    };
    Ok((prepared.log, estimation))
}

/// Flight log of the sources, with a progress bar; `rig` is given by the user.
pub(crate) fn prepare(sources: &[PathBuf], rig: Option<&Path>, limits: &LogLimits) -> Result<PreparedLog> {
    // A file that does not exist, and all that is no recording, is reported by the reader of logs.
    if let [only] = sources
        && !is_recording(only, limits)
    {
        return Ok(PreparedLog { log: only.clone(), rig: None, ground_truth: None, kind: None, notes: Vec::new() });
    }
    let mut gathered = LogSources::gather(sources, limits)?;
    gathered.rig = rig.map(Path::to_owned).or(gathered.rig);
    let cache = converted_logs();
    let prepared = watched(&gathered.main, |progress| {
        Ok(prepare_log(&gathered, cache.as_ref().map_err(|reason| *reason), limits, &mut |stage, ratio| {
            progress(&gathered, stage, ratio)
        })?)
    })?;
    if !prepared.notes.is_empty() {
        let kind = prepared.kind.unwrap_or("recording");
        notify(&format!("dcvins: converted {} ({kind}) into {}", log_name(&gathered.main), prepared.log.display()));
        for note in &prepared.notes {
            notify(&format!("  note: {note}"));
        }
    }
    Ok(prepared)
}

/// Saved session whose log exists; it is converted again, with a progress bar, if it is no longer in the cache.
///
/// # Errors
/// When the file is no session, its recording cannot be converted, or after Ctrl+C.
#[cfg(feature = "gui")]
pub(crate) fn prepared_session(path: &Path, limits: &LogLimits) -> Result<SavedSession> {
    let (saved, cache) = (read_session(path)?, converted_logs());
    watched(path, |progress| Ok(prepare_session(saved, cache.as_ref().map_err(|reason| *reason), limits, progress)?))
}

/// Receives the stage of the conversion of sources and the completed fraction.
type ConversionProgress<'a> = dyn FnMut(&LogSources, ConversionStage, f64) -> ControlFlow<()> + 'a;

/// Result of a conversion of `source` that shows its progress and ends at Ctrl+C.
fn watched<T>(source: &Path, convert: impl FnOnce(&mut ConversionProgress<'_>) -> Result<T>) -> Result<T> {
    let interrupt = Interrupt::watch()?;
    let progress = Progress::new();
    let converted = convert(&mut |of, stage, ratio| {
        progress.show(ratio, || stage_text(stage, of));
        interrupt.control_flow()
    })?;
    drop(progress);
    if interrupt.is_set() {
        // A signal after the last progress of the conversion: its log is kept, and the command does not begin.
        return Err(SourceError::from(ConvertError::Interrupted { path: source.to_owned() }).into());
    }
    interrupt.release();
    Ok(converted)
}

/// True for a recording that has to be converted.
fn is_recording(path: &Path, limits: &LogLimits) -> bool {
    LogSources::gather(&[path.to_owned()], limits).is_ok_and(|sources| sources.kind.is_some())
}
