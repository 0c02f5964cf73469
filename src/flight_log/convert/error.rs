use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::super::LogError;
use crate::files::FileError;
use crate::flight_log::log::foreign;

/// Failure to convert a source; every message names the problem, its location and the remedy, the path last.
#[derive(Debug, Error)]
pub enum ConvertError {
    /// The log or the rig could not be written, or a sensor's description is invalid.
    #[error(transparent)]
    Log(#[from] LogError),
    #[error(transparent)]
    File(#[from] FileError),
    #[error("cannot {action}: {source}: {}", path.display())]
    Io { action: &'static str, source: io::Error, path: PathBuf },
    #[error(
        "{found}; expected a EuRoC/ASL folder (with mav0), a ROS 1 bag, a ROS 2 bag (its folder, .db3 or .mcap), an MP4 video, \
         or a log of an autopilot (.ulg, .bin, .tlog): {}",
        path.display()
    )]
    UnknownSource { found: String, path: PathBuf },
    /// Recording of a known kind that lacks what an estimation needs.
    #[error("{found}; {}: {}", foreign::RECORD_AN_IMU, path.display())]
    WithoutImu { found: &'static str, path: PathBuf },
    /// Source of a known kind that cannot be read.
    #[error("{problem}: {}", path.display())]
    Unreadable { problem: String, path: PathBuf },
    #[error("line {line}: {problem}: {}", path.display())]
    Line {
        /// Line number, counted from 1.
        line: usize,
        problem: String,
        path: PathBuf,
    },
    #[error("no message can be used ({}): {}", if topics.is_empty() { "it has no topics" } else { topics }, path.display())]
    NothingUsable {
        /// Topics with their types and the reason why each was skipped.
        topics: String,
        path: PathBuf,
    },
    #[error("{kind} has no video: --ulog, --dataflash, --tlog and --video-offset are for an MP4 video as the source: {}", path.display())]
    NoVideo { kind: &'static str, path: PathBuf },
    #[error("{kind} has no further parts: several sources are the bags of one split ROS 1 recording: {}", path.display())]
    NoSplits { kind: &'static str, path: PathBuf },
    /// The autopilot's log of a video is of another kind than given.
    #[error("no {expected}, {found}: {}", path.display())]
    NotThatLog { expected: &'static str, found: String, path: PathBuf },
    /// A record to take that the source does not have.
    #[error(
        "no record {record:?} to take; {}: {}",
        if available.is_empty() { "only logs of autopilots and their videos have records to choose from".to_owned() }
        else { format!("the source has {available}") },
        path.display()
    )]
    NoSuchRecord {
        record: String,
        /// Names of the records of the source.
        available: String,
        path: PathBuf,
    },
    /// The caller stopped the conversion.
    #[error("interrupted; nothing is written: {}", path.display())]
    Interrupted { path: PathBuf },
    /// The log would overwrite its source.
    #[error("the log would be inside or overwrite its own source; give another -o: {}", path.display())]
    OntoItself { path: PathBuf },
}

impl ConvertError {
    /// For `map_err` of a system call.
    pub(super) fn io(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { action, source, path }
    }

    pub(super) fn unreadable(problem: impl Into<String>, path: &Path) -> Self {
        Self::Unreadable { problem: problem.into(), path: path.to_owned() }
    }
}
