//! The plan of a study, parsed from TOML: it defines the runs.

mod document;
mod read;
mod study_plan;
mod tables;

pub use document::PlanError;
pub use study_plan::{
    DisturbanceSet, Exclusion, JobLimits, LOG_PLACE, LogSource, SlurmOptions, StudyOutput, StudyPlan,
};
