//! The definition of a session: the log with its rig, its runs, and the changes of a fork. Plain data.

mod error;
mod flight_prior;
mod fork_changes;
mod fork_text;
mod run_options;
mod run_spec;
mod session_plan;
mod trajectories;
mod trajectory_spec;

pub use error::SessionError;
pub use flight_prior::{FlightPrior, FlightSigmas};
pub use fork_changes::{FORK_PARAMETERIZATIONS, ForkChanges, ForkError};
pub use run_spec::{EstimatorTuning, MAX_RUNS, ParameterizationChoice, RunSpec, RunSpecError};
pub(in crate::session) use run_spec::{distinct_label, distinct_labels};
pub use session_plan::{DEFAULT_MEMORY_BUDGET_BYTES, SessionPlan, SessionRequest};
pub(in crate::session) use session_plan::{cameras_of_run, chain_parameters, check_start, name_usable_cameras};
pub use trajectories::{LoadedPositions, LoadedTrajectory};
pub use trajectory_spec::{MAX_TRAJECTORIES, TrajectorySource, TrajectorySpec, TrajectorySpecError};
