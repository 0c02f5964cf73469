//! Conversion of sources into a log of the cache folder.

use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use super::{ConvertedLogs, LogSources, SourceError};
use crate::export::video_alignment::{align_video, write_alignment_plot};
use crate::files::LogLimits;
use crate::flight_log::convert::{ConversionReport, ConvertOptions, SourceKind, convert_with};
use crate::text::log_name;

/// Fraction of the progress that the alignment of a video with the log of its autopilot takes.
const ALIGNED: f64 = 0.5;
/// File of an entry with the report of the conversion.
const REPORT: &str = "report.txt";

/// Step of a conversion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConversionStage {
    /// A video is aligned with the log of its autopilot.
    Aligning,
    Converting,
}

/// A flight log made of sources, with the rigs found with them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PreparedLog {
    pub log: PathBuf,
    /// Rig given or found beside the sources; `None` leaves the search to the log.
    pub rig: Option<PathBuf>,
    pub ground_truth: Option<PathBuf>,
    /// Name of the kind of a converted recording; `None` for a flight log.
    pub kind: Option<&'static str>,
    /// Notes of a conversion made now; empty if the log was in the cache.
    pub notes: Vec<String>,
}

/// Returns the flight log of the sources; a recording is converted into the cache folder unless its log is there.
/// `progress` is called with the completed fraction, from 0 to 1, and stops the conversion when it breaks.
///
/// # Errors
/// When the sources cannot be converted, or the folder cannot be written.
pub fn prepare_log(
    sources: &LogSources,
    cache: Result<&ConvertedLogs, &'static str>,
    limits: &LogLimits,
    progress: &mut dyn FnMut(ConversionStage, f64) -> ControlFlow<()>,
) -> Result<PreparedLog, SourceError> {
    let mut prepared = PreparedLog {
        log: sources.main.clone(),
        rig: sources.rig.clone(),
        ground_truth: sources.ground_truth.clone(),
        kind: sources.kind.map(SourceKind::name),
        notes: Vec::new(),
    };
    if sources.kind.is_none() {
        return Ok(prepared);
    }
    let cache = cache.map_err(|reason| SourceError::NoCache { reason, path: sources.main.clone() })?;
    let found = |ending: &str| Some(ConvertedLogs::path_beside(&sources.main, ending)).filter(|path| path.is_file());
    prepared.rig = prepared.rig.or_else(|| found("rig.yaml"));
    prepared.ground_truth = prepared.ground_truth.or_else(|| found("truth.yaml"));
    let with_rig = LogSources { rig: prepared.rig.clone(), ..sources.clone() };
    let entry = cache.entry_of(&with_rig, &format!("{:?} {limits:?}", sources.kind))?;
    let name = format!("{}.mcap", stem_of(&sources.main));
    prepared.log = entry.join(&name);
    if cache.take(&entry) && prepared.log.is_file() {
        return Ok(prepared);
    }
    let unfinished = cache.unfinished()?;
    let output = unfinished.path().join(&name);
    let report = converted(&with_rig, &output, limits, progress)?;
    let (written, kept) = (unfinished.path().display().to_string(), entry.display().to_string());
    let text = report.to_string().replace(&written, &kept);
    fs::write(unfinished.path().join(REPORT), text).map_err(SourceError::cache("write the report", &entry))?;
    prepared.notes = report.notes.iter().map(|note| note.replace(&written, &kept)).collect();
    cache.finish(unfinished, &entry, sources)?;
    Ok(prepared)
}

/// Converts the sources; a video is first aligned with the log of its autopilot.
fn converted(
    sources: &LogSources,
    output: &Path,
    limits: &LogLimits,
    progress: &mut dyn FnMut(ConversionStage, f64) -> ControlFlow<()>,
) -> Result<ConversionReport, SourceError> {
    let mut options = ConvertOptions {
        limits: limits.clone(),
        splits: sources.splits.clone(),
        autopilot: sources.autopilot.clone(),
        ..ConvertOptions::default()
    };
    let mut alignment = None;
    if options.autopilot.is_some() {
        let found = align_video(&sources.main, output, sources.rig.as_deref(), &options, &mut |ratio| {
            progress(ConversionStage::Aligning, ALIGNED * ratio)
        })?;
        options.video_clock = Some(alignment.insert(found).clock);
    }
    let start = if alignment.is_some() { ALIGNED } else { 0.0 };
    let mut report = convert_with(&sources.main, output, &options, &mut |ratio| {
        progress(ConversionStage::Converting, start + (1.0 - start) * ratio)
    })?;
    if let Some(alignment) = &alignment {
        let plot = output.with_extension("alignment.svg");
        write_alignment_plot(alignment, &plot)?;
        report.notes.insert(0, alignment.to_string());
    }
    // Rigs are searched with the sources, not next to a log of the cache.
    report
        .notes
        .retain(|note| !note.starts_with("the source has no rig") && !note.starts_with("the rig of the source"));
    Ok(report)
}

/// Name of the log of a source, without its extension.
fn stem_of(source: &Path) -> String {
    // A folder such as `.` has no name of its own.
    let source = fs::canonicalize(source).unwrap_or_else(|_| source.to_owned());
    if source.is_dir() {
        return log_name(&source);
    }
    let stem = source.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    stem.filter(|stem| !stem.is_empty()).unwrap_or_else(|| "log".to_owned())
}
