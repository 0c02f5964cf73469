//! A session as a file: what was opened, the runs and forks, breakpoints, markers and where the cursor stood.
//!
//! Results are not kept: they are computed anew, to the same bits.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::session::Session;
use crate::session::breakpoints::Condition;
use crate::session::plan::{ForkChanges, RunSpec, SessionError, SessionPlan, SessionRequest};

/// The format that this program writes.
const VERSION: u32 = 1;

/// Why a text is no session, or its session cannot be opened.
#[derive(Debug, Error)]
pub enum SavedSessionError {
    /// It is not in the form of a session.
    #[error("this is no saved session: {problem}")]
    NoSession {
        /// What is wrong with it.
        problem: String,
    },
    /// A later program has written it.
    #[error("the session has version {found}, this program reads {VERSION}: open it with the program that saved it")]
    Version {
        /// Its version.
        found: u32,
    },
    /// A run, a fork or a breakpoint in it is not understood.
    #[error("in the saved session: {problem}")]
    Part {
        /// What is wrong with it.
        problem: String,
    },
    /// The log cannot be opened as it was.
    #[error(transparent)]
    Session(#[from] SessionError),
}

/// A session, written as JSON.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedSession {
    /// The form that it is written in.
    pub session_version: u32,
    /// The log.
    pub log: SavedLog,
    /// The rig, when it was named.
    pub rig: Option<PathBuf>,
    /// The true values, when they were named.
    pub truth: Option<PathBuf>,
    /// Seconds left out at the begin.
    pub start_s: f64,
    /// Seconds read.
    pub duration_s: Option<f64>,
    /// The runs that are no forks, as on the command line.
    pub runs: Vec<String>,
    /// The forks, each after the run that it has left.
    pub forks: Vec<SavedFork>,
    /// The breakpoints.
    pub breakpoints: Vec<SavedBreakpoint>,
    /// Marked instants since the log began.
    pub markers_ns: Vec<i64>,
    /// Where the cursor stood.
    pub cursor_ns: i64,
    /// Where the panels were, in the window's own form.
    pub layout: Option<serde_json::Value>,
}

/// A log and how to tell whether it is still the same.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SavedLog {
    /// Where it lies.
    pub path: PathBuf,
    /// Its size.
    pub bytes: u64,
    /// Checksum of its first and last mebibyte.
    pub crc32: u32,
}

/// A fork.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SavedFork {
    /// Name of the run that it has left.
    pub parent: String,
    /// Its own name.
    pub name: String,
    /// Stamp of its first own step since the log began.
    pub stamp_ns: i64,
    /// What it does otherwise, as [`ForkChanges`] writes it.
    pub changes: String,
}

/// A breakpoint.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SavedBreakpoint {
    /// When it is hit.
    pub condition: String,
    /// Whether it stops anything.
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
            truth_path: self.truth.clone(),
            specs: specs.map_err(part)?,
            start_s: self.start_s,
            duration_s: self.duration_s,
        })
    }

    /// Opens the log and starts the runs; the forks follow as their parents come to where they left them, and the cursor
    /// goes where it was as soon as all runs have come there.
    pub fn open(&self) -> Result<Session, SavedSessionError> {
        let plan = SessionPlan::open(&self.request()?)?;
        let conditions: Result<Vec<Condition>, _> = self.breakpoints.iter().map(|it| it.condition.parse()).collect();
        let conditions = conditions.map_err(part)?;
        let mut forks = Vec::new();
        for fork in &self.forks {
            let changes: ForkChanges = fork.changes.parse().map_err(part)?;
            forks.push((fork.clone(), changes));
        }
        let same = (plan.log.size_bytes(), plan.log.checksum()) == (self.log.bytes, self.log.crc32);
        let mut session = Session::start(plan)?;
        if !same {
            let text = "The log is not the one that the session was saved with: its bytes differ";
            session.notices.push(text.to_owned());
        }
        session.change_breakpoints(|all| {
            for (number, (condition, saved)) in conditions.into_iter().zip(&self.breakpoints).enumerate() {
                all.add(condition);
                all.enable(number, saved.enabled);
            }
        });
        session.markers_ns.clone_from(&self.markers_ns);
        session.markers_ns.sort_unstable();
        session.pending = Pending { forks, cursor_ns: Some(self.cursor_ns) };
        session.layout.clone_from(&self.layout);
        Ok(session)
    }
}

#[expect(clippy::needless_pass_by_value, reason = "for map_err")]
fn part(error: impl ToString) -> SavedSessionError {
    SavedSessionError::Part { problem: error.to_string() }
}

/// What a session that was opened from a file still has to do, once the runs have come there.
#[derive(Clone, Debug, Default)]
pub(in crate::session) struct Pending {
    pub(in crate::session) forks: Vec<(SavedFork, ForkChanges)>,
    pub(in crate::session) cursor_ns: Option<i64>,
}

impl Session {
    /// The session as it is, for a file; `layout` says where the panels are.
    pub fn saved(&self, layout: Option<serde_json::Value>) -> SavedSession {
        let recording = self.recording();
        let log = &self.plan.log;
        let absolute = |path: &PathBuf| std::path::absolute(path).unwrap_or_else(|_| path.clone());
        let name_of = |id: u64| recording.runs.iter().find(|run| run.id == id).map(|run| run.spec.label.clone());
        let forks = recording.runs.iter().filter_map(|run| {
            let origin = run.origin.as_ref()?;
            Some(SavedFork {
                parent: name_of(origin.parent)?,
                name: run.spec.label.clone(),
                stamp_ns: origin.stamp_ns,
                changes: origin.changes.to_string(),
            })
        });
        let pending = self.pending.forks.iter().map(|(fork, _)| fork.clone());
        let breakpoints = self.breakpoints.list().iter().map(|breakpoint| SavedBreakpoint {
            condition: breakpoint.condition.text().to_owned(),
            enabled: breakpoint.enabled,
        });
        SavedSession {
            session_version: VERSION,
            log: SavedLog { path: absolute(&self.plan.log_path), bytes: log.size_bytes(), crc32: log.checksum() },
            rig: self.plan.rig_path.as_ref().map(absolute),
            truth: self.plan.truth_path.as_ref().map(absolute),
            start_s: self.plan.start_s,
            duration_s: self.plan.duration_s,
            runs: recording.runs.iter().filter(|run| run.origin.is_none()).map(|run| run.spec.to_string()).collect(),
            forks: forks.chain(pending).collect(),
            breakpoints: breakpoints.collect(),
            markers_ns: self.markers_ns().to_vec(),
            cursor_ns: self.pending.cursor_ns.unwrap_or(self.cursor.stamp_ns),
            layout,
        }
    }

    /// Waits until all runs are computed and all that a file asked for is done: forks made, the cursor where it was.
    pub fn finish(&mut self) {
        /// Between two looks, in milliseconds.
        const LOOK_MS: u64 = 5;
        let open = |session: &Self| {
            let pending = !session.pending.forks.is_empty() || session.pending.cursor_ns.is_some();
            pending || session.recording().runs.iter().any(|run| !run.finished)
        };
        while open(self) {
            self.advance(0.0);
            std::thread::sleep(std::time::Duration::from_millis(LOOK_MS));
        }
        self.advance(0.0);
    }

    /// Where the panels were when the session was saved.
    pub fn layout(&self) -> Option<&serde_json::Value> {
        self.layout.as_ref()
    }

    /// Makes the forks whose parents have come to where they left them, and puts the cursor where it was.
    pub(in crate::session) fn resume(&mut self) {
        let recording = self.recording();
        if let Some((fork, changes)) = self.pending.forks.first().cloned() {
            let parent = recording.runs.iter().position(|run| run.spec.label == fork.parent);
            let run = parent.and_then(|parent| recording.runs.get(parent));
            let reached =
                run.and_then(|run| run.steps.last()).is_some_and(|last| last.report.stamp_ns >= fork.stamp_ns);
            if let (Some(parent), true) = (parent, reached) {
                self.pending.forks.remove(0);
                if let Err(problem) = self.fork_at(parent, fork.stamp_ns, &changes, Some(fork.name)) {
                    self.notices.push(problem);
                }
            } else if run.is_none_or(|run| run.finished) {
                self.pending.forks.remove(0);
                let text = format!("The fork {} cannot be made again: {} does not come there", fork.name, fork.parent);
                self.notices.push(text);
            }
        }
        if let Some(cursor_ns) = self.pending.cursor_ns
            && self.pending.forks.is_empty()
            && recording.computed_ns() >= cursor_ns.min(recording.last_stamp_ns())
            && (recording.computed_ns() >= cursor_ns || recording.runs.iter().all(|run| run.finished))
        {
            self.pending.cursor_ns = None;
            self.cursor = self.cursor.seek(&recording, cursor_ns);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::playback::Command;

    fn garden(duration_s: f64) -> SessionPlan {
        let request = SessionRequest {
            log_path: PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("sample_logs/garden.mcap"),
            duration_s: Some(duration_s),
            ..SessionRequest::default()
        };
        SessionPlan::open(&request).unwrap()
    }

    fn settled(session: &mut Session) {
        let busy = |session: &Session| {
            session.pending.cursor_ns.is_some() || session.recording().runs.iter().any(|run| !run.finished)
        };
        while busy(session) {
            session.advance(0.0);
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
    }

    #[test]
    fn a_session_comes_back_as_it_was_saved() {
        // More steps than are spared when memory runs short.
        let mut session = Session::start(garden(4.5)).unwrap();
        settled(&mut session);
        session.apply(Command::AddBreakpoint("features < 40".parse().unwrap()));
        session.apply(Command::AddBreakpoint("rank < 18 and tracking".parse().unwrap()));
        session.apply(Command::EnableBreakpoint { number: 0, enabled: false });
        session.apply(Command::GoToEnd);
        session.apply(Command::StepFrames(-4));
        session.apply(Command::ToggleMarker);
        let changes: ForkChanges = "classical,freeze=yaw.d".parse().unwrap();
        session.apply(Command::Fork { run: 0, changes, label: None });
        assert!(session.take_notices().is_empty());
        settled(&mut session);
        session.apply(Command::StepFrames(1));
        let layout = serde_json::json!({ "panels": [1, 2] });
        let saved = session.saved(Some(layout.clone()));
        assert_eq!(SavedSession::from_text(&saved.to_text()).unwrap(), saved);

        let mut again = SavedSession::from_text(&saved.to_text()).unwrap().open().unwrap();
        settled(&mut again);
        assert!(again.take_notices().is_empty());
        assert_eq!(again.layout(), Some(&layout));
        assert_eq!(again.saved(Some(layout)), saved);
        let (before, after) = (session.recording(), again.recording());
        assert_eq!(before.runs.len(), after.runs.len());
        // With less memory older steps become summaries at once.
        assert!(after.runs.iter().all(|run| run.memory.summaries == 0));
        again.apply(Command::SetMemoryBudget(1 << 20));
        let thin = again.recording();
        assert!(thin.memory_budget_bytes == 1 << 20 && thin.memory_bytes() < after.memory_bytes());
        assert!(thin.runs[0].memory.summaries > 0);
        for (before, after) in before.runs.iter().zip(&after.runs) {
            let newest = |run: &crate::session::RunRecord| run.steps.last().unwrap().report.window.clone();
            assert_eq!(newest(before), newest(after));
        }
    }

    #[test]
    fn what_is_no_session_is_refused() {
        let saved = Session::start(garden(3.0)).unwrap().saved(None);
        let refused = |text: &str| SavedSession::from_text(text).unwrap_err().to_string();
        assert!(refused("hello").contains("no saved session"));
        assert!(refused("{}").contains("session_version"));
        assert!(refused("{\"session_version\": 9}").contains("version 9"));
        let problem = |saved: SavedSession| saved.open().err().map(|error| error.to_string()).unwrap_or_default();
        assert!(problem(SavedSession { runs: vec!["minimol".to_owned()], ..saved.clone() }).contains("minimol"));
        let breakpoints = vec![SavedBreakpoint { condition: "rank <".to_owned(), enabled: true }];
        assert!(problem(SavedSession { breakpoints, ..saved.clone() }).contains("column 7"));
        let log = SavedLog { crc32: saved.log.crc32 ^ 1, ..saved.log.clone() };
        let mut other = SavedSession { log, ..saved }.open().unwrap();
        assert!(other.take_notices()[0].contains("not the one"));
    }
}
