//! The least-squares problem of a window: its factors, solver, marginalization and linearization.
//!
//! Nothing here decides which frames and features are in the window.

pub(crate) mod hypothetical;
pub(crate) mod information_gain;
pub(crate) mod linearization;
pub(crate) mod marginalization;
pub(crate) mod motion_parts;
#[expect(clippy::module_inception, reason = "the type that the folder is about")]
pub(crate) mod problem;
pub(crate) mod solver;
