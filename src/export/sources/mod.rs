//! Files that a person opens together, as one log: a flight log, a recording of another recorder with its rig, or a video
//! with the log of its autopilot.
//!
//! A recording is converted into the cache folder of the user; the next time its log is found there.

mod converted_logs;
mod error;
mod prepare;
#[cfg(test)]
mod tests;

use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

pub use self::converted_logs::ConvertedLogs;
pub use self::error::SourceError;
pub use self::prepare::{ConversionStage, PreparedLog, prepare_log};
use crate::files::LogLimits;
use crate::flight_log::convert::{AutopilotLog, SourceKind, source_kind};
use crate::flight_log::{is_imu_file_of, is_rig_name};
use crate::text::log_name;

/// Endings of rigs, in lower case.
const RIG_ENDINGS: [&str; 2] = ["yaml", "yml"];
/// Ending of a file with a ground-truth rig.
const TRUTH_ENDING: &str = ".truth.yaml";

/// The files of one log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogSources {
    /// The flight log, or the recording that is converted into one.
    pub main: PathBuf,
    /// Format of the recording; `None` for a flight log or a saved session, which need no conversion.
    pub kind: Option<SourceKind>,
    /// Bags that continue a ROS 1 bag, in the order of the numbers in their names.
    pub splits: Vec<PathBuf>,
    /// Log of the autopilot of a video.
    pub autopilot: Option<AutopilotLog>,
    pub rig: Option<PathBuf>,
    pub ground_truth: Option<PathBuf>,
}

impl LogSources {
    /// Sorts the given files and folders by what they are.
    ///
    /// # Errors
    /// When a file is of no known kind, or when the files do not form one log.
    pub fn gather(paths: &[PathBuf], limits: &LogLimits) -> Result<Self, SourceError> {
        let (rigs, recordings): (Vec<PathBuf>, Vec<PathBuf>) = paths.iter().cloned().partition(|path| is_yaml(path));
        let recordings = bag_of_segments(&recordings).map_or(recordings, |bag| vec![bag]);
        let (ground_truths, rigs): (Vec<PathBuf>, Vec<PathBuf>) =
            rigs.into_iter().partition(|path| log_name(path).ends_with(TRUTH_ENDING));
        let mut kinds = Vec::new();
        for path in recordings {
            kinds.push((kind_of_recording(&path, limits)?, path));
        }
        // The video is the main source, the log of its autopilot the second; bags are in the order of their numbers.
        kinds.sort_by_key(|(kind, path)| {
            (matches!(kind, Some(SourceKind::Autopilot(_))), path.as_os_str().len(), path.clone())
        });
        let mut kinds = kinds.into_iter();
        let Some((kind, main)) = kinds.next() else { return Err(SourceError::rig_alone(&rigs, &ground_truths)) };
        let mut sources = Self {
            main,
            kind,
            splits: Vec::new(),
            autopilot: None,
            rig: one_rig(&rigs)?,
            ground_truth: ground_truths.into_iter().next(),
        };
        for (kind, path) in kinds {
            match (sources.kind, kind) {
                (Some(SourceKind::Ros1Bag), Some(SourceKind::Ros1Bag)) => sources.splits.push(path),
                (Some(SourceKind::Video), Some(SourceKind::Autopilot(kind))) if sources.autopilot.is_none() => {
                    sources.autopilot = Some(AutopilotLog { kind, path });
                }
                _ => return Err(sources.together_with(kind, &path)),
            }
        }
        Ok(sources)
    }

    /// Error about a file that does not belong to the others.
    fn together_with(&self, kind: Option<SourceKind>, path: &Path) -> SourceError {
        let name = |kind: Option<SourceKind>| kind.map_or("flight log", SourceKind::name);
        SourceError::SeveralLogs {
            first: log_name(&self.main),
            first_kind: name(self.kind),
            second: log_name(path),
            second_kind: name(kind),
        }
    }

    /// All files of the recording, without rigs.
    pub(super) fn recordings(&self) -> impl Iterator<Item = &Path> {
        let autopilot = self.autopilot.iter().map(|log| log.path.as_path());
        std::iter::once(self.main.as_path()).chain(self.splits.iter().map(PathBuf::as_path)).chain(autopilot)
    }
}

fn is_yaml(path: &Path) -> bool {
    let named = |wanted: &&str| path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case(wanted));
    // `metadata.yaml` belongs to a ROS 2 bag.
    RIG_ENDINGS.iter().any(named) && log_name(path) != "metadata.yaml" && !path.is_dir()
}

/// Kind of a recording; `None` for a flight log whose messages can be read, and for a saved session.
fn kind_of_recording(path: &Path, limits: &LogLimits) -> Result<Option<SourceKind>, SourceError> {
    if is_session(path) {
        return Ok(None);
    }
    match source_kind(path, limits)? {
        SourceKind::Mcap if !is_of_ros1(path) => Ok(None),
        kind => Ok(Some(kind)),
    }
}

/// Bytes of a log that hold its profile: magic, opcode and length of the header record, length and text of the profile.
const PROFILE_BYTES: usize = 64;

/// True for an MCAP file with the profile of ROS 1, whose messages only the conversion reads.
fn is_of_ros1(path: &Path) -> bool {
    let mut start = Vec::new();
    let read = File::open(path).and_then(|file| file.take(PROFILE_BYTES as u64).read_to_end(&mut start));
    read.is_ok() && profile_of(&start) == Some(b"ros1")
}

/// Profile at the start of an MCAP file; `None` for any other file.
fn profile_of(start: &[u8]) -> Option<&[u8]> {
    const HEADER: u8 = 1;
    let record = start.strip_prefix(mcap::MAGIC)?.strip_prefix(&[HEADER])?;
    let (length, text) = record.get(size_of::<u64>()..)?.split_first_chunk()?;
    text.get(..usize::try_from(u32::from_le_bytes(*length)).ok()?)
}

/// Bag of ROS 2 whose files are given instead of its folder; `None` for anything else.
fn bag_of_segments(paths: &[PathBuf]) -> Option<PathBuf> {
    let (first, others) = paths.split_first()?;
    let folder = first.parent()?;
    let same = others.iter().all(|path| path.parent() == Some(folder));
    (same && !others.is_empty() && folder.join("metadata.yaml").is_file()).then(|| folder.to_owned())
}

/// The rig among YAML files: Kalibr's IMU file belongs to its camera chain.
fn one_rig(rigs: &[PathBuf]) -> Result<Option<PathBuf>, SourceError> {
    let belongs = |path: &PathBuf| rigs.iter().any(|chain| chain != path && is_imu_file_of(path, chain));
    let mut left: Vec<PathBuf> = rigs.iter().filter(|path| !belongs(path)).cloned().collect();
    if left.len() > 1 {
        let named: Vec<PathBuf> = left.iter().filter(|path| is_rig_name(path)).cloned().collect();
        if named.len() != 1 {
            return Err(SourceError::SeveralRigs { names: left.iter().map(|path| log_name(path)).collect() });
        }
        left = named;
    }
    Ok(left.pop())
}

/// True for the path of a saved session, `*.session.json`.
pub fn is_session(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().ends_with(".session.json"))
}
