//! A session that plays: a cursor over what the threads have computed so far.

use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, JoinHandle};

use super::command::{Command, PlaybackSpeed};
use super::saved::Pending;
use crate::flight_log::ImageReader;
use crate::geometry::{ns_from_seconds, seconds_from_ns};
use crate::sensors::GrayImage;
use crate::session::breakpoints::Breakpoints;
use crate::session::engine::{Detail, Engine, History, Retaking, STEPS_AT_ONCE, Wish};
use crate::session::plan::{
    ForkChanges, ForkError, MAX_RUNS, RunSpec, SessionError, SessionPlan, SessionRequest, cameras_of_run,
    distinct_labels,
};
use crate::session::record::{Recording, RunRecord, SolverPosition};

/// A recording that grows while others look at it.
#[derive(Debug)]
struct SharedRecording {
    recording: Mutex<Arc<Recording>>,
    generation: AtomicU64,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // What these hold is only ever replaced whole.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl SharedRecording {
    fn lock(&self) -> MutexGuard<'_, Arc<Recording>> {
        lock(&self.recording)
    }

    fn change(&self, change: impl FnOnce(&mut Recording)) {
        change(Arc::make_mut(&mut self.lock()));
        self.generation.fetch_add(1, Ordering::Release);
    }
}

/// A log with its runs, computed on threads of their own, and a cursor that plays over the results.
///
/// Nothing here waits for the estimators: a picture shows what is there.
#[derive(Debug)]
pub struct Session {
    pub(in crate::session) plan: SessionPlan,
    shared: Arc<SharedRecording>,
    engine: Engine,
    collector: Option<JoinHandle<()>>,
    retaking: Retaking,
    /// Where in the solver's work the step at the cursor is looked at.
    solver: Arc<Mutex<Option<SolverPosition>>>,
    pub(in crate::session) breakpoints: Arc<Breakpoints>,
    /// The cursor runs to the next hit, as fast as the estimators come.
    pub(in crate::session) running_on: bool,
    images: ImageReader,
    pub(in crate::session) cursor_ns: i64,
    pub(in crate::session) playing: bool,
    speed: PlaybackSpeed,
    loop_range_ns: Option<(i64, i64)>,
    pub(in crate::session) markers_ns: Vec<i64>,
    /// What is still to be done of a session that was opened from a file.
    pub(in crate::session) pending: Pending,
    /// Where the panels were when it was saved.
    pub(in crate::session) layout: Option<serde_json::Value>,
    pub(in crate::session) notices: Vec<String>,
}

impl Session {
    /// Opens the log and starts the runs.
    pub fn open(request: &SessionRequest) -> Result<Self, SessionError> {
        Self::start(SessionPlan::open(request)?)
    }

    /// Starts the runs of a plan.
    pub fn start(plan: SessionPlan) -> Result<Self, SessionError> {
        let recording = Recording::new(&plan);
        let mut engine = Engine::start(&plan, &recording)?;
        let shared =
            Arc::new(SharedRecording { recording: Mutex::new(Arc::new(recording)), generation: AtomicU64::new(1) });
        let receiver = engine.take_receiver();
        let target = Arc::clone(&shared);
        let collector = Builder::new()
            .name("collector".to_owned())
            .spawn(move || {
                for message in receiver.iter().flatten() {
                    target.change(|recording| recording.take(message));
                }
            })
            .map_err(|source| SessionError::Thread { source })?;
        let solver = Arc::new(Mutex::new(None));
        let (target, position) = (Arc::clone(&shared), Arc::clone(&solver));
        let retaking = Retaking::start(move |wish, retaken| {
            let position = lock(&position).unwrap_or(SolverPosition::BeforeLast(0));
            target.change(|recording| recording.take_retaken(wish, retaken, position));
        })?;
        let images = ImageReader::new(Arc::clone(&plan.log), &plan.rig);
        Ok(Self {
            cursor_ns: ns_from_seconds(plan.start_s),
            plan,
            shared,
            engine,
            collector: Some(collector),
            retaking,
            solver,
            breakpoints: Arc::default(),
            running_on: false,
            pending: Pending::default(),
            layout: None,
            images,
            playing: false,
            speed: PlaybackSpeed(1.0),
            loop_range_ns: None,
            markers_ns: Vec::new(),
            notices: Vec::new(),
        })
    }

    /// What has been computed so far; cheap.
    pub fn recording(&self) -> Arc<Recording> {
        Arc::clone(&self.shared.lock())
    }

    /// Changes whenever something new has been computed.
    pub fn generation(&self) -> u64 {
        self.shared.generation.load(Ordering::Acquire)
    }

    /// How much memory the recorded steps take, in bytes.
    pub fn memory_bytes(&self) -> usize {
        self.shared.lock().memory_bytes()
    }

    /// The log.
    pub fn log_path(&self) -> &Path {
        &self.plan.log_path
    }

    /// Where the cursor stands, since the log began.
    pub fn cursor_ns(&self) -> i64 {
        self.cursor_ns
    }

    /// Whether the cursor runs.
    pub fn is_playing(&self) -> bool {
        self.playing
    }

    /// How fast it runs.
    pub fn speed(&self) -> PlaybackSpeed {
        self.speed
    }

    /// The range that is played over and over.
    pub fn loop_range_ns(&self) -> Option<(i64, i64)> {
        self.loop_range_ns
    }

    /// Marked instants, in time order.
    pub fn markers_ns(&self) -> &[i64] {
        &self.markers_ns
    }

    /// The breakpoints with their hits so far.
    pub fn breakpoints(&self) -> &Arc<Breakpoints> {
        &self.breakpoints
    }

    /// Whether the cursor is on its way to a breakpoint that the estimators have not reached yet.
    pub fn is_running_on(&self) -> bool {
        self.running_on
    }

    /// What could not be done as asked, since the last call.
    pub fn take_notices(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notices)
    }

    /// An image of the log by camera and number in its stream, `None` when it is missing or not decodable.
    pub fn image(&self, camera_key: &str, frame_index: usize) -> Option<Arc<GrayImage>> {
        self.images.image(camera_key, frame_index).ok()
    }

    /// Lets the cursor run for `elapsed_s` seconds of the wall; it waits where nothing is computed yet, goes round in a
    /// loop, and stops at the end.
    pub fn advance(&mut self, elapsed_s: f64) {
        self.evaluate_breakpoints();
        self.resume();
        let before_ns = self.cursor_ns;
        if self.running_on {
            self.run_on();
        } else if self.playing {
            self.move_on(elapsed_s);
            self.stop_at_breakpoint(before_ns);
        }
        if self.cursor_ns != before_ns {
            *lock(&self.solver) = None;
        }
        self.look();
    }

    fn move_on(&mut self, elapsed_s: f64) {
        let recording = self.recording();
        let mut next_ns = self.cursor_ns + ns_from_seconds(elapsed_s * self.speed.0);
        if let Some((begin_ns, end_ns)) = self.loop_range_ns
            && !(begin_ns..end_ns).contains(&next_ns)
        {
            next_ns = begin_ns;
        }
        let computed_ns = recording.computed_ns();
        if next_ns >= computed_ns {
            next_ns = computed_ns.max(self.cursor_ns.min(computed_ns));
            let finished = recording.runs.iter().all(|run| run.finished);
            if finished && self.loop_range_ns.is_none() {
                self.playing = false;
            }
        }
        self.cursor_ns = next_ns;
    }

    /// Does what a person asked for.
    pub fn apply(&mut self, command: Command) {
        let cursor_ns = self.cursor_ns;
        let iterating = matches!(command, Command::StepIteration { .. });
        self.running_on = false;
        self.perform(command);
        if self.cursor_ns != cursor_ns && !iterating {
            *lock(&self.solver) = None;
        }
        self.look();
    }

    /// Waits until the steps at the cursor are there with everything.
    pub fn settle(&self) {
        self.look();
        self.retaking.settle();
    }

    /// Whether steps at the cursor are being taken again.
    pub fn is_retaking(&self) -> bool {
        self.retaking.is_busy()
    }

    /// Where in the solver's work the step at the cursor is looked at, `None` at its end.
    pub fn solver_position(&self) -> Option<SolverPosition> {
        *lock(&self.solver)
    }

    /// Asks for what is needed to show the steps at the cursor, and forgets what is not needed any more.
    fn look(&self) {
        let recording = self.recording();
        let solver = self.solver_position();
        let (mut wishes, mut ahead) = (Vec::new(), Vec::new());
        for run in &recording.runs {
            let (Some(step), Some(history)) = (run.index_at(self.cursor_ns), &run.history) else { continue };
            let wish = |step, detail, ahead| Wish { run: run.id, history: Arc::clone(history), step, detail, ahead };
            if run.lacks(step) {
                // Whoever plays needs the next steps too, and all of them take no longer than the last.
                let end = step + if self.playing { STEPS_AT_ONCE } else { 1 };
                let last = (step..end).take_while(|step| run.lacks(*step)).last().unwrap_or(step);
                wishes.push(wish(last, Detail::Whole, false));
            }
            if solver.is_some() && run.trace.as_ref().is_none_or(|trace| trace.step != step) {
                wishes.push(wish(step, Detail::Iterations, false));
            }
            // People step back: what lies before is made ready while they look.
            let before = (step.saturating_sub(STEPS_AT_ONCE)..step).rev().find(|step| run.lacks(*step));
            if let Some(before) = before.filter(|_| !self.playing) {
                ahead.push(wish(before, Detail::Whole, true));
            }
        }
        wishes.extend(ahead);
        self.retaking.want(wishes);
        let stale = |run: &RunRecord| match (&run.trace, solver) {
            (None, _) => false,
            (Some(_), None) => true,
            (Some(trace), Some(position)) => {
                run.index_at(self.cursor_ns) != Some(trace.step) || trace.at != position.of(trace.iterations())
            }
        };
        if recording.runs.iter().any(stale) {
            let cursor_ns = self.cursor_ns;
            self.shared.change(|recording| {
                for run in &mut recording.runs {
                    let here = run.index_at(cursor_ns);
                    run.trace = run.trace.take().filter(|trace| Some(trace.step) == here).and_then(|mut trace| {
                        trace.at = solver?.of(trace.iterations());
                        Some(trace)
                    });
                }
            });
        }
    }

    pub(in crate::session) fn perform(&mut self, command: Command) {
        match command {
            Command::TogglePlay if self.playing => self.playing = false,
            Command::Play | Command::TogglePlay => self.play(),
            Command::Pause => self.playing = false,
            Command::SetSpeed(speed) if speed.0.is_finite() && speed.0 > 0.0 => self.speed = speed,
            Command::SetSpeed(_) => self.notices.push("The speed must be a positive number".to_owned()),
            Command::Seek { stamp_ns } => self.seek(stamp_ns),
            Command::StepFrames(count) => self.step_frames(count),
            Command::AddBreakpoint(condition) => self.change_breakpoints(|all| all.add(condition)),
            Command::ChangeBreakpoint { number, condition } => {
                self.change_breakpoints(|all| all.change(number, condition));
            }
            Command::EnableBreakpoint { number, enabled } => self.change_breakpoints(|all| all.enable(number, enabled)),
            Command::RemoveBreakpoint(number) => self.change_breakpoints(|all| all.remove(number)),
            Command::ToggleBreakpointHere => self.toggle_breakpoint_here(),
            Command::RunToBreakpoint { forward } => self.run_to_breakpoint(forward),
            Command::StepIteration { forward } => self.step_iteration(forward),
            Command::JumpToEvent { forward } => self.jump_to_event(forward),
            Command::GoToStart => self.seek(self.first_stamp_ns()),
            Command::GoToEnd => self.seek(self.recording().last_stamp_ns()),
            Command::SetLoop(range) => self.loop_range_ns = range.filter(|(begin, end)| begin < end),
            Command::ToggleMarker => self.toggle_marker(),
            Command::AddRun(spec) => self.add_run(spec),
            Command::Fork { run, changes, label } => {
                if let Err(problem) = self.fork_at(run, self.cursor_ns, &changes, label) {
                    self.notices.push(problem);
                }
            }
            Command::RemoveRun(run) => self.remove_run(run),
            Command::SetMemoryBudget(bytes) => {
                self.plan.memory_budget_bytes = bytes;
                self.shared.change(|recording| recording.set_memory_budget(bytes));
            }
        }
    }

    fn first_stamp_ns(&self) -> i64 {
        let recording = self.recording();
        let first = recording.runs.iter().filter_map(|run| run.steps.first()).map(|step| step.report.stamp_ns).min();
        first.unwrap_or_else(|| ns_from_seconds(self.plan.start_s))
    }

    fn play(&mut self) {
        let recording = self.recording();
        let finished = recording.runs.iter().all(|run| run.finished);
        if finished && self.cursor_ns >= recording.last_stamp_ns() {
            self.cursor_ns = self.first_stamp_ns();
        }
        self.playing = true;
    }

    fn seek(&mut self, stamp_ns: i64) {
        let last_ns = self.recording().last_stamp_ns();
        let first_ns = self.first_stamp_ns().min(last_ns);
        self.cursor_ns = stamp_ns.clamp(first_ns, last_ns);
    }

    /// Moves over the frames of all runs, each instant once.
    fn step_frames(&mut self, count: i64) {
        self.playing = false;
        let recording = self.recording();
        let stamps_ns = instants_ns(&recording, |_| true);
        self.cursor_ns = moved(&stamps_ns, self.cursor_ns, count).unwrap_or(self.cursor_ns);
    }

    /// Goes through the solver's work of the step at the cursor, and on to the neighbouring steps.
    fn step_iteration(&mut self, forward: bool) {
        self.playing = false;
        let recording = self.recording();
        let steps = recording.runs.iter().filter_map(|run| run.steps.get(run.index_at(self.cursor_ns)?));
        let iterations = steps.map(|step| step.report.iterations.len()).max().unwrap_or(0);
        let position = self.solver_position().unwrap_or(SolverPosition::BeforeLast(0));
        let next = position.moved(forward, iterations).or_else(|| {
            let cursor_ns = self.cursor_ns;
            self.step_frames(if forward { 1 } else { -1 });
            let beyond = if forward { SolverPosition::AfterFirst(0) } else { SolverPosition::BeforeLast(0) };
            (self.cursor_ns != cursor_ns).then_some(beyond)
        });
        if let Some(next) = next {
            *lock(&self.solver) = Some(next);
        }
    }

    fn jump_to_event(&mut self, forward: bool) {
        self.playing = false;
        let recording = self.recording();
        let stamps_ns = instants_ns(&recording, |step| step.report.events.iter().any(|event| event.kind.is_notable()));
        self.cursor_ns = moved(&stamps_ns, self.cursor_ns, if forward { 1 } else { -1 }).unwrap_or(self.cursor_ns);
    }

    fn toggle_marker(&mut self) {
        match self.markers_ns.binary_search(&self.cursor_ns) {
            Ok(index) => {
                self.markers_ns.remove(index);
            }
            Err(index) => self.markers_ns.insert(index, self.cursor_ns),
        }
    }

    fn add_run(&mut self, spec: RunSpec) {
        let result = (|| {
            if self.plan.runs.len() >= MAX_RUNS {
                return Err(SessionError::TooManyRuns { count: self.plan.runs.len() + 1 });
            }
            let mut specs: Vec<RunSpec> = self.plan.runs.iter().map(|(spec, _)| spec.clone()).collect();
            specs.push(spec);
            distinct_labels(&mut specs);
            let Some(spec) = specs.pop() else { return Ok(()) };
            let camera_key = cameras_of_run(&self.plan.rig, &spec)?.main.key.clone();
            self.plan.runs.push((spec.clone(), camera_key.clone()));
            self.shared.change(|recording| recording.add_run(RunRecord::new(spec, camera_key)));
            self.engine.start_runs(&self.plan, &self.recording(), &[self.plan.runs.len() - 1])
        })();
        if let Err(error) = result {
            self.notices.push(error.to_string());
        }
    }

    /// Makes a fork of a run at a time: the step there is its first own one.
    pub(in crate::session) fn fork_at(
        &mut self,
        run: usize,
        stamp_ns: i64,
        changes: &ForkChanges,
        label: Option<String>,
    ) -> Result<(), String> {
        if self.plan.runs.len() >= MAX_RUNS {
            return Err(SessionError::TooManyRuns { count: self.plan.runs.len() + 1 }.to_string());
        }
        let recording = self.recording();
        let none = |run: usize| ForkError::NoStep { run: run.to_string() }.to_string();
        let parent = recording.runs.get(run).ok_or_else(|| none(run))?;
        let no_step = || ForkError::NoStep { run: parent.spec.label.clone() }.to_string();
        let step = parent.index_at(stamp_ns).ok_or_else(no_step)?;
        let way = parent.history.as_ref().ok_or_else(no_step)?;
        let mut engine = way.engine_before(step).ok_or_else(no_step)?;
        changes.apply(&mut engine, &self.plan.rig, &parent.camera_key).map_err(|error| error.to_string())?;
        let mut spec = changes.spec(&parent.spec, seconds_from_ns(parent.steps[step].report.stamp_ns));
        spec.label = label.unwrap_or(spec.label);
        let mut specs: Vec<RunSpec> = self.plan.runs.iter().map(|(spec, _)| spec.clone()).chain([spec]).collect();
        distinct_labels(&mut specs);
        let Some(spec) = specs.pop() else { return Ok(()) };
        let mut fork = RunRecord::fork(parent, spec.clone(), step, changes.clone());
        let history = Arc::new(History::fork(way, step, self.plan.memory_budget_bytes));
        fork.history = Some(Arc::clone(&history));
        self.plan.runs.push((spec, fork.camera_key.clone()));
        self.shared.change(|recording| recording.add_run(fork));
        let number = self.plan.runs.len() - 1;
        self.engine.start_fork(number, engine, history).map_err(|error| error.to_string())
    }

    /// Takes the last run away; an earlier one keeps its number, so only the last can go.
    fn remove_run(&mut self, run: usize) {
        let last = self.plan.runs.len().saturating_sub(1);
        let finished = self.recording().runs.get(run).is_some_and(|run| run.finished);
        if run == last && run > 0 && finished {
            self.plan.runs.pop();
            self.shared.change(|recording| {
                recording.runs.pop();
            });
        } else {
            self.notices.push("Only the last run can be removed, once it is computed".to_owned());
        }
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        self.engine = Engine::default();
        self.engine.no_more_runs();
        if let Some(collector) = self.collector.take() {
            drop(collector.join());
        }
    }
}

/// Stamps of the steps of all runs that pass the filter, in order, each once.
fn instants_ns(recording: &Recording, wanted: impl Fn(&crate::session::StepRecord) -> bool) -> Vec<i64> {
    let mut stamps_ns: Vec<i64> = recording
        .runs
        .iter()
        .flat_map(|run| run.steps.iter())
        .filter(|step| wanted(step))
        .map(|step| step.report.stamp_ns)
        .collect();
    stamps_ns.sort_unstable();
    stamps_ns.dedup();
    stamps_ns
}

/// The stamp `count` places after the cursor (before it when negative), or the outermost one; `None` when there is none
/// in that direction.
fn moved(stamps_ns: &[i64], cursor_ns: i64, count: i64) -> Option<i64> {
    if count >= 0 {
        let after = stamps_ns.partition_point(|stamp| *stamp <= cursor_ns);
        let target = (after + count as usize).saturating_sub(1).min(stamps_ns.len().saturating_sub(1));
        stamps_ns.get(target).copied().filter(|stamp| *stamp > cursor_ns)
    } else {
        let before = stamps_ns.partition_point(|stamp| *stamp < cursor_ns);
        let target = before.saturating_sub(count.unsigned_abs() as usize);
        stamps_ns.get(target).copied().filter(|stamp| *stamp < cursor_ns)
    }
}
