//! The runs of a study: reading its plan and logs, simulating its flights, executing its jobs, and the files of their results.

mod error;
mod execute;
mod flights;
mod folder;
mod inputs;
mod parquet_table;
mod study_source;
#[cfg(test)]
mod tests;

pub use error::StudyFileError;
pub use execute::JobError;
pub use flights::{FlightError, RenderedFlight};
pub use folder::StudyFolder;
pub use inputs::{find_logs, program_identity, read_plan};
pub use parquet_table::{read_parquet, write_parquet, write_text};
pub use study_source::{OpenedStudy, StudySourceError, is_study};
