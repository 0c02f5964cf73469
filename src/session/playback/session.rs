//! A session with playback: a cursor over the results that the threads have computed so far.

use std::path::Path;
use std::sync::Arc;

use super::background_check::BackgroundCheck;
use super::background_diagnosis::{BackgroundDiagnosis, DiagnosisProgress};
use super::background_images::{BackgroundImages, FrameImage};
use super::command::{Command, PlaybackSpeed};
use super::cursor::{Cursor, MoveOutcome};
use super::markers::Markers;
use super::saved::PendingRestore;
use super::shared::{SharedComputation, Wake};
use crate::flight_log::{FlightLog, ImageReader};
use crate::geometry::ns_from_seconds;
use crate::log_check::CheckReport;
use crate::sensors::Rig;
use crate::session::breakpoints::{Breakpoints, Condition};
use crate::session::engine::{Computation, Engine, RecomputeThread};
use crate::session::plan::{SessionError, SessionPlan, SessionRequest};
use crate::session::record::{Recording, SolverPosition};

/// A step whose factor rows are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FactorRowsView {
    /// Id of the run, [`RunRecord::id`](crate::session::RunRecord::id).
    pub(super) run: u64,
    pub(super) step: usize,
}

/// A log with its runs, computed on their own threads, and a cursor over the results.
///
/// It connects the [`Cursor`], a plain value, the engine, which computes and recomputes steps, and the record that both
/// read. Only methods documented as blocking wait for the estimators.
#[derive(Debug)]
pub struct Session {
    pub(super) plan: SessionPlan,
    pub(super) shared: SharedComputation,
    pub(super) engine: Engine,
    pub(super) recompute: RecomputeThread,
    pub(super) cursor: Cursor,
    pub(super) breakpoints: Arc<Breakpoints>,
    pub(super) markers: Markers,
    /// The step whose factor rows are shown.
    pub(super) factor_rows: Option<FactorRowsView>,
    /// Forks and cursor position of a saved session that are still to be restored.
    pub(super) pending: PendingRestore,
    pub(super) layout: Option<serde_json::Value>,
    pub(super) notices: Vec<String>,
    images: BackgroundImages,
    diagnosis: Option<BackgroundDiagnosis>,
    check: Option<BackgroundCheck>,
}

impl Session {
    /// Opens the log and starts the runs.
    pub fn open(request: &SessionRequest) -> Result<Self, SessionError> {
        Self::start(SessionPlan::open(request)?)
    }

    pub fn start(plan: SessionPlan) -> Result<Self, SessionError> {
        let computation = Computation::new(&plan);
        let mut engine = Engine::start(&plan, &computation)?;
        let mut shared = SharedComputation::new(computation);
        shared.collect(engine.take_receiver())?;
        let recompute = RecomputeThread::start(shared.receiver_of_recomputed())?;
        let images = BackgroundImages::start(ImageReader::new(Arc::clone(&plan.log), &plan.rig))?;
        Ok(Self {
            cursor: Cursor::new(ns_from_seconds(plan.start_s)),
            plan,
            shared,
            engine,
            recompute,
            breakpoints: Arc::default(),
            markers: Markers::default(),
            factor_rows: None,
            pending: PendingRestore::default(),
            layout: None,
            notices: Vec::new(),
            images,
            diagnosis: None,
            check: None,
        })
    }

    /// Calls `check` with the log and its rig on a thread of its own, after the first step; the findings appear in the
    /// record. A log that is being written is checked once it has ended.
    ///
    /// # Errors
    /// If no thread can be started.
    pub fn check_in_background(
        &mut self,
        check: impl FnOnce(&Arc<FlightLog>, &Rig) -> CheckReport + Send + 'static,
    ) -> Result<(), SessionError> {
        let (log, rig) = (Arc::clone(&self.plan.log), Arc::clone(&self.plan.rig));
        let (has_begun, store) = self.shared.receiver_of_check(&log);
        let check = move || {
            // Of a log that was being written, only topics, rates and warnings of the first seconds are known.
            let complete = if log.is_followed() { log.reopened().ok() } else { None };
            check(&complete.map_or(log, Arc::new), &rig)
        };
        self.check = Some(BackgroundCheck::start(check, has_begun, store)?);
        Ok(())
    }

    /// Calls `check` with the log and its rig; returns when the findings are in the record.
    pub fn check_log(&self, check: impl FnOnce(&Arc<FlightLog>, &Rig) -> CheckReport) {
        let checked = check(&self.plan.log, &self.plan.rig);
        self.shared.change(|computation| computation.set_check(checked));
    }

    /// The reports so far; a cheap copy.
    pub fn recording(&self) -> Arc<Recording> {
        self.shared.recording()
    }

    /// The reports so far with the histories to recompute them; a cheap copy.
    pub fn computation(&self) -> Computation {
        self.shared.computation()
    }

    /// A counter that grows with every computed step and every change of the record.
    pub fn generation(&self) -> u64 {
        self.shared.generation()
    }

    /// Calls `wake` from now on when steps at the cursor have been recomputed, on the thread that computes them.
    pub fn wake_with(&self, wake: Wake) {
        self.shared.wake_with(wake);
    }

    /// Memory of record and histories in bytes.
    pub fn memory_bytes(&self) -> usize {
        self.recording().memory_bytes()
    }

    pub fn log_path(&self) -> &Path {
        &self.plan.log_path
    }

    pub fn cursor(&self) -> &Cursor {
        &self.cursor
    }

    /// Moves the cursor to a position as soon as all runs have reached it.
    pub fn seek_when_computed(&mut self, stamp_ns: i64) {
        self.pending.cursor_ns = Some(stamp_ns);
    }

    /// The cursor's position in nanoseconds since the log began.
    pub fn cursor_ns(&self) -> i64 {
        self.cursor.stamp_ns
    }

    pub fn is_playing(&self) -> bool {
        self.cursor.playing
    }

    pub fn speed(&self) -> PlaybackSpeed {
        self.cursor.speed
    }

    /// Start and end of the loop range, in nanoseconds since the log began.
    pub fn loop_range_ns(&self) -> Option<(i64, i64)> {
        self.cursor.loop_range_ns
    }

    /// True while the cursor runs to a breakpoint that the estimators have not reached yet.
    pub fn is_running_to_breakpoint(&self) -> bool {
        self.cursor.running_to_breakpoint
    }

    /// The solver iteration at which the step at the cursor is shown, `None` for the converged step.
    pub fn solver_position(&self) -> Option<SolverPosition> {
        self.cursor.solver
    }

    pub fn markers(&self) -> &Markers {
        &self.markers
    }

    /// The breakpoints with their hits so far.
    pub fn breakpoints(&self) -> &Arc<Breakpoints> {
        &self.breakpoints
    }

    /// Messages about commands that failed, since the last call.
    pub fn take_notices(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notices)
    }

    /// Image of the log by camera key and index in its stream; waits a few milliseconds for an image of a video.
    pub fn image(&self, camera_key: &str, frame_index: usize) -> FrameImage {
        self.images.image(camera_key, frame_index)
    }

    /// Image of the log by camera key and index in its stream; blocks until it is decoded.
    pub fn decoded_image(&self, camera_key: &str, frame_index: usize) -> FrameImage {
        self.images.decoded_image(camera_key, frame_index)
    }

    /// Moves the cursor by `elapsed_s` seconds of the wall clock; see [`Cursor::advance`].
    pub fn advance(&mut self, elapsed_s: f64) {
        self.note_growth();
        self.evaluate_breakpoints();
        self.resume();
        let recording = self.recording();
        let (cursor, outcome) = self.cursor.advance(&recording, &self.breakpoints, elapsed_s);
        self.cursor = cursor;
        self.notice(&recording, outcome);
        self.request_recomputation();
    }

    /// Stores the length of a log that another program is writing.
    fn note_growth(&self) {
        let log = &self.plan.log;
        if !log.is_followed() {
            return;
        }
        log.look_for_growth();
        let is_being_written = log.end().is_none();
        let interruption = log.reception().filter(|_| is_being_written).and_then(|reception| reception.problem());
        let recording = self.recording();
        let known = (recording.duration_ns, recording.is_being_written, &recording.interruption);
        if (log.duration_ns(), is_being_written, &interruption) != known {
            let duration_ns = log.duration_ns();
            self.shared.change(|computation| computation.set_written(duration_ns, is_being_written, interruption));
        }
    }

    pub fn apply(&mut self, command: Command) {
        self.evaluate_breakpoints();
        let recording = self.recording();
        match self.cursor.apply(&command, &recording, &self.breakpoints) {
            Some((cursor, outcome)) => {
                self.cursor = cursor;
                self.notice(&recording, outcome);
            }
            None => self.perform(command),
        }
        self.request_recomputation();
    }

    fn notice(&mut self, recording: &Recording, outcome: Option<MoveOutcome>) {
        self.notices.extend(outcome.map(|outcome| outcome.message(recording, &self.breakpoints)));
    }

    /// Executes a command that does not affect the cursor.
    fn perform(&mut self, command: Command) {
        // A panel may request factor rows while it is drawn; that does not cancel a run to a breakpoint.
        self.cursor.running_to_breakpoint &= matches!(command, Command::RequestFactorRows { .. });
        match command {
            Command::AddBreakpoint(condition) => self.change_breakpoints(|all| all.add(condition)),
            Command::ChangeBreakpoint { number, condition } => {
                self.change_breakpoints(|all| all.change(number, condition));
            }
            Command::EnableBreakpoint { number, enabled } => self.change_breakpoints(|all| all.enable(number, enabled)),
            Command::RemoveBreakpoint(number) => self.change_breakpoints(|all| all.remove(number)),
            Command::ToggleBreakpointHere => self.toggle_breakpoint_here(),
            Command::ToggleMarker => self.markers = self.markers.toggled(self.cursor.stamp_ns),
            Command::SetMarkers(markers) => self.markers = markers,
            Command::AddRun(spec) => self.add_run(spec),
            Command::Fork { run, changes, label } => {
                if let Err(problem) = self.fork_at(run, self.cursor.stamp_ns, &changes, label) {
                    self.notices.push(problem);
                }
            }
            Command::RemoveRun(run) => self.remove_run(run),
            Command::Diagnose { run } => self.diagnose(run),
            Command::StopDiagnosis => self.diagnosis.iter().for_each(BackgroundDiagnosis::stop),
            Command::RequestFactorRows { run, step } => self.request_factor_rows(run, step),
            Command::RequireAccuracy(required) => {
                self.shared.change(|computation| computation.set_required_accuracy(required));
            }
            Command::SetMemoryBudget(bytes) => {
                self.plan.memory_budget_bytes = bytes;
                self.shared.change(|computation| computation.set_memory_budget(bytes));
            }
            Command::Play
            | Command::Pause
            | Command::TogglePlay
            | Command::SetSpeed(_)
            | Command::Seek { .. }
            | Command::StepFrames(_)
            | Command::StepTime { .. }
            | Command::JumpToKeyframe { .. }
            | Command::StepIteration { .. }
            | Command::JumpToEvent { .. }
            | Command::RunToBreakpoint { .. }
            | Command::GoToStart
            | Command::GoToEnd
            | Command::SetLoop(_) => {}
        }
    }

    /// Progress of the diagnosis; `None` while there is none.
    pub fn diagnosis(&self) -> Option<DiagnosisProgress> {
        self.diagnosis.as_ref().and_then(BackgroundDiagnosis::progress)
    }

    fn diagnose(&mut self, run: usize) {
        // The earlier diagnosis ends first.
        self.diagnosis = None;
        let Some(id) = self.recording().runs.get(run).map(|run| run.id) else { return };
        self.shared.change(|computation| computation.set_diagnosis(id, None));
        match BackgroundDiagnosis::start(self.computation(), run, self.shared.receiver_of_diagnosis(id)) {
            Ok(diagnosis) => self.diagnosis = Some(diagnosis),
            Err(error) => self.notices.push(error.to_string()),
        }
    }

    /// Evaluates the breakpoints over the new steps.
    fn evaluate_breakpoints(&mut self) {
        let recording = self.recording();
        if self.breakpoints.is_behind(&recording) {
            Arc::make_mut(&mut self.breakpoints).read(&recording);
        }
    }

    pub(super) fn change_breakpoints(&mut self, change: impl FnOnce(&mut Breakpoints)) {
        change(Arc::make_mut(&mut self.breakpoints));
        self.evaluate_breakpoints();
    }

    /// Adds a breakpoint at the frame of the cursor, or removes it.
    fn toggle_breakpoint_here(&mut self) {
        let recording = self.recording();
        let here = recording.runs.iter().find_map(|run| run.step_at(self.cursor.stamp_ns));
        let text = here.map(|step| format!("frame == {}", step.report.frame_index));
        if let Some(Ok(condition)) = text.map(|text| text.parse::<Condition>()) {
            self.change_breakpoints(|all| all.toggle(condition));
        }
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        // A thread that waits for messages of a log that is being written would keep the session open.
        self.plan.log.end_following();
        // The collector thread ends with the last thread that sends to it.
        self.engine = Engine::default();
        self.engine.no_more_runs();
        self.shared.join();
    }
}
