//! Requests to open logs, and their answers.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;

use super::playing_log::PlayingLog;
use crate::flight_log::{FlightLog, RigCandidate};
use crate::text::log_name;

/// Files that a person opens together.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct OpenRequest {
    /// A log, a session, a study, or the recordings of one flight with their rig.
    pub sources: Vec<PathBuf>,
    /// Chosen rig; `None` to search for it.
    pub rig: Option<PathBuf>,
}

impl OpenRequest {
    pub fn of(path: PathBuf) -> Self {
        Self { sources: vec![path], rig: None }
    }

    /// Names of the files, for messages.
    pub fn names(&self) -> String {
        self.sources.iter().map(|path| log_name(path)).collect::<Vec<_>>().join(", ")
    }
}

/// Progress of the opening of a log that has to be converted first.
#[derive(Clone, Debug, PartialEq)]
pub struct OpenProgress {
    /// Present work, such as `Converting flight.bag (ROS 1 bag)`.
    pub text: String,
    /// Completed fraction of a conversion, from 0 to 1; `None` while waiting for a log.
    pub ratio: Option<f64>,
}

/// Session of an open log, and how it was opened.
pub struct OpenedLog {
    pub log: Box<dyn PlayingLog>,
    /// Path for the list of recent logs: a recording opens again by its own path.
    pub remembered: PathBuf,
    /// Messages about the conversion.
    pub notices: Vec<String>,
}

/// Reason why a log is not open.
pub enum OpenFailure {
    /// Message with cause and remedy.
    Problem(String),
    /// The log can be read, but has no measured rig.
    NeedsRig(Box<RigQuestion>),
    /// The request was withdrawn.
    Cancelled,
}

/// A log whose rig a person has to choose or to describe.
pub struct RigQuestion {
    pub log: Arc<FlightLog>,
    pub request: OpenRequest,
    /// Reason of the question.
    pub reason: String,
    /// Rigs found in the folders of the log and of its sources, usable ones first.
    pub candidates: Vec<RigCandidate>,
    /// Path for a new rig, next to the source.
    pub new_rig: PathBuf,
}

/// Opens a log; called on a thread. The second argument takes the progress and stops the opening when it breaks.
pub type OpenLog = Arc<
    dyn Fn(&OpenRequest, &mut dyn FnMut(OpenProgress) -> ControlFlow<()>) -> Result<OpenedLog, OpenFailure>
        + Send
        + Sync,
>;
