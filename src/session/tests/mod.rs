mod accuracy;
mod covariance;
mod diagnosis;
mod forks;
pub(crate) mod memory;
mod passes;
mod plan;
mod rig_values;
mod warnings;
