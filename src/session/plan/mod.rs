//! The definition of a session: the log with its rig, its runs, and the changes of a fork. Plain data.

mod fork_changes;
mod fork_text;
mod run_spec;
mod session_plan;

pub use fork_changes::{FORK_PARAMETERIZATIONS, ForkChanges, ForkError};
pub(in crate::session) use run_spec::distinct_labels;
pub use run_spec::{ParameterizationChoice, RunSpec, RunSpecError};
pub use session_plan::{DEFAULT_MEMORY_BUDGET_BYTES, MAX_RUNS, SessionError, SessionPlan, SessionRequest};
pub(in crate::session) use session_plan::{RunCameras, cameras_of_run, check_start};
