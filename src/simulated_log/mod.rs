//! Synthetic flights written as flight logs: rendered images, disturbances, planted faults.
//!
//! The motion and the measurements without images are those of [`simulation`](crate::simulation).

mod disturbances;
mod error;
mod options;
mod planting;
mod prescribed;
mod render;
mod rig_of_file;
mod simulate;
#[cfg(test)]
mod tests;
pub(crate) mod world;

pub use disturbances::Disturbances;
pub use error::SimulationError;
pub use options::{SimulationOptions, SimulationProgress, SimulationSummary};
pub use simulate::{simulate, simulate_interruptible};
