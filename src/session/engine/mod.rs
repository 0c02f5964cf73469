//! Runs on threads, and the recomputation of their steps.

mod calibrate;
mod configuration;
mod history;
mod image_rotations;
mod recompute;
mod run_engine;
mod step_inputs;
mod stopwatch;
mod synchronized_frames;
mod threads;
mod tracker;

pub use calibrate::{CalibrationRequest, CalibrationRun, CalibrationRunError, calibrate};
#[cfg(test)]
pub(in crate::session) use configuration::estimator_config;
pub use history::{History, SnapshotFigures};
pub use image_rotations::image_rotations;
pub(in crate::session) use recompute::{Detail, Retaken, Retaking, STEPS_AT_ONCE, Wish};
pub(in crate::session) use run_engine::RunEngine;
#[cfg(test)]
pub(in crate::session) use step_inputs::Material;
pub(in crate::session) use step_inputs::tracks_bytes;
pub use stopwatch::Stopwatch;
#[cfg(test)]
pub(in crate::session) use synchronized_frames::Instant;
pub(in crate::session) use threads::Engine;
pub use threads::EngineMessage;
#[cfg(test)]
pub(in crate::session) use tracker::TrackedSensorFrame;
