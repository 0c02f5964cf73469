//! A session as a file: what was opened, the runs and forks, breakpoints, markers and where the cursor stood.
//!
//! Results are not kept: they are computed anew, to the same bits.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::session::plan::{ForkChanges, RunSpec, SessionError, SessionRequest};

/// The format that this program writes.
pub(super) const VERSION: u32 = 1;

/// Why a text is not a saved session, or its session cannot be opened.
#[derive(Debug, Error)]
pub enum SavedSessionError {
    /// It is not in the format of a session.
    #[error("this is no saved session: {problem}")]
    NoSession {
        /// What is wrong with it.
        problem: String,
    },
    /// A later version of the program has written it.
    #[error("the session has version {found}, this program reads {VERSION}: open it with the program that saved it")]
    Version {
        /// Its version.
        found: u32,
    },
    /// A run, a fork or a breakpoint in it cannot be parsed.
    #[error("in the saved session: {problem}")]
    Part {
        /// What is wrong with it.
        problem: String,
    },
    /// The log cannot be opened.
    #[error(transparent)]
    Session(#[from] SessionError),
}

/// A session, written as JSON.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedSession {
    /// Version of the format.
    pub session_version: u32,
    /// The log.
    pub log: SavedLog,
    /// The rig, when it was named.
    pub rig: Option<PathBuf>,
    /// The ground truth, when it was named.
    #[serde(rename = "truth")]
    pub ground_truth: Option<PathBuf>,
    /// Seconds left out at the start.
    pub start_s: f64,
    /// Seconds read.
    pub duration_s: Option<f64>,
    /// The runs that are not forks, as on the command line.
    pub runs: Vec<String>,
    /// The forks, each after its parent.
    pub forks: Vec<SavedFork>,
    /// The breakpoints.
    pub breakpoints: Vec<SavedBreakpoint>,
    /// Marked stamps since the log began.
    pub markers_ns: Vec<i64>,
    /// Position of the cursor.
    pub cursor_ns: i64,
    /// The layout of the panels, in the window's own format.
    pub layout: Option<serde_json::Value>,
}

/// A log with its size and checksum.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SavedLog {
    /// Its path.
    pub path: PathBuf,
    /// Its size.
    pub bytes: u64,
    /// Checksum of its first and last mebibyte.
    pub crc32: u32,
}

/// A fork.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SavedFork {
    /// Name of the parent run.
    pub parent: String,
    /// Its own name.
    pub name: String,
    /// Stamp of its first own step since the log began.
    pub stamp_ns: i64,
    /// What it changes, as [`ForkChanges`] writes it.
    pub changes: String,
}

/// A breakpoint.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SavedBreakpoint {
    /// Its condition.
    pub condition: String,
    /// Whether it is enabled.
    pub enabled: bool,
}

impl SavedSession {
    /// Reads what [`SavedSession::to_text`] wrote.
    pub fn from_text(text: &str) -> Result<Self, SavedSessionError> {
        let no_session = |error: serde_json::Error| SavedSessionError::NoSession { problem: error.to_string() };
        let value: serde_json::Value = serde_json::from_str(text).map_err(no_session)?;
        let version = value.get("session_version").and_then(serde_json::Value::as_u64);
        if let Some(found) = version.and_then(|version| u32::try_from(version).ok()).filter(|found| *found > VERSION) {
            return Err(SavedSessionError::Version { found });
        }
        serde_json::from_value(value).map_err(no_session)
    }

    /// The session as JSON.
    pub fn to_text(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).unwrap_or_default();
        text.push('\n');
        text
    }

    /// What to open for it.
    pub fn request(&self) -> Result<SessionRequest, SavedSessionError> {
        let specs: Result<Vec<RunSpec>, _> = self.runs.iter().map(|run| run.parse()).collect();
        Ok(SessionRequest {
            log_path: self.log.path.clone(),
            rig_path: self.rig.clone(),
            ground_truth_path: self.ground_truth.clone(),
            specs: specs.map_err(part)?,
            start_s: self.start_s,
            duration_s: self.duration_s,
        })
    }
}

#[expect(clippy::needless_pass_by_value, reason = "for map_err")]
pub(super) fn part(error: impl ToString) -> SavedSessionError {
    SavedSessionError::Part { problem: error.to_string() }
}

/// What a session that was opened from a file still has to do, once the runs have reached it.
#[derive(Clone, Debug, Default)]
pub(in crate::session) struct Pending {
    pub(in crate::session) forks: Vec<(SavedFork, ForkChanges)>,
    pub(in crate::session) cursor_ns: Option<i64>,
}
