//! Offline calibration as baseline of the paper's comparison (§5.2), from a flight log alone.
//!
//! The paper uses a calibration target and a prebuilt map; this calibration uses the flight itself:
//!
//! 1. *Camera–IMU.* The sliding-window estimator processes the static camera. A bundle adjustment over the
//!    whole flight then refines trajectory, extrinsics and time offset from all tracks and the IMU samples.
//! 2. *Pose loops.* The gimbal camera's poses are reconstructed from its own images, segment by segment, and
//!    paired with the static camera's: static pose and chain must give the gimbal camera's pose. The unknowns are the
//!    chain with the rig's prior, every joint angle with its encoder reading, and the frame of each segment.
//! 3. *Pixels.* One bundle adjustment of both cameras: all observations, IMU samples, encoder readings and
//!    priors, all unknowns jointly.
//!
//! From still images of known points, without IMU: [`stills`]. Over many flights: [`history`].
//!
//! The chain uses its best minimal parameterization, in which every column is observable under sufficient excitation.

mod arrow;
mod border_prior;
mod bundle;
mod calibrate;
mod error;
mod frame_sets;
pub mod history;
mod imu_noise;
mod input;
mod observations;
mod outcome;
mod pairs;
mod pose_loop;
mod rounds;
mod segments;
mod solver;
mod state;
pub mod stills;
#[cfg(test)]
mod tests;
mod trajectory;
mod visual;

pub use calibrate::{CalibrationProgress, calibrate, calibrate_along};
pub use error::CalibrationError;
pub use imu_noise::{FittedDensity, FlightNoise, ImuNoiseError, NoiseDensity, fit_imu_noise};
pub use input::{CalibrationInput, CalibrationOptions, EarlierFlights, GimbalCamera, StaticCamera, TrackedView};
pub use outcome::{
    CalibratedParameter, CalibrationOutcome, ChainDistance, ExtrinsicsReport, ImuResidualReport, PixelReport,
    PoseLoopReport, Statistics, transform_distance,
};
pub use trajectory::{BatchPose, InitialTrajectory};
