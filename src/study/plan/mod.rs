//! The plan of a study, parsed from TOML: it defines the runs and the tables of their statistics.

mod document;
mod read;
mod study_plan;
mod summary_table;
mod tables;

pub use document::PlanError;
pub use study_plan::{
    DisturbanceSet, Exclusion, JobLimits, LOG_PLACE, LogSource, SlurmOptions, StudyOutput, StudyPlan,
};
pub use summary_table::{ReferenceValue, Statistic, SummaryColumn, SummaryTable};
