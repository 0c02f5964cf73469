use crate::session::breakpoints::Condition;
use crate::session::plan::{ForkChanges, RunSpec};

/// How fast the cursor moves, in log seconds per second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaybackSpeed(pub f64);

/// What a person, a key or the command line may ask of a session; applied between two pictures, in one place.
#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// Let the cursor run.
    Play,
    /// Hold the cursor.
    Pause,
    /// Play when paused, pause when playing.
    TogglePlay,
    /// Change the speed.
    SetSpeed(PlaybackSpeed),
    /// Put the cursor at a time since the log began.
    Seek {
        /// Where to, in nanoseconds.
        stamp_ns: i64,
    },
    /// Move the cursor by whole frames, backwards when negative.
    StepFrames(i64),
    /// Look at the step at the cursor one iteration of its solver further, or back; beyond its ends at its neighbours.
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
        /// Which one.
        number: usize,
        /// When it is to be hit.
        condition: Condition,
    },
    /// Enable or disable a breakpoint.
    EnableBreakpoint {
        /// Which one.
        number: usize,
        /// Whether it stops the cursor from now on.
        enabled: bool,
    },
    /// Take a breakpoint away, by its number.
    RemoveBreakpoint(usize),
    /// Set a breakpoint at the frame of the cursor, or take it away.
    ToggleBreakpointHere,
    /// Run to the next (`forward`) or the previous hit of a breakpoint; forward waits for the estimators where they have
    /// not come there yet.
    RunToBreakpoint {
        /// Direction.
        forward: bool,
    },
    /// To the first frame.
    GoToStart,
    /// To the last computed frame.
    GoToEnd,
    /// Play a range over and over; `None` ends it.
    SetLoop(Option<(i64, i64)>),
    /// Set or clear a marker at the cursor.
    ToggleMarker,
    /// Add a run over the same log.
    AddRun(RunSpec),
    /// Let a run go on from the step at the cursor in another way, beside what it did.
    Fork {
        /// Number of the run to leave.
        run: usize,
        /// What to do otherwise.
        changes: ForkChanges,
        /// The fork's name; `None` for one made of what changes and when.
        label: Option<String>,
    },
    /// Take a run away, by its number.
    RemoveRun(usize),
    /// Recompute the linearized rows of a step's factors; they come into [`RunRecord::factor_rows`] and stay requested
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
