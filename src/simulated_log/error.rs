//! Errors of a simulation.

use thiserror::Error;

use crate::files::FileError;
use crate::flight_log::LogError;
use crate::simulation::experiment::{Experiment, WorldKind};
use crate::text::Named as _;

/// Reason that a simulation ended without its files.
#[derive(Debug, Error)]
pub enum SimulationError {
    /// A disturbance that cannot be read.
    #[error("disturbance '{text}': {expected}")]
    BadDisturbance {
        /// As it was written.
        text: String,
        expected: String,
    },
    /// An option out of its range.
    #[error("{option} is {value}: expected {low} to {high}")]
    BadOption { option: &'static str, value: f64, low: f64, high: f64 },
    /// A world that the experiment's environment does not have.
    #[error(
        "{} has no world '{}': expected textured, {}",
        experiment.name(), world.name(),
        if *world == WorldKind::Plain { "or facades for T3 and T4" } else { "or plain for T1 and T2" }
    )]
    WrongWorld { world: WorldKind, experiment: Experiment },
    /// An image could not be compressed.
    #[error("cannot compress an image as JPEG: {problem}")]
    Image {
        /// Message of the encoder.
        problem: String,
    },
    /// A prescribed motion that the vehicle or its gimbal cannot follow.
    #[error("the motion cannot be flown: {problem}")]
    Motion { problem: String },
    /// A rig that the simulation does not cover.
    #[error("the rig '{rig}' cannot be simulated: {problem}")]
    Rig { rig: String, problem: String },
    /// The caller stopped the conversion.
    #[error("interrupted after {images_done} of {images_total} images; nothing is written")]
    Interrupted {
        /// Number of images written before the interruption.
        images_done: usize,
        /// Images of the whole log.
        images_total: usize,
    },
    /// A file could not be written.
    #[error(transparent)]
    Log(#[from] LogError),
    #[error(transparent)]
    File(#[from] FileError),
}
