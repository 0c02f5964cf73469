use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::super::LogError;

/// Why a source could not be converted; every message names the problem, its place and the remedy, the path last.
#[derive(Debug, Error)]
pub enum ConvertError {
    /// The log or the rig could not be written, or a sensor's description is wrong.
    #[error(transparent)]
    Log(#[from] LogError),
    /// An error of the operating system.
    #[error("cannot {action}: {source}: {}", path.display())]
    Io {
        /// The attempted operation.
        action: &'static str,
        /// The error of the system.
        source: io::Error,
        /// The file.
        path: PathBuf,
    },
    /// The source is of no known kind.
    #[error(
        "{found}; expected a EuRoC/ASL folder (with mav0), a ROS 1 bag, a ROS 2 bag (its folder, .db3 or .mcap), an MP4 video, \
         or a log of an autopilot (.ulg, .bin, .tlog): {}",
        path.display()
    )]
    UnknownSource {
        /// Description of the source.
        found: String,
        /// The source.
        path: PathBuf,
    },
    /// A source of a known kind that cannot be read.
    #[error("{problem}: {}", path.display())]
    Unreadable {
        /// The problem and its remedy.
        problem: String,
        /// The file.
        path: PathBuf,
    },
    /// An invalid line of a table.
    #[error("line {line}: {problem}: {}", path.display())]
    Line {
        /// Number of the line from 1.
        line: usize,
        /// Its value and the expected one.
        problem: String,
        /// The table.
        path: PathBuf,
    },
    /// No topic could be used.
    #[error("no message can be used ({}): {}", if topics.is_empty() { "it has no topics" } else { topics }, path.display())]
    NothingUsable {
        /// The topics with their types and why each was skipped.
        topics: String,
        /// The source.
        path: PathBuf,
    },
    /// Options that need a video, for another source.
    #[error("{kind} has no video: --ulog, --dataflash, --tlog and --video-offset are for an MP4 video as the source: {}", path.display())]
    NoVideo {
        /// Kind of the source.
        kind: &'static str,
        /// The source.
        path: PathBuf,
    },
    /// The file beside a video is no log of the named kind.
    #[error("no {expected}, {found}: {}", path.display())]
    NotThatLog {
        /// Name of the expected kind.
        expected: &'static str,
        /// What it is.
        found: String,
        /// The file.
        path: PathBuf,
    },
    /// The caller has stopped it.
    #[error("interrupted; nothing is written: {}", path.display())]
    Interrupted {
        /// The source.
        path: PathBuf,
    },
    /// The log would overwrite its source.
    #[error("the log would be inside or overwrite its own source; give another -o: {}", path.display())]
    OntoItself {
        /// The log.
        path: PathBuf,
    },
}

impl ConvertError {
    /// For `map_err` of a system call.
    pub(super) fn io(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { action, source, path }
    }

    /// A source that cannot be read.
    pub(super) fn unreadable(problem: impl Into<String>, path: &Path) -> Self {
        Self::Unreadable { problem: problem.into(), path: path.to_owned() }
    }
}
