//! The estimator and what it needs: geometry, cameras, gimbals, sensors, front end, estimator, calibration,
//! observability and synthetic tracks, without logs, files and screens.
//!
//! Part of [`dcvins`](../dcvins/index.html), which re-exports it; the table of the folders is there.

pub mod calibration;
pub mod camera;
pub mod estimator;
pub mod faults;
pub mod frontend;
pub mod geometry;
pub mod gimbal;
pub mod observability;
pub mod optimization;
pub mod sensors;
pub mod simulation;
pub mod table;
pub mod text;
