mod accuracy;
mod covariance;
mod forks;
pub(crate) mod memory;
mod passes;
mod plan;
mod rig_values;
mod warnings;
