//! The result of a run: its numbers, whether it can be trusted, and the accuracy that is required of it.
//!
//! - `answer`: trust, cause and required accuracy in one sentence.
//! - `run_summary`: content of `summary.json`.
//! - `withheld`: verdicts on the calibration of a run that is not trusted.
//! - `truth`: errors against ground truth, and whether it fits the run.

mod answer;
mod run_summary;
pub(in crate::session) mod truth;
mod withheld;

pub use answer::{Answer, FindingSource, Requirement, RunFinding};
pub use run_summary::{RankSummary, RunSummary, StageSummary, TimingSummary, summarize};
pub use withheld::{Withheld, flight_table};
