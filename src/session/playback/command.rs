use super::markers::Markers;
use crate::sensors::RequiredAccuracy;
use crate::session::breakpoints::Condition;
use crate::session::plan::{ForkChanges, RunSpec};

/// Speed of playback, in log seconds per second of the wall clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaybackSpeed(pub f64);

/// A command from a button, a key or the command line; applied between two frames of the window, in one place.
#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    Play,
    Pause,
    /// Toggle between playback and pause.
    TogglePlay,
    SetSpeed(PlaybackSpeed),
    /// Move the cursor to a stamp.
    Seek {
        /// Target, in nanoseconds since the log began.
        stamp_ns: i64,
    },
    /// Move the cursor by this number of frames, backwards when negative.
    StepFrames(i64),
    /// Move the cursor by log time in nanoseconds, backwards when negative; playback goes on.
    StepTime {
        by_ns: i64,
    },
    /// Show the step at the cursor one solver iteration later or earlier; beyond its first or last iteration, the
    /// neighbouring step.
    StepIteration {
        /// Later (`true`) or earlier.
        forward: bool,
    },
    /// Move the cursor to the next event (`forward`) or the previous one.
    JumpToEvent {
        /// Next (`true`) or previous.
        forward: bool,
    },
    /// Move the cursor to the next keyframe of a run (`forward`) or the previous one.
    JumpToKeyframe {
        run: usize,
        /// Next (`true`) or previous.
        forward: bool,
    },
    AddBreakpoint(Condition),
    /// Replace the condition of a breakpoint.
    ChangeBreakpoint {
        number: usize,
        condition: Condition,
    },
    EnableBreakpoint {
        number: usize,
        /// True if it stops the cursor.
        enabled: bool,
    },
    RemoveBreakpoint(usize),
    /// Add a breakpoint at the frame of the cursor, or remove it.
    ToggleBreakpointHere,
    /// Run to the next or previous hit of a breakpoint; forward, it waits for the estimators.
    RunToBreakpoint {
        /// Next (`true`) or previous.
        forward: bool,
    },
    /// Move the cursor to the first frame.
    GoToStart,
    /// Move the cursor to the last computed frame.
    GoToEnd,
    /// Play a range of stamps in a loop; `None` ends the loop.
    SetLoop(Option<(i64, i64)>),
    /// Add or remove a marker at the cursor.
    ToggleMarker,
    /// Replace all markers, as after a change of a name.
    SetMarkers(Markers),
    /// Add a run on the same log.
    AddRun(RunSpec),
    /// Fork a run: a new run continues it from the step at the cursor with changes.
    Fork {
        run: usize,
        changes: ForkChanges,
        /// Label of the fork; `None` derives it from the changes and the stamp.
        label: Option<String>,
    },
    RemoveRun(usize),
    /// Find the cause of residuals of a run that disagree with their noise, on another thread.
    Diagnose {
        run: usize,
    },
    /// End the diagnosis with what is known so far.
    StopDiagnosis,
    /// Recompute the linearized rows of a step's factors. They are stored in `RunRecord::factor_rows` and stay
    /// requested while the cursor is at the step.
    RequestFactorRows {
        run: usize,
        step: usize,
    },
    /// Compare the calibration with this accuracy.
    RequireAccuracy(RequiredAccuracy),
    /// Set the memory budget of the recording in bytes.
    SetMemoryBudget(usize),
}
