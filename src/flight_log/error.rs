use std::path::PathBuf;

use thiserror::Error;

use super::LimitExceeded;
use super::text::printable;
use crate::sensors::UnknownCamera;

/// Why a log or a rig could not be read or written; every message names the problem, its place and the remedy, the path
/// last.
#[derive(Debug, Error)]
pub enum LogError {
    /// An error of the operating system.
    #[error("cannot {action}: {source}: {}", path.display())]
    Io {
        /// The attempted operation: `open the log`, `write the log`, ….
        action: &'static str,
        /// The error of the system.
        source: std::io::Error,
        /// The file.
        path: PathBuf,
    },
    /// The file is no MCAP log.
    #[error("not an MCAP log: {found}; {remedy}: {}", path.display())]
    NotALog {
        /// Description of the file.
        found: String,
        /// The remedy.
        remedy: &'static str,
        /// The file.
        path: PathBuf,
    },
    /// The file holds or claims more than a limit allows.
    #[error("{exceeded}: {}", path.display())]
    Limit {
        /// The limit, the number found and the way to raise the limit.
        exceeded: LimitExceeded,
        /// The file.
        path: PathBuf,
    },
    /// Another process shortened the file while it was read.
    #[error("{problem}; what was read before is incomplete: {}", path.display())]
    Shortened {
        /// Where the file ends now, and its length when it was opened.
        problem: String,
        /// The log.
        path: PathBuf,
    },
    /// An MCAP file in which no message of use could be read.
    #[error("nothing in the log can be used: {problem}: {}", path.display())]
    NothingReadable {
        /// The problem, with its byte offset where there is one.
        problem: String,
        /// The log.
        path: PathBuf,
    },
    /// A trajectory cannot be used.
    #[error("cannot use the trajectory: {problem}: {}", path.display())]
    Trajectory {
        /// What is wrong with it.
        problem: String,
        /// The file, or the log.
        path: PathBuf,
    },
    /// A line of a trajectory is no pose.
    #[error("line {line} {problem}; expected 't x y z qx qy qz qw': {}", path.display())]
    TrajectoryLine {
        /// Line number, from 1.
        line: usize,
        /// The problem.
        problem: String,
        /// The file.
        path: PathBuf,
    },
    /// The rig names a topic that is not in the log.
    #[error(
        "{field} names the topic '{topic}', which is not in the log; its topics of type {expected} are {}; name one of them in \
         the rig: {}",
        list(available),
        path.display()
    )]
    MissingTopic {
        /// Field of the rig, `cam0.rostopic`.
        field: String,
        /// The topic that it names.
        topic: String,
        /// The message types that are accepted.
        expected: String,
        /// Topics of those types in the log.
        available: Vec<String>,
        /// The log.
        path: PathBuf,
    },
    /// The rig has no such camera.
    #[error(transparent)]
    UnknownCamera(#[from] UnknownCamera),
    /// A joint of the rig does not occur in the joint messages.
    #[error(
        "gimbal.links[{link}].joint is '{joint}', but the messages on '{topic}' name {}; use those names in the rig: {}",
        list(available),
        path.display()
    )]
    UnknownJoint {
        /// Number of the link.
        link: usize,
        /// Name of the joint in the rig.
        joint: String,
        /// Topic of the joint angles.
        topic: String,
        /// Names of the joints in the messages.
        available: Vec<String>,
        /// The log.
        path: PathBuf,
    },
    /// The frames of a gimbal's attitude are not connected in the log.
    #[error(
        "gimbal.source: parent and child are not connected by '{topic}' and '/tf_static': {problem}: {}",
        path.display()
    )]
    NoTransform {
        /// Topic of the transforms.
        topic: String,
        /// What is missing.
        problem: String,
        /// The log.
        path: PathBuf,
    },
    /// The times of a topic have no known relation to those of the log.
    #[error(
        "'{topic}': the first stamp is {stamp_s:.3} s since an unknown start (PX4 counts from its own), the first time of recording          {log_s:.3} s after the first stamp of the log; neither lies within the log, so that the two clocks cannot be related; record with          synchronized clocks (UXRCE_DDS_SYNCT 1): {}",
        path.display()
    )]
    UnknownClock {
        /// The topic.
        topic: String,
        /// Its first stamp in seconds.
        stamp_s: f64,
        /// Its first log time since the log began in seconds.
        log_s: f64,
        /// The log.
        path: PathBuf,
    },
    /// A field of a rig is missing or wrong.
    #[error("{field}: {problem}: {}", path.display())]
    Rig {
        /// Path of the field, `cam0.intrinsics`.
        field: String,
        /// Its value and the expected one.
        problem: String,
        /// The rig.
        path: PathBuf,
    },
    /// A rig that is no YAML.
    #[error("the rig is not valid YAML: {problem}: {}", path.display())]
    RigSyntax {
        /// The parser's error with line and column.
        problem: String,
        /// The rig.
        path: PathBuf,
    },
    /// There is no rig.
    #[error("no rig for the log: neither {} nor an attachment named *.rig.yaml exists; give one with --rig FILE: {}",
        beside.display(), path.display())]
    NoRig {
        /// The expected path of the rig file.
        beside: PathBuf,
        /// The log.
        path: PathBuf,
    },
    /// One message could not be decoded.
    #[error("message at {second:.3} s on '{topic}' (block at byte {byte}): {problem}: {}", path.display())]
    BadMessage {
        /// Its topic.
        topic: String,
        /// Log time in seconds since the log began.
        second: f64,
        /// Byte offset of the message's chunk in the file.
        byte: usize,
        /// What is wrong.
        problem: String,
        /// The log.
        path: PathBuf,
    },
    /// The requested image is not in the log.
    #[error("'{topic}' has {count} images, none with number {index}: {}", path.display())]
    NoSuchImage {
        /// Topic of the camera.
        topic: String,
        /// The requested number.
        index: usize,
        /// Number of its images.
        count: usize,
        /// The log.
        path: PathBuf,
    },
    /// The MCAP writer or the image encoder failed.
    #[error("cannot write the log: {problem}: {}", path.display())]
    Write {
        /// The problem.
        problem: String,
        /// The log.
        path: PathBuf,
    },
}

/// `'a', 'b'`, or `none`.
fn list(items: &[String]) -> String {
    if items.is_empty() {
        return "none".into();
    }
    items.iter().map(|item| format!("'{}'", printable(item))).collect::<Vec<_>>().join(", ")
}
