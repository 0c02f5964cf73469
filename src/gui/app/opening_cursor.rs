//! Position of the cursor from the opening of a log until it is moved by anything else.

use super::playing_log::PlayingLog;
use crate::session::{Command, Recording, RunRecord};

/// Seconds of the wall clock between two moves of a cursor that follows the estimators.
const FOLLOW_PERIOD_S: f64 = 0.25;

/// Cursor of a newly opened log: at the first frame with an estimate, or, while runs compute, at the last computed frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum OpeningCursor {
    /// There is no frame yet.
    #[default]
    Waits,
    /// Follows the frames that all runs have computed, and ends at the last one.
    Follows {
        /// Position at the last move, in nanoseconds since the log began.
        cursor_ns: i64,
        /// Wall clock of the last move in seconds.
        moved_s: f64,
        /// True if the position of a saved session is still to be restored.
        restores: bool,
    },
    /// Moved by the user, or arrived.
    Left,
}

impl OpeningCursor {
    /// Moves the cursor of the log; `now_s` is the wall clock in seconds.
    pub(super) fn update(&mut self, log: &mut dyn PlayingLog, now_s: f64) {
        if *self == Self::Left {
            return;
        }
        let (recording, restores) = (log.recording(), log.restores_cursor());
        let computes = recording.is_computing();
        if let Self::Follows { cursor_ns, moved_s, restores: restored } = *self {
            let playback = log.playback();
            let moved = log.cursor_ns() != cursor_ns || playback.solver.is_some();
            if moved || playback.playing || playback.running_to_breakpoint || restored && !restores {
                *self = Self::Left;
                return;
            }
            if computes && now_s - moved_s < FOLLOW_PERIOD_S {
                return;
            }
        } else if recording.runs.iter().all(|run| run.steps.is_empty()) {
            return;
        } else if !computes && !restores {
            // A position that was chosen before stays.
            if log.cursor_ns() <= recording.first_stamp_ns() {
                log.apply(Command::Seek { stamp_ns: first_estimate_ns(&recording) });
            }
            *self = Self::Left;
            return;
        }
        log.apply(Command::Seek { stamp_ns: recording.computed_ns() });
        *self = if computes || restores {
            Self::Follows { cursor_ns: log.cursor_ns(), moved_s: now_s, restores }
        } else {
            Self::Left
        };
    }
}

/// Stamp of the first frame with a rank in any run, else with an estimated window, else of the first frame.
fn first_estimate_ns(recording: &Recording) -> i64 {
    let first = |has: fn(&crate::session::StepRecord) -> bool| {
        let of_run = |run: &RunRecord| run.steps.iter().find(|step| has(step)).map(|step| step.report.stamp_ns);
        recording.runs.iter().filter_map(of_run).min()
    };
    let ranked = first(|step| step.rank.as_ref().is_some_and(|rank| !rank.parameters.is_empty()));
    let estimated = || first(|step| step.report.newest().is_some());
    ranked.or_else(estimated).unwrap_or_else(|| recording.first_stamp_ns())
}
