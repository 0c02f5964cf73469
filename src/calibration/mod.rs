//! The offline calibration that the paper compares against (§5.2), from a flight log alone.
//!
//! Where the paper takes a calibration target and a prebuilt map, this takes the flight itself:
//!
//! 1. *Camera–IMU.* The static camera flies through the sliding-window estimator; a bundle over the whole flight then
//!    adjusts its trajectory, its pose on the IMU and its time offset to all its tracks and the inertial samples.
//! 2. *Pose loops.* The gimbal camera's poses are reconstructed from its own images, stretch by stretch, and paired with the
//!    static camera's: static pose, then the chain, must lead to the gimbal pose. Unknown are the chain with the rig's
//!    prior, every joint angle with its encoder's, and where each stretch lies on the map.
//! 3. *Pixels.* One bundle of both cameras: every sighting, the inertial samples, encoders and priors, all unknowns at once.
//!
//! The chain is written in the minimal form whose chart suits it, so that every column can be told.

mod arrow;
mod bundle;
mod calibrate;
mod chain_prior;
mod error;
mod frame_sets;
mod input;
mod landmark;
mod observations;
mod options;
mod outcome;
mod pose_loop;
mod rounds;
mod segments;
mod solver;
mod state;
mod statistics;
#[cfg(test)]
mod tests;
mod trajectory;
mod visual;

pub use calibrate::{CalibrationProgress, calibrate};
pub use error::CalibrationError;
pub use input::{CalibrationInput, GimbalCamera, StaticCamera, TrackedView};
pub use options::CalibrationOptions;
pub use outcome::{
    CalibratedParameter, CalibrationOutcome, ExtrinsicsReport, ImuResidualReport, PixelReport, PoseLoopReport,
    chain_distance, transform_distance,
};
pub use statistics::Statistics;
