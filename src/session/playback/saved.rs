//! A session as a file: paths, runs, forks, breakpoints, markers and the position of the cursor.
//!
//! Results are not stored; they are recomputed to the same bits.

use std::collections::VecDeque;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::markers::Marker;
use crate::files::LogLimits;
use crate::sensors::LeverArm;
use crate::session::plan::{ForkChanges, RunSpec, SessionError, SessionRequest, TrajectorySource, TrajectorySpec};

/// Version of the file format that this program writes.
pub(super) const VERSION: u32 = 2;

/// Reason why a text is not a saved session, or its session cannot be opened.
#[derive(Debug, Error)]
pub enum SavedSessionError {
    #[error("not a saved session: {problem}")]
    Format { problem: String },
    #[error(
        "session version {found}, but this program reads version {VERSION}: open it with the program that saved it"
    )]
    Version { found: u32 },
    /// A run, a fork or a breakpoint in it cannot be parsed.
    #[error("invalid saved session: {problem}")]
    Entry { problem: String },
    /// The log cannot be opened.
    #[error(transparent)]
    Session(#[from] SessionError),
}

/// A session as it is written to JSON.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedSession {
    pub session_version: u32,
    /// The log, with a checksum to identify it.
    pub log: SavedLog,
    /// Paths of the recording that the log was converted from; empty for any other log.
    #[serde(default, skip_serializing_if = "Vec::is_empty", with = "super::saved_path::several")]
    pub recording: Vec<PathBuf>,
    /// Path of the rig file, if it was given.
    #[serde(default, with = "super::saved_path::optional")]
    pub rig: Option<PathBuf>,
    /// Path of the ground-truth rig file, if it was given.
    #[serde(default, rename = "truth", with = "super::saved_path::optional")]
    pub ground_truth: Option<PathBuf>,
    /// Ground truth of the trajectory, as on the command line.
    #[serde(default)]
    pub truth_trajectory: Option<String>,
    /// Lever arm of the antenna whose positions are the ground truth, as on the command line.
    #[serde(default)]
    pub lever_arm: Option<String>,
    /// Required accuracy, as on the command line; `None` for 5 mm and 0.1°.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub required_accuracy: Option<String>,
    /// Seconds to skip at the start of the log.
    pub start_s: f64,
    /// Seconds to read from there, `None` for the rest of the log.
    pub duration_s: Option<f64>,
    /// Specifications of the runs that are not forks, as on the command line.
    pub runs: Vec<String>,
    /// Calibration of earlier flights that the runs start from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prior: Option<SavedPrior>,
    /// Trajectories of other programs, as on the command line.
    #[serde(default)]
    pub trajectories: Vec<String>,
    /// The forks, each after its parent.
    pub forks: Vec<SavedFork>,
    /// Names of all runs and forks in their order in the window; empty in files of earlier programs, whose forks follow
    /// the runs.
    #[serde(default)]
    pub order: Vec<String>,
    pub breakpoints: Vec<SavedBreakpoint>,
    /// Version 1 has stamps under the key `markers_ns`.
    #[serde(default, alias = "markers_ns")]
    pub markers: Vec<Marker>,
    /// Position of the cursor, in nanoseconds since the log began.
    pub cursor_ns: i64,
    /// Layout of the panels, in the window's format.
    pub layout: Option<serde_json::Value>,
}

/// A log with its size and checksum.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SavedLog {
    #[serde(with = "super::saved_path")]
    pub path: PathBuf,
    pub bytes: u64,
    /// CRC-32 of its first and last mebibyte.
    pub crc32: u32,
}

/// Calibration of earlier flights: its folder, and the factor on its standard deviations.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedPrior {
    #[serde(with = "super::saved_path")]
    pub folder: PathBuf,
    pub growth: f64,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SavedFork {
    pub parent: String,
    pub name: String,
    /// Stamp of the first step of the fork, in nanoseconds since the log began.
    pub stamp_ns: i64,
    /// Changes against the parent, in the text format of [`ForkChanges`].
    pub changes: String,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SavedBreakpoint {
    pub condition: String,
    /// True if the cursor stops at its hits.
    pub enabled: bool,
}

impl SavedSession {
    /// Parses the output of [`SavedSession::to_text`].
    pub fn from_text(text: &str) -> Result<Self, SavedSessionError> {
        let no_session = |error: serde_json::Error| SavedSessionError::Format { problem: error.to_string() };
        let value: serde_json::Value = serde_json::from_str(text).map_err(no_session)?;
        let version = value.get("session_version").and_then(serde_json::Value::as_u64);
        if let Some(found) = version.and_then(|version| u32::try_from(version).ok()).filter(|found| *found > VERSION) {
            return Err(SavedSessionError::Version { found });
        }
        serde_json::from_value(value).map_err(no_session)
    }

    /// The session as indented JSON.
    pub fn to_text(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).unwrap_or_default();
        text.push('\n');
        text
    }

    /// Request that opens the log and its runs, without the calibration at [`Self::prior`].
    pub fn request(&self) -> Result<SessionRequest, SavedSessionError> {
        let specs: Result<Vec<RunSpec>, _> = self.runs.iter().map(|run| run.parse()).collect();
        let trajectories: Result<Vec<TrajectorySpec>, _> = self.trajectories.iter().map(|text| text.parse()).collect();
        let truth = self.truth_trajectory.as_ref().map(|text| text.parse::<TrajectorySource>());
        let lever_arm = self.lever_arm.as_ref().map(|text| text.parse::<LeverArm>());
        Ok(SessionRequest {
            truth_trajectory: truth.transpose().map_err(entry_error)?,
            lever_arm: lever_arm.transpose().map_err(entry_error)?,
            required_accuracy: self.required_accuracy.clone(),
            log_path: self.log.path.clone(),
            recording: self.recording.clone(),
            rig_path: self.rig.clone(),
            ground_truth_path: self.ground_truth.clone(),
            specs: specs.map_err(entry_error)?,
            prior: None,
            trajectories: trajectories.map_err(entry_error)?,
            start_s: self.start_s,
            duration_s: self.duration_s,
            limits: LogLimits::default(),
            following: None,
        })
    }
}

#[expect(clippy::needless_pass_by_value, reason = "for map_err")]
pub(super) fn entry_error(error: impl ToString) -> SavedSessionError {
    SavedSessionError::Entry { problem: error.to_string() }
}

/// Runs and cursor position of a saved session that are still to be restored.
#[derive(Clone, Debug, Default)]
pub(in crate::session) struct PendingRestore {
    /// The first fork and what follows it, so that every run gets its place again, and with it its colour.
    pub(in crate::session) runs: VecDeque<PendingRun>,
    pub(in crate::session) cursor_ns: Option<i64>,
}

/// Run of a saved session that is not started yet.
#[derive(Clone, Debug)]
pub(in crate::session) enum PendingRun {
    Run(RunSpec),
    Fork(SavedFork, ForkChanges),
}

impl PendingRun {
    pub(in crate::session) fn label(&self) -> &str {
        match self {
            Self::Run(spec) => &spec.label,
            Self::Fork(fork, _) => &fork.name,
        }
    }
}

#[cfg(all(test, unix))]
mod tests {
    use std::ffi::OsString;
    use std::os::unix::ffi::OsStringExt as _;

    use super::*;

    #[test]
    fn paths_need_not_be_utf_8() {
        let path = |name: &[u8]| PathBuf::from(OsString::from_vec(name.to_vec()));
        let session = SavedSession {
            session_version: VERSION,
            log: SavedLog { path: path(b"/logs/\xff.mcap"), bytes: 1, crc32: 2 },
            recording: vec![path(b"/logs/\xfd.mp4"), path(b"/logs/flight.ulg")],
            rig: Some(path(b"/logs/\xfe.rig.yaml")),
            ground_truth: Some(path(b"/logs/plain.yaml")),
            truth_trajectory: None,
            lever_arm: None,
            required_accuracy: None,
            start_s: 0.0,
            duration_s: None,
            runs: Vec::new(),
            prior: Some(SavedPrior { folder: path(b"/logs/\xfc/minimal"), growth: 2.0 }),
            trajectories: Vec::new(),
            forks: Vec::new(),
            order: Vec::new(),
            breakpoints: Vec::new(),
            markers: vec![Marker::new(5, "turn")],
            cursor_ns: 0,
            layout: None,
        };
        let text = session.to_text();
        assert!(text.contains("\"truth\": \"/logs/plain.yaml\""), "{text}");
        assert_eq!(SavedSession::from_text(&text).unwrap(), session);
        let old =
            text.replace("\"session_version\": 2", "\"session_version\": 1").replace("\"markers\"", "\"markers_ns\"");
        let old = SavedSession::from_text(&old).unwrap();
        assert_eq!(old, SavedSession { session_version: 1, ..session.clone() });
        let none = SavedSession { rig: None, recording: Vec::new(), prior: None, ..session };
        assert!(!none.to_text().contains("recording") && !none.to_text().contains("prior"));
        assert_eq!(SavedSession::from_text(&none.to_text()).unwrap(), none);
    }
}
