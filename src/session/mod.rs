//! A log, the runs over it, and the reports they left.
//!
//! A [`Recording`] is what has been computed so far; the window and the exports draw it at a cursor.

pub mod accuracy;
mod command;
mod recording;
mod spec;
mod stopwatch;
#[cfg(test)]
mod tests;

pub use command::{Command, PlaybackSpeed};
pub use recording::{Recording, RunRecord, StepRecord};
pub use spec::{ParameterizationChoice, RunSpec, RunSpecError, distinct_labels};
pub use stopwatch::Stopwatch;
