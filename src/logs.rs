//! Flight logs, their checks, simulated flights as logs, and sessions over logs: everything without a window or a
//! terminal.
//!
//! Part of [`dcvins`](../dcvins/index.html), which re-exports it; the table of the folders is there.

pub mod files;
pub mod flight_log;
pub mod log_check;
pub mod session;
pub mod simulated_log;
pub mod study;

pub use dcvins_estimation::{
    calibration, camera, estimator, faults, frontend, geometry, gimbal, observability, optimization, sensors,
    simulation, table, text,
};
