//! Studies: the runs that a plan defines, and the tables of their results.
//!
//! Everything here is plain data and computation on it; files are read and written by `sweep/`, processes are
//! started by the command line.
//!
//! - `plan/`: the TOML text of a plan as typed values, every error names line and key; its tables as Markdown.
//! - `recipe`, `perturbation`: simulated flights and errors of a rig.
//! - `job`, `expansion`: a job with its key, and the jobs of a plan.
//! - `baseline`, `comparison`, `pairing`, `statistics`: a study against a baseline, paired and with intervals.
//! - `table`: columns of values with units and descriptions.
//! - `columns/`: the columns of the tables of a study, each with name, unit, meaning and value in one definition.
//! - `view/`: what the study view shows: filters, groups, distributions, differences.

mod columns;
mod comparison;
mod expansion;
mod job;
mod pairing;
mod perturbation;
mod plan;
mod recipe;
mod statistics;
mod table;
#[cfg(test)]
mod tests;
pub mod view;

pub use columns::{
    JobCosts, JobResult, JobStatus, PAIRING_COLUMNS, RunResult, StudyTables, frames_table, parameters_table, runs_table,
};
pub use comparison::{
    ComparisonError, MetricComparison, PairedVerdict, SUCCESS, StudyComparison, WorstPair, baseline_table, compare,
};
pub use expansion::{expand, shard};
pub use job::{Bundle, JobLog, JobSubject, KeyedJob, RecordedLog, SimulatedFlight, StudyJob, StudyTrajectory, hex};
pub use perturbation::{
    Distribution, MagnitudeDimension, PerturbationError, PerturbationStart, RigChange, RigPerturbation, RigQuantity,
};
pub use plan::{
    DisturbanceSet, Exclusion, JobLimits, LOG_PLACE, LogSource, PlanError, ReferenceValue, SlurmOptions, Statistic,
    StudyOutput, StudyPlan, SummaryColumn, SummaryTable,
};
pub use recipe::{EncoderNoise, FlightRecipe};
pub use statistics::MeanInterval;
pub use table::{ColumnValues, StudyColumn, StudyTable, TableError};

pub use crate::table::{Cell, ColumnType, Direction};
