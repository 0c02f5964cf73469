use super::RunSpec;

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
    /// Take a run away, by its number.
    RemoveRun(usize),
}
