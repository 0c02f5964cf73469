//! The cursor over a record: a plain value, moved by functions of the record that need no thread.

use super::command::{Command, PlaybackSpeed};
use crate::geometry::ns_from_seconds;
use crate::session::breakpoints::{Breakpoints, Hit};
use crate::session::record::{Recording, SolverPosition, StepRecord};

/// Position and state of playback.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cursor {
    /// Position, in nanoseconds since the log began.
    pub stamp_ns: i64,
    pub playing: bool,
    pub speed: PlaybackSpeed,
    /// Start and end of the loop range, in nanoseconds since the log began.
    pub loop_range_ns: Option<(i64, i64)>,
    /// The solver iteration at which the step is shown, `None` for the converged step.
    pub solver: Option<SolverPosition>,
    /// True while the cursor runs to a breakpoint that the estimators have not reached yet.
    pub running_to_breakpoint: bool,
}

/// The outcome of a move of the cursor that needs a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MoveOutcome {
    /// The cursor stopped at a breakpoint.
    Hit(Hit),
    NoBreakpoint,
    /// There is no hit before the cursor.
    NoHitBefore,
    /// There is no hit after the cursor in the whole log.
    NoHitAfter,
    /// The cursor reached the end of the log without a hit.
    NoHitToEnd,
    /// The speed is not a positive number.
    BadSpeed,
}

impl MoveOutcome {
    /// Message for the user.
    pub fn message(self, recording: &Recording, breakpoints: &Breakpoints) -> String {
        match self {
            Self::Hit(hit) => format!("Breakpoint {}", breakpoints.describe(recording, hit)),
            Self::NoBreakpoint => "No breakpoints: add one in the Breakpoints panel or press B".to_owned(),
            Self::NoHitBefore => "No breakpoint hit before this frame".to_owned(),
            Self::NoHitAfter => "No breakpoint hit after this frame".to_owned(),
            Self::NoHitToEnd => "No breakpoint hit up to the end of the log".to_owned(),
            Self::BadSpeed => "The playback speed must be positive".to_owned(),
        }
    }
}

/// A moved cursor and the outcome of the move.
pub type Moved = (Cursor, Option<MoveOutcome>);

impl Cursor {
    /// A paused cursor at a position, in nanoseconds since the log began.
    pub fn new(stamp_ns: i64) -> Self {
        Self {
            stamp_ns,
            playing: false,
            speed: PlaybackSpeed(1.0),
            loop_range_ns: None,
            solver: None,
            running_to_breakpoint: false,
        }
    }

    /// The cursor after a command, `None` for a command that does not affect it.
    pub fn apply(&self, command: &Command, recording: &Recording, breakpoints: &Breakpoints) -> Option<Moved> {
        let paused = Self { playing: false, ..*self };
        let (mut cursor, outcome) = match *command {
            Command::TogglePlay if self.playing => (paused, None),
            Command::Play | Command::TogglePlay => (self.play(recording), None),
            Command::Pause => (paused, None),
            Command::SetSpeed(speed) if speed.0.is_finite() && speed.0 > 0.0 => (Self { speed, ..*self }, None),
            Command::SetSpeed(_) => (*self, Some(MoveOutcome::BadSpeed)),
            Command::SetLoop(range) => {
                (Self { loop_range_ns: range.filter(|(start, end)| start < end), ..*self }, None)
            }
            Command::Seek { stamp_ns } => (self.seek(recording, stamp_ns), None),
            Command::GoToStart => (self.seek(recording, recording.first_stamp_ns()), None),
            Command::GoToEnd => (self.seek(recording, recording.last_stamp_ns()), None),
            Command::StepTime { by_ns } => (self.seek(recording, self.stamp_ns.saturating_add(by_ns)), None),
            Command::StepFrames(count) => (paused.step_frames(recording, count), None),
            Command::StepIteration { forward } => (paused.step_iteration(recording, forward), None),
            Command::JumpToEvent { forward } => (paused.jump_to_event(recording, forward), None),
            Command::JumpToKeyframe { run, forward } => (paused.jump_to_keyframe(recording, run, forward), None),
            Command::RunToBreakpoint { forward } => {
                let halted = Self { running_to_breakpoint: false, ..paused };
                halted.run_to_breakpoint(recording, breakpoints, forward)
            }
            _ => return None,
        };
        // Any other command cancels a run to a breakpoint.
        cursor.running_to_breakpoint &= matches!(command, Command::RunToBreakpoint { .. });
        if cursor.stamp_ns != self.stamp_ns && !matches!(command, Command::StepIteration { .. }) {
            cursor.solver = None;
        }
        Some((cursor, outcome))
    }

    /// The cursor after `elapsed_s` seconds of the wall clock. It waits at the last computed step, jumps back at the
    /// end of a loop, and stops at breakpoints and at the end of the log.
    pub fn advance(&self, recording: &Recording, breakpoints: &Breakpoints, elapsed_s: f64) -> Moved {
        let (mut cursor, outcome) = if self.running_to_breakpoint {
            self.run_on(recording, breakpoints)
        } else if self.playing {
            let moved = self.play_on(recording, elapsed_s);
            match breakpoints.next_after(recording, self.stamp_ns) {
                Some(hit) if hit.stamp_ns <= moved.stamp_ns => moved.stop_at(hit),
                _ => (moved, None),
            }
        } else {
            (*self, None)
        };
        if cursor.stamp_ns != self.stamp_ns {
            cursor.solver = None;
        }
        (cursor, outcome)
    }

    /// The cursor at a position, limited to the computed steps.
    pub fn seek(&self, recording: &Recording, stamp_ns: i64) -> Self {
        let last_ns = recording.last_stamp_ns();
        let first_ns = recording.first_stamp_ns().min(last_ns);
        Self { stamp_ns: stamp_ns.clamp(first_ns, last_ns), ..*self }
    }

    fn play(&self, recording: &Recording) -> Self {
        let at_end = recording.is_finished() && self.stamp_ns >= recording.last_stamp_ns();
        let stamp_ns = if at_end { recording.first_stamp_ns() } else { self.stamp_ns };
        Self { playing: true, stamp_ns, ..*self }
    }

    fn play_on(&self, recording: &Recording, elapsed_s: f64) -> Self {
        let mut cursor = *self;
        let mut next_ns = self.stamp_ns + ns_from_seconds(elapsed_s * self.speed.0);
        if let Some((start_ns, end_ns)) = self.loop_range_ns
            && !(start_ns..end_ns).contains(&next_ns)
        {
            next_ns = start_ns;
        }
        let computed_ns = recording.computed_ns();
        if next_ns >= computed_ns {
            next_ns = computed_ns;
            if recording.is_finished() && self.loop_range_ns.is_none() {
                cursor.playing = false;
            }
        }
        cursor.stamp_ns = next_ns;
        cursor
    }

    /// Moves by frames of all runs; equal stamps count once.
    fn step_frames(&self, recording: &Recording, count: i64) -> Self {
        self.step_over(recording, &stamps_ns(recording, |_| true), count)
    }

    fn jump_to_event(&self, recording: &Recording, forward: bool) -> Self {
        let notable = |step: &StepRecord| step.report.events.iter().any(|event| event.kind.is_notable());
        self.step_over(recording, &stamps_ns(recording, notable), if forward { 1 } else { -1 })
    }

    fn jump_to_keyframe(&self, recording: &Recording, run: usize, forward: bool) -> Self {
        let steps = recording.runs.get(run).into_iter().flat_map(|run| &run.steps);
        let keyframes = steps.filter(|step| step.report.keyframe);
        let stamps_ns: Vec<i64> = keyframes.map(|step| step.report.stamp_ns).collect();
        self.step_over(recording, &stamps_ns, if forward { 1 } else { -1 })
    }

    /// Moves to the `count`-th stamp after the cursor, or before the shown frame if negative, or to the last one in that
    /// direction; does not move if there is none.
    fn step_over(&self, recording: &Recording, stamps_ns: &[i64], count: i64) -> Self {
        let places = usize::try_from(count.unsigned_abs()).unwrap_or(usize::MAX);
        let target = if count >= 0 {
            let after = stamps_ns.partition_point(|stamp| *stamp <= self.stamp_ns);
            let target = after.saturating_add(places).saturating_sub(1).min(stamps_ns.len().saturating_sub(1));
            stamps_ns.get(target).copied().filter(|stamp| *stamp > self.stamp_ns)
        } else {
            // Between two frames the earlier one is shown already.
            let shown = recording.runs.iter().filter_map(|run| run.step_at(self.stamp_ns));
            let shown_ns = shown.map(|step| step.report.stamp_ns).max().unwrap_or(self.stamp_ns);
            let before = stamps_ns.partition_point(|stamp| *stamp < shown_ns);
            stamps_ns.get(before.saturating_sub(places)).copied().filter(|stamp| *stamp < self.stamp_ns)
        };
        Self { stamp_ns: target.unwrap_or(self.stamp_ns), ..*self }
    }

    /// Moves by one solver iteration in the step at the cursor, and on to the neighbouring steps.
    fn step_iteration(&self, recording: &Recording, forward: bool) -> Self {
        let steps = recording.runs.iter().filter_map(|run| run.steps.get(run.index_at(self.stamp_ns)?));
        let iterations = steps.map(|step| step.report.iterations.len()).max().unwrap_or(0);
        let position = self.solver.unwrap_or(SolverPosition::BeforeLast(0));
        if let Some(next) = position.moved(forward, iterations) {
            return Self { solver: Some(next), ..*self };
        }
        let beside = self.step_frames(recording, if forward { 1 } else { -1 });
        if beside.stamp_ns == self.stamp_ns {
            return *self;
        }
        let end = if forward { SolverPosition::AfterFirst(0) } else { SolverPosition::BeforeLast(0) };
        Self { solver: Some(end), ..beside }
    }

    /// Moves to the next or previous hit; forward, it keeps running while none is computed yet.
    fn run_to_breakpoint(&self, recording: &Recording, breakpoints: &Breakpoints, forward: bool) -> Moved {
        if !breakpoints.list().iter().any(|breakpoint| breakpoint.enabled) {
            return (*self, Some(MoveOutcome::NoBreakpoint));
        }
        let hit = if forward {
            breakpoints.next_after(recording, self.stamp_ns)
        } else {
            breakpoints.last_before(recording, self.stamp_ns)
        };
        match hit {
            Some(hit) => self.stop_at(hit),
            None if !forward => (*self, Some(MoveOutcome::NoHitBefore)),
            None if recording.is_finished() => (*self, Some(MoveOutcome::NoHitAfter)),
            None => (Self { running_to_breakpoint: true, ..*self }, None),
        }
    }

    /// Follows the estimators until a breakpoint is hit or the log ends.
    fn run_on(&self, recording: &Recording, breakpoints: &Breakpoints) -> Moved {
        if let Some(hit) = breakpoints.next_after(recording, self.stamp_ns) {
            return self.stop_at(hit);
        }
        let reached = Self { stamp_ns: recording.computed_ns().max(self.stamp_ns), ..*self };
        if recording.is_finished() {
            (Self { running_to_breakpoint: false, ..reached }, Some(MoveOutcome::NoHitToEnd))
        } else {
            (reached, None)
        }
    }

    fn stop_at(&self, hit: Hit) -> Moved {
        let stopped = Self { playing: false, running_to_breakpoint: false, stamp_ns: hit.stamp_ns, ..*self };
        (stopped, Some(MoveOutcome::Hit(hit)))
    }
}

/// Stamps of the steps of all runs that pass the filter, in ascending order without duplicates.
fn stamps_ns(recording: &Recording, wanted: impl Fn(&StepRecord) -> bool) -> Vec<i64> {
    let steps = recording.runs.iter().flat_map(|run| run.steps.iter());
    let mut stamps_ns: Vec<i64> = steps.filter(|step| wanted(step)).map(|step| step.report.stamp_ns).collect();
    stamps_ns.sort_unstable();
    stamps_ns.dedup();
    stamps_ns
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::tests::memory::recorded;
    use crate::simulation::{SyntheticOptions, synthetic_tracks};

    /// A run over four seconds of a synthetic flight, computed without threads.
    fn sample() -> &'static Recording {
        static SAMPLE: std::sync::OnceLock<Recording> = std::sync::OnceLock::new();
        SAMPLE.get_or_init(|| {
            let flight = synthetic_tracks(&SyntheticOptions { duration_s: 4.0, ..SyntheticOptions::default() });
            let mut run = recorded(&flight, "auto");
            run.finished = true;
            Recording {
                log_path: "synthetic.mcap".into(),
                rig: std::sync::Arc::new(flight.given_rig),
                ground_truth_rig: None,
                duration_ns: 4_000_000_000,
                start_ns: 0,
                epoch_ns: 0,
                prior: None,
                runs: vec![run],
                truth_is_batch: false,
                position_truth: None,
                trajectories: Vec::new(),
                check: None,
                agreement: std::sync::Arc::default(),
                is_being_checked: false,
                is_being_written: false,
                interruption: None,
                warnings: Vec::new(),
                memory_budget_bytes: usize::MAX,
            }
        })
    }

    fn stamps() -> Vec<i64> {
        stamps_ns(sample(), |_| true)
    }

    fn breakpoints(condition: &str) -> Breakpoints {
        let mut breakpoints = Breakpoints::default();
        breakpoints.add(condition.parse().unwrap());
        breakpoints.read(sample());
        breakpoints
    }

    /// The cursor after a command, without breakpoints.
    fn after(cursor: Cursor, command: &Command) -> Cursor {
        cursor.apply(command, sample(), &Breakpoints::default()).unwrap().0
    }

    #[test]
    fn frames_are_stepped_over_and_ends_hold() {
        let stamps = stamps();
        let (first, last) = (stamps[0], stamps[stamps.len() - 1]);
        let at_start = after(Cursor::new(0), &Command::GoToStart);
        assert_eq!(at_start, Cursor::new(first));
        assert_eq!(after(at_start, &Command::StepFrames(3)).stamp_ns, stamps[3]);
        assert_eq!(after(at_start, &Command::StepFrames(-1)), at_start);
        assert_eq!(after(at_start, &Command::StepFrames(i64::MAX)).stamp_ns, last);
        assert_eq!(after(Cursor::new(last), &Command::StepFrames(i64::MIN)).stamp_ns, first);
        assert_eq!(after(at_start, &Command::Seek { stamp_ns: i64::MAX }).stamp_ns, last);
        let playing = after(at_start, &Command::Play);
        assert!(playing.playing && !after(playing, &Command::StepFrames(1)).playing);
        // Between two frames the earlier one is shown, so that a step back leads to the one before it.
        let between = Cursor::new(stamps[3] + 1);
        assert_eq!(after(between, &Command::StepFrames(-1)).stamp_ns, stamps[2]);
        assert_eq!(after(between, &Command::StepFrames(1)).stamp_ns, stamps[4]);
        assert_eq!(after(Cursor::new(first + 1), &Command::StepFrames(-1)).stamp_ns, first);
        // Other commands are handled by the session.
        assert_eq!(at_start.apply(&Command::ToggleMarker, sample(), &Breakpoints::default()), None);
    }

    #[test]
    fn steps_in_time_go_on_playing_and_those_to_keyframes_pause() {
        let (first, last) = (stamps()[0], *stamps().last().unwrap());
        let playing = after(Cursor::new(first), &Command::Play);
        let later = after(playing, &Command::StepTime { by_ns: 1_000_000_000 });
        assert_eq!((later.stamp_ns, later.playing), (first + 1_000_000_000, true));
        assert_eq!(after(later, &Command::StepTime { by_ns: -1_000_000_000 }), playing);
        assert_eq!(after(later, &Command::StepTime { by_ns: i64::MIN }).stamp_ns, first);
        assert_eq!(after(later, &Command::StepTime { by_ns: i64::MAX }).stamp_ns, last);
        let keyframes: Vec<i64> =
            sample().runs[0].steps.iter().filter(|it| it.report.keyframe).map(|it| it.report.stamp_ns).collect();
        assert!(keyframes.len() > 3, "{keyframes:?}");
        let jump = |cursor, forward| after(cursor, &Command::JumpToKeyframe { run: 0, forward });
        let mut cursor = playing;
        for stamp_ns in keyframes.iter().filter(|stamp_ns| **stamp_ns > first) {
            cursor = jump(cursor, true);
            assert_eq!((cursor.stamp_ns, cursor.playing), (*stamp_ns, false));
        }
        assert_eq!(jump(cursor, true), cursor, "the last one");
        assert_eq!(jump(cursor, false).stamp_ns, keyframes[keyframes.len() - 2]);
        assert_eq!(after(cursor, &Command::JumpToKeyframe { run: 7, forward: true }), cursor, "no such run");
    }

    #[test]
    fn playing_stops_at_the_end_restarts_there_and_loops() {
        let stamps = stamps();
        let (first, last) = (stamps[0], stamps[stamps.len() - 1]);
        let none = Breakpoints::default();
        let playing = after(Cursor::new(first), &Command::Play);
        let faster = after(playing, &Command::SetSpeed(PlaybackSpeed(2.0)));
        assert_eq!(faster.advance(sample(), &none, 0.5).0.stamp_ns, first + 1_000_000_000);
        let (ended, _) = faster.advance(sample(), &none, 100.0);
        assert_eq!((ended.stamp_ns, ended.playing), (last, false));
        assert_eq!(after(ended, &Command::Play).stamp_ns, first);
        let looped = after(playing, &Command::SetLoop(Some((stamps[2], stamps[8]))));
        let (again, _) = looped.advance(sample(), &none, 100.0);
        assert_eq!((again.stamp_ns, again.playing), (stamps[2], true));
        // A paused cursor does not move, and a playing one waits for computed steps.
        assert_eq!(Cursor::new(first).advance(sample(), &none, 1.0), (Cursor::new(first), None));
        let mut growing = sample().clone();
        growing.runs[0].finished = false;
        let (waiting, _) = playing.advance(&growing, &none, 100.0);
        assert_eq!((waiting.stamp_ns, waiting.playing), (last, true));
    }

    #[test]
    fn iterations_of_the_solver_lead_on_to_the_neighbouring_steps() {
        let stamps = stamps();
        let number = stamps.len() - 1;
        let iterations = sample().runs[0].steps[number].report.iterations.len();
        let mut cursor = Cursor::new(stamps[number]);
        assert_eq!(after(cursor, &Command::StepIteration { forward: true }), cursor);
        for _ in 0..=iterations {
            cursor = after(cursor, &Command::StepIteration { forward: false });
        }
        assert_eq!((cursor.stamp_ns, cursor.solver), (stamps[number - 1], Some(SolverPosition::BeforeLast(0))));
        let forth = after(cursor, &Command::StepIteration { forward: true });
        assert_eq!((forth.stamp_ns, forth.solver), (stamps[number], Some(SolverPosition::AfterFirst(0))));
        assert_eq!(after(forth, &Command::StepFrames(-1)).solver, None);
    }

    #[test]
    fn breakpoints_stop_the_cursor_and_a_run_to_one_waits() {
        let stamps = stamps();
        let breakpoints = breakpoints("tracking");
        let hit = breakpoints.next_after(sample(), i64::MIN).unwrap();
        let start = Cursor::new(stamps[0]);
        let run = |cursor: Cursor, recording: &Recording, forward| {
            cursor.apply(&Command::RunToBreakpoint { forward }, recording, &breakpoints).unwrap()
        };
        let stopped = (Cursor::new(hit.stamp_ns), Some(MoveOutcome::Hit(hit)));
        assert_eq!(run(start, sample(), true), stopped);
        assert_eq!(run(Cursor::new(stamps[stamps.len() - 1]), sample(), false), stopped);
        assert_eq!(run(start, sample(), false).1, Some(MoveOutcome::NoHitBefore));
        assert_eq!(run(stopped.0, sample(), true).1, Some(MoveOutcome::NoHitAfter));
        assert_eq!(after(start, &Command::Play).advance(sample(), &breakpoints, 100.0), stopped);
        let none = start.apply(&Command::RunToBreakpoint { forward: true }, sample(), &Breakpoints::default());
        assert_eq!(none, Some((start, Some(MoveOutcome::NoBreakpoint))));

        // Without a hit it follows the estimators until another command or the end of the log.
        let mut growing = sample().clone();
        growing.runs[0].finished = false;
        let (running, outcome) = run(stopped.0, &growing, true);
        assert!(running.running_to_breakpoint && outcome.is_none());
        let (followed, _) = running.advance(&growing, &breakpoints, 0.0);
        assert_eq!(followed.stamp_ns, growing.last_stamp_ns());
        assert!(!after(followed, &Command::Pause).running_to_breakpoint);
        let (ended, outcome) = followed.advance(sample(), &breakpoints, 0.0);
        assert_eq!((ended.running_to_breakpoint, outcome), (false, Some(MoveOutcome::NoHitToEnd)));
    }
}
