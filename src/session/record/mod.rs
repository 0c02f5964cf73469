//! Stored reports: what every step of every run left, and what follows from it without running anything again.

mod comparison;
mod recording;
mod run_accuracy;
mod solver_trace;
mod summary;
mod warnings;

pub use comparison::{Comparison, Parting, Quantity};
pub use recording::{ForkOrigin, Recording, RunMemory, RunRecord, StepRecord};
pub use run_accuracy::{ChainDistance, RELATIVE_LENGTHS_M, RelativeAccuracy, TrajectoryAccuracy};
pub use solver_trace::{SolverPosition, SolverTrace};
pub use warnings::RunWarning;
#[cfg(test)]
pub(in crate::session) use warnings::warnings_of;
