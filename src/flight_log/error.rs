use std::path::PathBuf;

use thiserror::Error;

use crate::files::FileError;
use crate::files::LimitExceeded;
use crate::sensors::UnknownCamera;
use crate::text::printable;

/// Failure to read or write a log or a rig; every message names the problem, its location and the remedy, the path
/// last.
#[derive(Debug, Error)]
pub enum LogError {
    #[error("cannot {action}: {source}: {}", path.display())]
    Io {
        /// Attempted operation: `open the log`, `write the log`, ….
        action: &'static str,
        source: std::io::Error,
        path: PathBuf,
    },
    #[error("not an MCAP log: {found}; {remedy}: {}", path.display())]
    NotALog { found: String, remedy: &'static str, path: PathBuf },
    /// The file contains or declares more than a limit allows.
    #[error("{exceeded}: {}", path.display())]
    Limit { exceeded: LimitExceeded, path: PathBuf },
    /// Another process shortened the file while it was read.
    #[error("{problem}; data read before are incomplete: {}", path.display())]
    Shortened {
        /// Present end of the file, and its length when it was opened.
        problem: String,
        path: PathBuf,
    },
    #[error("nothing in the log can be used: {problem}: {}", path.display())]
    NothingReadable {
        /// Problem with its byte offset, if there is one.
        problem: String,
        path: PathBuf,
    },
    #[error("cannot use the trajectory: {problem}: {}", path.display())]
    Trajectory {
        problem: String,
        /// Trajectory file or log.
        path: PathBuf,
    },
    #[error("line {line} {problem}; expected 't x y z qx qy qz qw': {}", path.display())]
    TrajectoryLine {
        /// Line number, counted from 1.
        line: usize,
        problem: String,
        path: PathBuf,
    },
    #[error(
        "{field} names the topic '{topic}', which is not in the log; its topics of type {expected} are {}; name one of them in \
         the rig: {}",
        list(available),
        path.display()
    )]
    MissingTopic {
        /// Field of the rig, such as `cam0.rostopic`.
        field: String,
        topic: String,
        expected: String,
        /// Topics of those types in the log.
        available: Vec<String>,
        path: PathBuf,
    },
    #[error("{field} names the topic '{topic}', which cannot be read: {found}; {remedy}: {}", path.display())]
    UnreadEncoding {
        /// Field of the rig, such as `cam0.rostopic`.
        field: String,
        topic: String,
        /// Type and encoding of its messages.
        found: String,
        remedy: &'static str,
        path: PathBuf,
    },
    #[error(
        "{field} names the topic '{topic}', which has messages of another type: {found}; name one of them in the rig: {}",
        path.display()
    )]
    OtherType {
        /// Field of the rig, such as `cam0.rostopic`.
        field: String,
        topic: String,
        /// Type and encoding of its messages, then the topics of the log with the expected types.
        found: String,
        path: PathBuf,
    },
    /// A rig or another file that is no log.
    #[error(transparent)]
    File(#[from] FileError),
    #[error(transparent)]
    UnknownCamera(#[from] UnknownCamera),
    #[error(
        "gimbal.links[{link}].joint is '{joint}', but the messages on '{topic}' name {}; use those names in the rig: {}",
        list(available),
        path.display()
    )]
    UnknownJoint { link: usize, joint: String, topic: String, available: Vec<String>, path: PathBuf },
    /// The frames of a gimbal's attitude are not connected in the log.
    #[error(
        "gimbal.source: parent and child are not connected by '{topic}' and '/tf_static': {problem}: {}",
        path.display()
    )]
    NoTransform { topic: String, problem: String, path: PathBuf },
    /// The clock of a topic has no known relation to the clock of the log.
    #[error(
        "'{topic}': the first stamp is {stamp} since an unknown start (PX4 counts from its start), the \
         first log time is {log_s:.3} s after the first stamp of the log; neither lies within the log, so the two \
         clocks cannot be related; record with synchronized clocks (UXRCE_DDS_SYNCT 1): {}",
        path.display()
    )]
    UnknownClock {
        topic: String,
        /// First stamp of the topic, with its unit.
        stamp: String,
        /// First log time of the topic since the start of the log, in seconds.
        log_s: f64,
        path: PathBuf,
    },
    #[error("no rig for the log: neither {} nor an attachment named *.rig.yaml exists; give one with --rig FILE: {}",
        beside.display(), path.display())]
    NoRig {
        /// Expected path of the rig file.
        beside: PathBuf,
        path: PathBuf,
    },
    #[error("message at {second:.3} s on '{topic}' (block at byte {byte}): {problem}: {}", path.display())]
    BadMessage {
        topic: String,
        /// Log time in seconds since the start of the log.
        second: f64,
        /// Byte offset of the message's chunk in the file.
        byte: usize,
        problem: String,
        path: PathBuf,
    },
    #[error("'{topic}' has {count} images, none with number {index}: {}", path.display())]
    NoSuchImage { topic: String, index: usize, count: usize, path: PathBuf },
    /// The MCAP writer or the image encoder failed.
    #[error("cannot write the log: {problem}: {}", path.display())]
    Write { problem: String, path: PathBuf },
}

/// `'a', 'b'`, or `none`.
pub(super) fn list(items: &[String]) -> String {
    if items.is_empty() {
        return "none".into();
    }
    items.iter().map(|item| format!("'{}'", printable(item))).collect::<Vec<_>>().join(", ")
}
