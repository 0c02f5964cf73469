mod accuracy;
mod answer;
mod covariance;
mod diagnosis;
mod flight_prior;
mod forks;
pub(crate) mod memory;
#[path = "../../gimbal/tests/named.rs"]
mod named;
mod passes;
mod plan;
mod rig_values;
mod verdicts;
mod warnings;

pub(in crate::session) use self::named::parameter;
