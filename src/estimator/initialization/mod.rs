//! Initialization: poses, velocities, gravity, biases and landmarks in metres from a few seconds of tracked features
//! and IMU samples.
//!
//! [`try_initialize`] is a pure function of its input. It is called at each frame until it succeeds, with the frames of
//! the last [`InitializationOptions::longest_window_s`] seconds, and returns a solution or the reasons for waiting.
//!
//! Steps, in the order of the reported checks:
//!
//! 1. *Stationary vehicle.* IMU samples of little variance and a constant image give gyroscope bias and gravity
//!    direction. An accelerometer turn-on bias of 0.5 m/s² tilts that direction by 3°, and only motion separates the
//!    two. By default the estimate is kept ([`StationaryEstimate`]) and the initialization waits for motion. With
//!    [`StationaryPolicy::InitializeAtOnce`] it initializes immediately, with velocity zero and no landmarks: the
//!    estimator then has to find depths once there is parallax, and must give the accelerometer bias its full prior.
//! 2. *Selection.* A dozen views, spaced by parallax and time, so that a hover before the motion is represented by few
//!    of them: these few constrain tilt and accelerometer bias jointly, which makes the scale of the later motion
//!    reliable.
//! 3. *Structure.* Camera poses from the images alone. Encoders may have errors of many degrees and only give initial
//!    values.
//! 4. *Alignment.* Rotation of the extrinsics and gyroscope bias from rotations; scale, gravity of exact magnitude,
//!    velocities and accelerometer bias from a linear system.
//! 5. *Refinement.* All of these together with the IMU covariances; calibration errors are unknowns with priors.
//! 6. *Acceptance.* Residuals, and the standard deviations of scale, velocity and gravity from the refined problem.
//!    Constant velocity, hover and pure rotation fail here: their standard deviation of the scale is large.
//!
//! With a stereo pair, the points that both cameras observe are tried first: they need no motion.
//!
//! The world has z up, its origin at the IMU of the first view, and no yaw there.

mod alignment;
pub mod bearing;
mod checks;
mod essential;
mod input;
mod options;
mod polynomial;
mod reconstruction;
mod refinement;
pub mod relative_pose;
mod selection;
mod solution;
mod stationary;
mod stereo;
mod structure;
mod visual_problem;

mod attempt;
#[cfg(test)]
mod tests;

pub use alignment::VectorPrior;
pub use attempt::try_initialize;
pub use checks::WaitReason;
pub use input::{InitializationFrame, InitializationInput, StationaryEstimate, StereoPair};
pub use options::{InitializationOptions, StationaryPolicy};
pub use reconstruction::{Reconstruction, ReconstructionGuess, reconstruct_views};
pub use solution::{
    InitializationDiagnostics, InitializationOrigin, InitializationOutcome, InitializationSolution, InitializedFrame,
    InitializedLandmark,
};
