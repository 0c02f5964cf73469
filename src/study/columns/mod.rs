//! Columns of the tables of a study: name, unit, meaning and value of each in one place.
//!
//! CSV and Parquet files, summary tables, the study view, comparisons, baselines and reports take columns from here.
//! A new column of the table of runs is one entry of [`JobResult::columns`] in `runs.rs`, and its row in `docs/formats.md`,
//! which a test compares with the tables.

mod job_result;
mod runs;
mod tables;

pub use self::job_result::{JobCosts, JobResult, JobStatus, RunResult};
pub(super) use self::runs::run_column;
pub use self::tables::{StudyTables, frames_table, parameters_table, runs_table};

/// Columns by which runs of two studies are paired.
pub const PAIRING_COLUMNS: [&str; 5] = ["log", "disturbance", "perturbation", "seed", "run"];
