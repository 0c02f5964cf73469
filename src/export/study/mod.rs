//! Files of studies: plans, logs, simulated flights, jobs and tables.

mod error;
mod execute;
mod flights;
mod folder;
mod inputs;
mod parquet_table;
#[cfg(test)]
mod tests;

pub use error::StudyFileError;
pub use execute::JobError;
pub use flights::{FlightError, RenderedFlight};
pub use folder::StudyFolder;
pub use inputs::{find_logs, program_identity, read_plan};
pub use parquet_table::{read_parquet, write_parquet, write_text};
