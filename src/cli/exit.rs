//! The exit codes of the program, for scripts.

use std::process::ExitCode;

/// Outcome of a command that ended without an error; an error is exit code 1, wrong arguments are 2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ExitOutcome {
    Success,
    /// A run never initialized.
    NeverInitialized,
    /// `check` has found errors, or `history` a flight that does not agree with those before it.
    ErrorsFound,
    /// The condition of `--break` became true.
    BreakHit,
    /// A run does not reach the accuracy of `--require`.
    RequirementNotMet,
    /// Some jobs of a study have no result.
    JobsFailed,
    /// Ended by Ctrl+C; the results so far are written.
    Interrupted,
}

impl From<ExitOutcome> for ExitCode {
    fn from(outcome: ExitOutcome) -> Self {
        Self::from(match outcome {
            ExitOutcome::Success => 0,
            ExitOutcome::NeverInitialized => 3,
            ExitOutcome::ErrorsFound => 4,
            ExitOutcome::BreakHit => 5,
            ExitOutcome::JobsFailed => JOBS_FAILED,
            ExitOutcome::RequirementNotMet => 7,
            ExitOutcome::Interrupted => INTERRUPTED,
        })
    }
}

/// Exit code of an interrupted command, as in shells.
pub(crate) const INTERRUPTED: u8 = 130;

/// Exit code of a sweep in which some jobs have no result.
pub(crate) const JOBS_FAILED: u8 = 6;

/// Exit codes of commands without special ones, for `--help`.
pub(crate) const PLAIN: &str = "Exit codes: 0 success, 1 failure, 2 wrong use.";
/// Exit codes of `simulate`, `plan`, `convert`, `calibrate`, `noise` and `screenshot`.
pub(crate) const INTERRUPTIBLE: &str = "Exit codes: 0 success, 1 failure, 2 wrong use, 130 interrupted (Ctrl+C; files \
    that are not complete are not written; a second Ctrl+C ends at once).";
pub(crate) const RUN: &str = "Exit codes: 0 success, 1 failure, 2 wrong use, 3 a run never initialized, 5 the condition of \
    --break became true, 7 a run does not reach the accuracy of --require, 130 interrupted (Ctrl+C; the steps so far are \
    written; a second Ctrl+C ends at once).";
pub(crate) const REPORT: &str = "Exit codes: 0 success, 1 failure, 2 wrong use, 3 a run never initialized, 130 \
    interrupted (Ctrl+C; the steps so far are written; a second Ctrl+C ends at once).";
pub(crate) const SWEEP: &str = "Exit codes: 0 success, 1 failure, worse than the baseline, or jobs that have not run, 2 wrong \
    use, 6 jobs without a result (reasons in their rows), 130 interrupted (Ctrl+C; the next sweep resumes; a second Ctrl+C ends \
    at once).";
/// Exit codes of `diagnose`.
pub(crate) const DIAGNOSE: &str = "Exit codes: 0 a cause, several or none, 1 failure, 2 wrong use, 130 interrupted (Ctrl+C; what \
    is known so far is printed; a second Ctrl+C ends at once).";
/// Exit codes of `check`.
pub(crate) const HISTORY: &str =
    "Exit codes: 0 all flights agree, 1 failure, 2 wrong use, 4 a flight does not agree with those before it.";
pub(crate) const CHECK: &str =
    "Exit codes: 0 no errors found (possibly warnings and notes), 1 failure, 2 wrong use, 4 errors found.";
