//! The result of a run: its numbers, whether it can be trusted, and the accuracy that is required of it.
//!
//! - `answer`: trust, cause and required accuracy in one sentence.
//! - `motion`: the motion that brings its parameters to the required accuracy.
//! - `run_summary`: content of `summary.json`.
//! - `withheld`: verdicts on the calibration of a run that is not trusted.
//! - `truth`: errors against ground truth, and whether it fits the run.

mod answer;
mod motion;
mod run_summary;
pub(in crate::session) mod truth;
mod withheld;

pub use answer::{Answer, FindingSource, Requirement, RunFinding};
pub use motion::{motion_after, motion_text, short_motion_text};
pub use run_summary::{
    FrameCounts, RankSummary, RunSummary, StageSummary, TimingSummary, summarize, summarize_with_motion,
};
pub use withheld::{Withheld, flight_table};
