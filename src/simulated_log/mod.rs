//! Synthetic flights written as flight logs: rendered images, disturbances, planted faults.
//!
//! [`simulation`](crate::simulation) has the motion and the measurements without images.

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
