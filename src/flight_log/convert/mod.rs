//! Conversion of other recorders' logs to flight logs: EuRoC folders, ROS 1 bags, ROS 2 bags, MP4 videos and logs of
//! autopilots in, MCAP out.
//!
//! Messages are converted one after another, so that a bag of any size needs little memory.
//! The report has a row for every topic, with the number of skipped messages and the reason.

mod error;
mod euroc;
mod euroc_sensor;
mod euroc_tables;
mod mcap_segment;
mod options;
mod recording;
mod report;
mod ros1_bag;
mod ros1_message;
mod ros1_record;
mod ros2_bag;
mod sink;
mod source_file;
mod source_kind;
mod sqlite;

use crate::files::RigFile as _;
use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

pub use self::euroc_sensor::{EUROC_GIMBAL, EUROC_GROUND_TRUTH, EUROC_RIG, rig_of_euroc_folder};
pub use error::ConvertError;
pub use options::{AutopilotLog, AutopilotLogKind, ConvertOptions, ForceAgreement, VideoClock};
pub use report::{ConversionReport, ConvertedTopic};
pub use source_kind::{SourceKind, source_kind};

use self::options::TakenRecords;
use super::{FlightLog, LogError, LogWriter, LogWriterOptions};
use crate::geometry::seconds_from_ns;
use crate::sensors::Rig;
use recording::VideoFacts;
use sink::LogSink;

/// Converts `source` into the log `output`, with a rig next to it if the source has a calibration; `progress` is called
/// with the completed fraction, from 0 to 1.
///
/// The log appears under its name only when it is complete.
///
/// # Errors
/// When the source is of no known kind or damaged at its start, when it has no usable message, or when files cannot be
/// read or written. All readable data of a damaged source are converted; notes in the report count the losses.
pub fn convert(source: &Path, output: &Path, progress: &mut dyn FnMut(f64)) -> Result<ConversionReport, ConvertError> {
    convert_with(source, output, &ConvertOptions::default(), &mut |ratio| {
        progress(ratio);
        ControlFlow::Continue(())
    })
}

/// Converts like [`convert`], with options, and stops when `progress` breaks.
///
/// # Errors
/// As [`convert`], [`ConvertError::Interrupted`], in which case no file is written,
/// [`ConvertError::NoVideo`] for options that need a video, and [`ConvertError::NoSuchRecord`].
pub fn convert_with(
    source: &Path,
    output: &Path,
    options: &ConvertOptions,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<ConversionReport, ConvertError> {
    let kind = source_kind(source, &options.limits)?;
    if kind != SourceKind::Video && (options.autopilot.is_some() || options.video_clock.is_some()) {
        return Err(ConvertError::NoVideo { kind: kind.name(), path: source.to_owned() });
    }
    if kind != SourceKind::Ros1Bag && !options.splits.is_empty() {
        return Err(ConvertError::NoSplits { kind: kind.name(), path: source.to_owned() });
    }
    for split in &options.splits {
        let kind = source_kind(split, &options.limits)?;
        if kind != SourceKind::Ros1Bag {
            return Err(ConvertError::NoSplits { kind: kind.name(), path: split.clone() });
        }
    }
    let same = |a: &Path, b: &Path| fs::canonicalize(a).ok().is_some_and(|path| fs::canonicalize(b).ok() == Some(path));
    if same(source, output)
        || output.parent().is_some_and(|folder| kind == SourceKind::Ros2Bag && same(source, folder))
        || options.autopilot.as_ref().is_some_and(|log| same(&log.path, output))
        || options.splits.iter().any(|split| same(split, output))
    {
        return Err(ConvertError::OntoItself { path: output.to_owned() });
    }
    let (mut report, rig) = write(kind, source, output, options, progress)?;
    let log = FlightLog::open(output)?;
    report.duration_s = seconds_from_ns(log.duration_ns());
    report.log = output.to_owned();
    let (text, assumed) = match rig {
        SourceRig::Calibrated(rig) => (Some(rig.to_yaml()), Vec::new()),
        SourceRig::Video(facts) => rig_of_video(&facts, output, &log, &mut report),
        SourceRig::None => (None, Vec::new()),
    };
    if let Some(text) = text {
        let path = output.with_extension("rig.yaml");
        match fs::read(&path) {
            // The file was edited, or is a rig of the user.
            Ok(existing) if existing != text.as_bytes() => report.notes.push(format!(
                "the rig next to the log is kept; it differs from the calibration of the source: {}",
                path.display()
            )),
            Ok(_) => report.notes.extend(assumed),
            Err(_) => {
                crate::files::output::write_file(&path, text.as_bytes()).map_err(|source| LogError::Io {
                    action: "write the rig",
                    source,
                    path: path.clone(),
                })?;
                report.notes.extend(assumed);
            }
        }
        report.rig = Some(path);
    } else if output.with_extension("rig.yaml").is_file() {
        report.rig = Some(output.with_extension("rig.yaml"));
    } else if let Some(beside) = rig_beside(source) {
        report.notes.push(format!(
            "the rig of the source is not copied: use it with --rig, or copy it to {}: {}",
            output.with_extension("rig.yaml").display(),
            beside.display()
        ));
    } else if log.attachment(".rig.yaml").is_none() {
        report.notes.push(format!(
            "the source has no rig: write {} (or a Kalibr camchain-imucam.yaml for --rig) before running on it",
            output.with_extension("rig.yaml").display()
        ));
    }
    Ok(report)
}

/// Rig file next to a source that is a file.
fn rig_beside(source: &Path) -> Option<PathBuf> {
    Some(source.with_extension("rig.yaml")).filter(|path| path.is_file())
}

enum SourceRig {
    None,
    /// Rig with a complete calibration.
    Calibrated(Box<Rig>),
    /// Facts about a video, from which a rig with otherwise assumed fields is written.
    Video(VideoFacts),
}

/// Returns the text of a video's rig and adds its assumptions as notes; `None` if no rig can be written.
fn rig_of_video(
    facts: &VideoFacts,
    output: &Path,
    log: &FlightLog,
    report: &mut ConversionReport,
) -> (Option<String>, Vec<String>) {
    let name = output.file_stem().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    match facts.template(&name, log) {
        Ok(template) => {
            let fields: Vec<String> = template.assumed_fields().into_iter().map(|assumed| assumed.field).collect();
            let note = format!(
                "the rig assumes {}; `dcvins check` reports each, and `dcvins rig new --camera … --force` writes another one",
                fields.join(", ")
            );
            (Some(template.to_yaml()), vec![note])
        }
        Err(error) => {
            report.notes.push(format!("no rig is written: {error}"));
            (None, Vec::new())
        }
    }
}

/// Writes the log; returns the result of each topic, and the rig if the source describes one.
fn write(
    kind: SourceKind,
    source: &Path,
    output: &Path,
    options: &ConvertOptions,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<(ConversionReport, SourceRig), ConvertError> {
    let limits = &options.limits;
    let writer = LogWriter::create(output, &LogWriterOptions::default())?;
    let records = TakenRecords::new(options.take.clone());
    if !matches!(kind, SourceKind::Video | SourceKind::Autopilot(_)) {
        records.require_all(source)?;
    }
    let mut sink = LogSink::new(writer, limits.clone(), records, progress);
    let rig = match kind {
        SourceKind::Euroc => {
            let rig = euroc::convert(source, &mut sink)?;
            rig.map_or(SourceRig::None, |rig| SourceRig::Calibrated(Box::new(rig)))
        }
        SourceKind::Ros1Bag => {
            for path in std::iter::once(source).chain(options.splits.iter().map(PathBuf::as_path)) {
                let bag = ros1_bag::open(path, &sink)?;
                ros1_bag::convert(&bag, &mut sink)?;
            }
            SourceRig::None
        }
        SourceKind::Ros2Bag => ros2_bag::convert(source, &mut sink).map(|()| SourceRig::None)?,
        SourceKind::Sqlite => {
            let database = sqlite::open(source, limits)?;
            sqlite::convert(&database, &mut sink).map(|()| SourceRig::None)?
        }
        SourceKind::PackedSqlite => {
            let plain = ros2_bag::unpack_to_path(source, limits)?;
            let database = sqlite::open(plain.path(), limits)?;
            sqlite::convert(&database, &mut sink).map(|()| SourceRig::None)?
        }
        SourceKind::Mcap => {
            let file = mcap_segment::open(source, &sink)?;
            mcap_segment::convert(&file, source, &mut sink).map(|()| SourceRig::None)?
        }
        SourceKind::Video => SourceRig::Video(recording::convert_video(source, options, &mut sink)?),
        SourceKind::Autopilot(kind) => {
            let log = AutopilotLog { kind, path: source.to_owned() };
            recording::convert_autopilot(&log, &mut sink).map(|()| SourceRig::None)?
        }
    };
    let report = sink.finish(kind.name(), source)?;
    Ok((report, rig))
}
