use crate::session::breakpoints::Condition;
use crate::session::plan::{ForkChanges, RunSpec};

/// How fast the cursor moves, in log seconds per second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaybackSpeed(pub f64);

/// A command from a button, a key or the command line; applied between two frames of the window, in one place.
#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// Start playing.
    Play,
    /// Pause.
    Pause,
    /// Play when paused, pause when playing.
    TogglePlay,
    /// Change the speed.
    SetSpeed(PlaybackSpeed),
    /// Put the cursor at a time since the log began.
    Seek {
        /// Target, in nanoseconds.
        stamp_ns: i64,
    },
    /// Move the cursor by whole frames, backwards when negative.
    StepFrames(i64),
    /// Show the step at the cursor one iteration of its solver further, or back; beyond its ends, the neighbouring steps.
    StepIteration {
        /// Direction.
        forward: bool,
    },
    /// Move the cursor to the next event (`forward`) or the previous one.
    JumpToEvent {
        /// Direction.
        forward: bool,
    },
    /// Set a breakpoint.
    AddBreakpoint(Condition),
    /// Give a breakpoint another condition.
    ChangeBreakpoint {
        /// Its number.
        number: usize,
        /// The new condition.
        condition: Condition,
    },
    /// Enable or disable a breakpoint.
    EnableBreakpoint {
        /// Its number.
        number: usize,
        /// Whether it stops the cursor.
        enabled: bool,
    },
    /// Remove a breakpoint, by its number.
    RemoveBreakpoint(usize),
    /// Set a breakpoint at the frame of the cursor, or remove it.
    ToggleBreakpointHere,
    /// Run to the next (`forward`) or the previous hit of a breakpoint; forward waits for the estimators.
    RunToBreakpoint {
        /// Direction.
        forward: bool,
    },
    /// To the first frame.
    GoToStart,
    /// To the last computed frame.
    GoToEnd,
    /// Play a range in a loop; `None` ends it.
    SetLoop(Option<(i64, i64)>),
    /// Set or clear a marker at the cursor.
    ToggleMarker,
    /// Add a run over the same log.
    AddRun(RunSpec),
    /// Fork a run: continue it from the step at the cursor with changes, beside the run itself.
    Fork {
        /// Number of the run.
        run: usize,
        /// What changes.
        changes: ForkChanges,
        /// The fork's name; `None` for one made of changes and time.
        label: Option<String>,
    },
    /// Remove a run, by its number.
    RemoveRun(usize),
    /// Recompute the linearized rows of a step's factors; they come into `RunRecord::factor_rows` and stay requested
    /// while the cursor is at the step.
    RequestFactorRows {
        /// Number of the run.
        run: usize,
        /// Number of the step.
        step: usize,
    },
    /// Set how much memory the recording may take, in bytes.
    SetMemoryBudget(usize),
}
