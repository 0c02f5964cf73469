//! Computation of runs on threads, and recomputation of their steps.
//!
//! [`Engine`] runs a tracker thread per camera and an estimator thread per run and reports over a channel;
//! [`Computation`] is the one place where those messages enter the record. A
//! [`RunEngine`](run_engine::RunEngine) is one estimator as a plain value, a [`History`] its snapshots and step inputs,
//! and the [`RecomputeThread`] answers requests of playback from them.

mod altered_measurements;
mod calibrate;
mod computation;
mod compute;
mod configuration;
mod corrections;
mod flight_noise;
mod fork;
mod frame_camera;
mod frame_sets;
mod history;
mod image_rotations;
mod partner_images;
mod passes;
mod planned_flight;
mod recompute;
mod run_engine;
mod shifted_imu;
mod step_inputs;
mod stereo_pairs;
mod stopwatch;
mod stored_input;
mod synthetic_run;
mod threads;
mod tracker;

pub use self::calibrate::CalibrationErrors;
pub(in crate::session) use self::computation::EngineMessage;
pub use calibrate::{CalibrationRequest, CalibrationRun, CalibrationRunError, calibrate};
pub use computation::Computation;
pub use compute::{BreakpointHit, compute, compute_until};
#[cfg(test)]
pub(in crate::session) use configuration::estimator_config;
pub use flight_noise::{FlightNoiseError, fit_flight_noise};
pub(in crate::session) use fork::apply_fork;
pub(in crate::session) use history::History;
pub use history::SnapshotUse;
pub(in crate::session) use image_rotations::rotation_between;
pub use image_rotations::{camera_rotations, check_log, image_rotations};
#[cfg(test)]
pub(in crate::session) use passes::EarlierPasses;
pub(in crate::session) use passes::guarded;
pub use planned_flight::situation_before_flight;
pub(in crate::session) use recompute::{Detail, RecomputeRequest, RecomputeThread, Recomputed, STEPS_AT_ONCE};
pub(in crate::session) use run_engine::RunEngine;
pub(in crate::session) use step_inputs::{InputImage, OwnedStepInput};
pub use stopwatch::Stopwatch;
pub use synthetic_run::record_synthetic;
#[cfg(test)]
pub(in crate::session) use synthetic_run::{input_of, recorded_by};
pub(in crate::session) use threads::Engine;
