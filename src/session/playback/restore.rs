//! Saving and restoring sessions.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::Arc;

use super::markers::Markers;
use super::saved::{
    PendingRestore, PendingRun, SavedBreakpoint, SavedFork, SavedLog, SavedPrior, SavedSession, SavedSessionError,
    VERSION, entry_error,
};
use super::session::Session;
use crate::sensors::RequiredAccuracy;
use crate::session::breakpoints::Condition;
use crate::session::plan::{
    FlightPrior, ForkChanges, RunSpec, SessionPlan, SessionRequest, TrajectorySource, TrajectorySpec,
};

impl SavedSession {
    /// Opens the log and starts the runs; `prior` is the calibration at [`Self::prior`]. Forks are started when their
    /// parents reach the fork's first step, and the cursor is set to its position when all runs have reached it.
    pub fn open(&self, prior: Option<Arc<FlightPrior>>) -> Result<Session, SavedSessionError> {
        let request = self.request()?;
        let (specs, pending) = self.in_order(request.specs.clone())?;
        let plan = SessionPlan::open(&SessionRequest { specs, prior, ..request })?;
        let conditions: Result<Vec<Condition>, _> = self.breakpoints.iter().map(|it| it.condition.parse()).collect();
        let conditions = conditions.map_err(entry_error)?;
        let same = (plan.log.size_bytes(), plan.log.checksum()) == (self.log.bytes, self.log.crc32);
        let mut session = Session::start(plan)?;
        if !same {
            let text = "The log file differs from the log of the saved session";
            session.notices.push(text.to_owned());
        }
        session.change_breakpoints(|all| {
            for (number, (condition, saved)) in conditions.into_iter().zip(&self.breakpoints).enumerate() {
                all.add(condition);
                all.enable(number, saved.enabled);
            }
        });
        session.markers = Markers::new(self.markers.clone());
        session.pending = PendingRestore { runs: pending, cursor_ns: Some(self.cursor_ns) };
        session.layout.clone_from(&self.layout);
        Ok(session)
    }

    /// Specifications of the runs before the first fork, then the first fork and all that follow it.
    fn in_order(&self, specs: Vec<RunSpec>) -> Result<(Vec<RunSpec>, VecDeque<PendingRun>), SavedSessionError> {
        let mut all: Vec<PendingRun> = specs.into_iter().map(PendingRun::Run).collect();
        for fork in &self.forks {
            let changes: ForkChanges = fork.changes.parse().map_err(entry_error)?;
            all.push(PendingRun::Fork(fork.clone(), changes));
        }
        let place = |run: &PendingRun| self.order.iter().position(|label| label == run.label());
        all.sort_by_key(|run| place(run).unwrap_or(usize::MAX));
        let first_fork = all.iter().position(|run| matches!(run, PendingRun::Fork(..))).unwrap_or(all.len());
        let pending = all.split_off(first_fork).into();
        let started = all.into_iter().filter_map(|run| match run {
            PendingRun::Run(spec) => Some(spec),
            PendingRun::Fork(..) => None,
        });
        Ok((started.collect(), pending))
    }
}

impl Session {
    /// The session for a file; `layout` is the layout of the panels.
    pub fn saved(&self, layout: Option<serde_json::Value>) -> SavedSession {
        let recording = self.recording();
        let (log, required) = (&self.plan.log, &recording.rig.required_accuracy);
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
        let started = recording.runs.iter().filter(|run| run.origin.is_none()).map(|run| run.spec.to_string());
        let (mut runs, mut forks): (Vec<String>, Vec<SavedFork>) = (started.collect(), forks.collect());
        for pending in &self.pending.runs {
            match pending {
                PendingRun::Run(spec) => runs.push(spec.to_string()),
                PendingRun::Fork(fork, _) => forks.push(fork.clone()),
            }
        }
        let labels = recording.runs.iter().map(|run| run.spec.label.as_str());
        let order = labels.chain(self.pending.runs.iter().map(PendingRun::label)).map(str::to_owned);
        let breakpoints = self.breakpoints.list().iter().map(|breakpoint| SavedBreakpoint {
            condition: breakpoint.condition.text().to_owned(),
            enabled: breakpoint.enabled,
        });
        SavedSession {
            session_version: VERSION,
            log: SavedLog { path: absolute(&self.plan.log_path), bytes: log.size_bytes(), crc32: log.checksum() },
            recording: self.plan.recording.iter().map(absolute).collect(),
            rig: self.plan.rig_path.as_ref().map(absolute),
            ground_truth: self.plan.ground_truth_path.as_ref().map(absolute),
            truth_trajectory: self.plan.truth_request.0.as_ref().map(|source| absolute_source(source).to_string()),
            lever_arm: self.plan.truth_request.1.map(|lever_arm| lever_arm.to_string()),
            required_accuracy: (*required != RequiredAccuracy::default())
                .then(|| required.to_text(&recording.rig.parameter_names())),
            start_s: self.plan.start_s,
            duration_s: self.plan.duration_s,
            runs,
            prior: self
                .plan
                .prior
                .as_ref()
                .map(|prior| SavedPrior { folder: absolute(&prior.folder), growth: prior.growth }),
            trajectories: self.plan.trajectories.iter().map(|loaded| saved_spec(&loaded.spec)).collect(),
            forks,
            order: order.collect(),
            breakpoints: breakpoints.collect(),
            markers: self.markers().to_vec(),
            cursor_ns: self.pending.cursor_ns.unwrap_or(self.cursor.stamp_ns),
            layout,
        }
    }

    /// Blocks until all runs are computed, all forks of a saved session are started, and the cursor is at its position.
    pub fn finish(&mut self) {
        const CHECK_MS: u64 = 5;
        let open = |session: &Self| {
            let pending = !session.pending.runs.is_empty() || session.pending.cursor_ns.is_some();
            pending || session.recording().runs.iter().any(|run| !run.finished)
        };
        while open(self) {
            self.advance(0.0);
            std::thread::sleep(std::time::Duration::from_millis(CHECK_MS));
        }
        self.advance(0.0);
    }

    /// True if the position of the cursor is still to be restored, when all runs have reached it.
    pub fn restores_cursor(&self) -> bool {
        self.pending.cursor_ns.is_some()
    }

    pub fn layout(&self) -> Option<&serde_json::Value> {
        self.layout.as_ref()
    }

    /// Starts the pending runs up to the first fork whose parent has not reached its first step, and sets the cursor to its
    /// saved position.
    pub(in crate::session) fn resume(&mut self) {
        while let Some(pending) = self.pending.runs.pop_front() {
            match pending {
                PendingRun::Run(spec) => self.add_run(spec),
                PendingRun::Fork(fork, changes) => {
                    if let Some(waiting) = self.restore_fork(fork, changes) {
                        self.pending.runs.push_front(waiting);
                        break;
                    }
                }
            }
        }
        let recording = self.recording();
        if let Some(cursor_ns) = self.pending.cursor_ns
            && self.pending.runs.is_empty()
            && recording.computed_ns() >= cursor_ns.min(recording.last_stamp_ns())
            && (recording.computed_ns() >= cursor_ns || recording.runs.iter().all(|run| run.finished))
        {
            self.pending.cursor_ns = None;
            self.cursor = self.cursor.seek(&recording, cursor_ns);
        }
    }

    /// Starts a fork; returns it while its parent has not reached its first step.
    fn restore_fork(&mut self, fork: SavedFork, changes: ForkChanges) -> Option<PendingRun> {
        let recording = self.recording();
        let parent = recording.runs.iter().position(|run| run.spec.label == fork.parent);
        let run = parent.and_then(|parent| recording.runs.get(parent));
        let reached = run.and_then(|run| run.steps.last()).is_some_and(|last| last.report.stamp_ns >= fork.stamp_ns);
        if let (Some(parent), true) = (parent, reached) {
            // Released before the record changes; otherwise the record would be copied.
            drop(recording);
            if let Err(problem) = self.fork_at(parent, fork.stamp_ns, &changes, Some(fork.name)) {
                self.notices.push(problem);
            }
        } else if run.is_none_or(|run| run.finished) {
            let text = format!("Fork {} not restored: run {} ends before its first step", fork.name, fork.parent);
            self.notices.push(text);
        } else {
            return Some(PendingRun::Fork(fork, changes));
        }
        None
    }
}

/// A trajectory as text, with the absolute path of its file.
fn saved_spec(spec: &TrajectorySpec) -> String {
    TrajectorySpec { source: absolute_source(&spec.source), label: spec.label.clone() }.to_string()
}

/// The source with the absolute path of its file.
fn absolute_source(source: &TrajectorySource) -> TrajectorySource {
    match source {
        TrajectorySource::File(path) => {
            TrajectorySource::File(std::path::absolute(path).unwrap_or_else(|_| path.clone()))
        }
        topic @ TrajectorySource::Topic(_) => topic.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::playback::{Command, Marker};

    fn garden(duration_s: f64) -> SessionPlan {
        let request = SessionRequest {
            log_path: PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../sample_logs/garden.mcap"),
            duration_s: Some(duration_s),
            ..SessionRequest::default()
        };
        SessionPlan::open(&request).unwrap()
    }

    fn settled(session: &mut Session) {
        let busy = |session: &Session| {
            !session.pending.runs.is_empty()
                || session.pending.cursor_ns.is_some()
                || session.recording().runs.iter().any(|run| !run.finished)
        };
        while busy(session) {
            session.advance(0.0);
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
    }

    #[test]
    fn a_restored_session_equals_the_saved_one() {
        // More steps than are always kept complete.
        let mut session = Session::start(garden(4.5)).unwrap();
        settled(&mut session);
        session.apply(Command::AddBreakpoint("features < 40".parse().unwrap()));
        session.apply(Command::AddBreakpoint("rank < 18 and tracking".parse().unwrap()));
        session.apply(Command::EnableBreakpoint { number: 0, enabled: false });
        session.apply(Command::GoToEnd);
        session.apply(Command::StepFrames(-4));
        session.apply(Command::ToggleMarker);
        let named = session.markers().with(Marker::new(1_000_000_000, "turn"));
        session.apply(Command::SetMarkers(named));
        assert_eq!(session.markers().len(), 2);
        let changes: ForkChanges = "classical,freeze=yaw.d".parse().unwrap();
        session.apply(Command::Fork { run: 0, changes, label: None });
        assert!(session.take_notices().is_empty());
        session.apply(Command::AddRun("static".parse().unwrap()));
        settled(&mut session);
        session.apply(Command::StepFrames(1));
        let layout = serde_json::json!({ "panels": [1, 2] });
        let saved = session.saved(Some(layout.clone()));
        assert_eq!(SavedSession::from_text(&saved.to_text()).unwrap(), saved);

        let mut again = SavedSession::from_text(&saved.to_text()).unwrap().open(None).unwrap();
        settled(&mut again);
        assert!(again.take_notices().is_empty());
        assert_eq!(again.layout(), Some(&layout));
        assert_eq!(again.saved(Some(layout)), saved);
        let (before, after) = (session.recording(), again.recording());
        let labels = |recording: &crate::session::Recording| -> Vec<String> {
            recording.runs.iter().map(|run| run.spec.label.clone()).collect()
        };
        assert_eq!(labels(&before).len(), 3);
        assert_eq!(labels(&before), labels(&after), "runs keep their places, and with them their colours");
        // A smaller memory budget summarizes older steps immediately.
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
    fn invalid_session_files_are_rejected() {
        let saved = Session::start(garden(3.0)).unwrap().saved(None);
        let refused = |text: &str| SavedSession::from_text(text).unwrap_err().to_string();
        assert!(refused("hello").contains("not a saved session"));
        assert!(refused("{}").contains("session_version"));
        assert!(refused("{\"session_version\": 9}").contains("version 9"));
        let problem = |saved: SavedSession| saved.open(None).err().map(|error| error.to_string()).unwrap_or_default();
        assert!(problem(SavedSession { runs: vec!["minimol".to_owned()], ..saved.clone() }).contains("minimol"));
        let breakpoints = vec![SavedBreakpoint { condition: "rank <".to_owned(), enabled: true }];
        assert!(problem(SavedSession { breakpoints, ..saved.clone() }).contains("column 7"));
        let log = SavedLog { crc32: saved.log.crc32 ^ 1, ..saved.log.clone() };
        let mut other = SavedSession { log, ..saved }.open(None).unwrap();
        assert!(other.take_notices()[0].contains("differs"));
    }
}
