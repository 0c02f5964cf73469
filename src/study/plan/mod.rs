//! The plan of a study: which runs there are, read from TOML.

mod document;
mod read;
mod study_plan;
mod tables;

pub use document::PlanError;
pub use study_plan::{
    DisturbanceSet, Exclusion, JobLimits, LOG_PLACE, LogSource, SlurmOptions, StudyOutput, StudyPlan,
};
