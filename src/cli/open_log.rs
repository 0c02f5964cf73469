//! Opening of logs, sessions and recordings for the window.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use dcvins::export::{
    ConvertedLogs, LogSources, PreparedLog, SourceError, check_log, is_session, open_session, prepare_log,
    prepare_session, read_session,
};
use dcvins::files::LogLimits;
use dcvins::flight_log::convert::SourceKind;
use dcvins::flight_log::{FlightLog, FollowOptions, LogError, missing_sensors, rig_candidates};
use dcvins::gui::app::{OpenFailure, OpenProgress, OpenRequest, OpenedLog, RigQuestion};
use dcvins::session::{Session, SessionError, SessionPlan, SessionRequest};
use dcvins::text::log_name;

use crate::cli::estimation_arguments::EstimationArguments;
use crate::cli::prepared_log::{converted_logs, stage_text};
use crate::cli::result_cache::CacheArguments;

/// Time between two looks for a file that does not exist yet.
const FILE_POLL: Duration = Duration::from_millis(100);
/// Largest number of notes of a conversion that are shown; its report has all.
const SHOWN_NOTES: usize = 3;

/// Opens what a person has asked for: a log and a session directly, a recording after its conversion.
///
/// # Errors
/// With the reason, or with the question for a rig.
pub(crate) fn open_log(
    request: &OpenRequest,
    estimation: &EstimationArguments,
    following: Option<&(PathBuf, FollowOptions)>,
    progress: &mut dyn FnMut(OpenProgress) -> ControlFlow<()>,
) -> Result<OpenedLog, OpenFailure> {
    let limits = estimation.limits.limits();
    let following = following.filter(|(path, _)| request.sources.first() == Some(path));
    if let Some((path, options)) = following {
        wait_for_file(path, options, progress)?;
    }
    let sources = LogSources::gather(&request.sources, &limits).map_err(|error| failure(&error))?;
    let cache = converted_logs();
    if is_session(&sources.main) {
        let problem = |text: String| OpenFailure::Problem(text);
        let saved = read_session(&sources.main).map_err(|error| problem(error.to_string()))?;
        let saved =
            prepare_session(saved, cache.as_ref().map_err(|reason| *reason), &limits, &mut |of, stage, ratio| {
                progress(OpenProgress { text: stage_text(stage, of), ratio: Some(ratio) })
            });
        let saved = saved.map_err(|error| failure(&error))?;
        let mut session = open_session(&saved, &sources.main).map_err(|error| problem(error.to_string()))?;
        check(&mut session).map_err(|error| problem(error.to_string()))?;
        return Ok(OpenedLog { log: Box::new(session), remembered: sources.main, notices: Vec::new() });
    }
    let sources = LogSources { rig: request.rig.clone().or(sources.rig), ..sources };
    let prepared = prepare_log(&sources, cache.as_ref().map_err(|reason| *reason), &limits, &mut |stage, ratio| {
        progress(OpenProgress { text: stage_text(stage, &sources), ratio: Some(ratio) })
    });
    let prepared = prepared.map_err(|error| failure(&error))?;
    let of_recording = cache.as_ref().map_or_else(|_| Vec::new(), |cache| cache.sources_of(&prepared.log));
    // The rig that was written next to the recording, for a log that is opened from the cache by its own path.
    let beside = of_recording.first().map(|path| ConvertedLogs::path_beside(path, "rig.yaml"));
    let beside = beside.filter(|path| path.is_file());
    let session_request = SessionRequest {
        recording: of_recording.clone(),
        rig_path: prepared.rig.clone().or_else(|| estimation.rig.clone()).or(beside),
        ground_truth_path: prepared.ground_truth.clone().or_else(|| estimation.ground_truth.clone()),
        following: following.map(|(_, options)| options.clone()),
        ..estimation.request(prepared.log.clone()).map_err(|error| OpenFailure::Problem(error.to_string()))?
    };
    if session_request.rig_path.is_none() && sources.kind == Some(SourceKind::Video) {
        // The conversion of a video writes a rig whose values are assumed; they are shown before they are used.
        return Err(rig_question(request, &sources, &prepared, &of_recording, &limits));
    }
    let started = SessionPlan::open(&session_request).and_then(|plan| {
        let mut session = Session::start(plan)?;
        check(&mut session)?;
        Ok(session)
    });
    match started {
        Ok(session) => {
            let remembered =
                if sources.splits.is_empty() && sources.autopilot.is_none() { sources.main } else { prepared.log };
            let notices = conversion_notice(prepared.kind, &prepared.notes, &log_name(&remembered));
            Ok(OpenedLog { log: Box::new(session), remembered, notices })
        }
        Err(SessionError::Log(LogError::NoRig { .. })) => {
            Err(rig_question(request, &sources, &prepared, &of_recording, &limits))
        }
        Err(error) => Err(OpenFailure::Problem(error.to_string())),
    }
}

/// Waits until the file of a log that will be written is there.
fn wait_for_file(
    path: &Path,
    options: &FollowOptions,
    progress: &mut dyn FnMut(OpenProgress) -> ControlFlow<()>,
) -> Result<(), OpenFailure> {
    while path.metadata().is_ok_and(|metadata| metadata.len() == 0) || !path.exists() {
        let text = match &options.reception {
            None => format!("Waiting for {}", log_name(path)),
            Some(reception) if reception.is_over() => {
                return Err(OpenFailure::Problem(reception.events().join("\n")));
            }
            Some(reception) => match reception.problem() {
                Some(problem) => format!("Waiting for {} ({problem})", reception.address()),
                None => format!("Waiting for the topics of {}", reception.address()),
            },
        };
        if progress(OpenProgress { text, ratio: None }).is_break() {
            return Err(OpenFailure::Cancelled);
        }
        std::thread::sleep(FILE_POLL);
    }
    Ok(())
}

/// Checks the log of a session in the background.
fn check(session: &mut Session) -> Result<(), SessionError> {
    let cache = CacheArguments::default().cache();
    session.check_in_background(move |log, rig| check_log(cache.as_ref(), log, rig))
}

fn failure(error: &SourceError) -> OpenFailure {
    if error.is_interrupted() { OpenFailure::Cancelled } else { OpenFailure::Problem(error.to_string()) }
}

/// Notice about a conversion made now; none for a log of the cache.
fn conversion_notice(kind: Option<&str>, notes: &[String], name: &str) -> Vec<String> {
    let (Some(kind), false) = (kind, notes.is_empty()) else { return Vec::new() };
    let shown: Vec<&str> = notes.iter().take(SHOWN_NOTES).map(String::as_str).collect();
    let more = notes.len().saturating_sub(SHOWN_NOTES);
    let more = if more > 0 { format!("\n{more} more in report.txt next to the log") } else { String::new() };
    vec![format!("Converted {name} ({kind})\n{}{more}", shown.join("\n"))]
}

/// Question for the rig of a log, or the reason why no rig helps.
fn rig_question(
    request: &OpenRequest,
    sources: &LogSources,
    prepared: &PreparedLog,
    of_recording: &[PathBuf],
    limits: &LogLimits,
) -> OpenFailure {
    let log = match FlightLog::open_with(&prepared.log, limits) {
        Ok(log) => Arc::new(log),
        Err(error) => return OpenFailure::Problem(error.to_string()),
    };
    // A log of the cache stands for the recording from which it was made.
    let source = of_recording.first().unwrap_or(&sources.main);
    let name = log_name(source);
    let kind = prepared.kind.unwrap_or("flight log");
    if let Some(missing) = missing_sensors(&log) {
        return OpenFailure::Problem(format!("{name} ({kind}): {missing}"));
    }
    let mut folders: Vec<PathBuf> = Vec::new();
    for path in std::iter::once(&prepared.log).chain(&request.sources).chain(of_recording) {
        let folder = path.parent().map(std::path::Path::to_owned).unwrap_or_default();
        if !folders.contains(&folder) {
            folders.push(folder);
        }
    }
    let candidates = rig_candidates(&log, &folders);
    let new_rig = ConvertedLogs::path_beside(source, "rig.yaml");
    let reason = if sources.kind == Some(SourceKind::Video) {
        format!("{name} says little about its camera: choose a rig, confirm the assumed one, or describe it")
    } else {
        format!("{name} ({kind}) has no rig: none given, none at {}, none attached", new_rig.display())
    };
    OpenFailure::NeedsRig(Box::new(RigQuestion { log, request: request.clone(), reason, candidates, new_rig }))
}
