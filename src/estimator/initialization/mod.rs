//! Initialization: poses, velocities, gravity, biases and landmarks in metres from a few seconds of tracked features
//! and
//! IMU samples.
//!
//! [`try_initialize`] is a pure function of its input. It is called at each frame until it succeeds, with the frames of
//! the
//! last [`InitializationOptions::longest_window_s`] seconds, and returns a solution or the reasons for waiting.
//!
//! Steps, in the order of the reported checks:
//!
//! 1. *Stationary vehicle.* IMU samples of little variance and a constant image give gyroscope bias and gravity
//! direction.
//!    An accelerometer turn-on bias of 0.5 m/s² tilts that direction by 3°, and only motion separates the two.
//!    By default the estimate is kept ([`StationaryEstimate`]) and the initialization waits for motion. With
//!    [`StationaryPolicy::InitializeAtOnce`] it initializes immediately, with velocity zero and no landmarks: the
//! estimator
//!    then has to find depths once there is parallax, and must give the accelerometer bias its full prior.
//! 2. *Selection.* A dozen views, spaced by parallax and time, so that a hover before the motion is represented by few
//! of
//!    them: these few constrain tilt and accelerometer bias jointly, which makes the scale of the later motion
//! reliable.
//! 3. *Structure.* Camera poses from the images alone. Encoders may have errors of many degrees and only give initial
//! values.
//! 4. *Alignment.* Rotation of the extrinsics and gyroscope bias from rotations; scale, gravity of exact magnitude,
//!    velocities and accelerometer bias from a linear system.
//! 5. *Refinement.* All of these together with the IMU covariances; calibration errors are unknowns with priors.
//! 6. *Acceptance.* Residuals, and the standard deviations of scale, velocity and gravity from the refined problem.
//!    Constant velocity, hover and pure rotation fail here: their standard deviation of the scale is large.
//!
//! The world has z up, its origin at the IMU of the first view, and no yaw there.

mod alignment;
pub mod bearing;
mod checks;
mod essential;
mod extrinsics_fit;
mod first_window;
pub(crate) mod initializer;
mod options;
mod polynomial;
mod reconstruction;
mod refinement;
pub mod relative_pose;
mod selection;
mod stationary;
mod structure;
mod visual_problem;
mod waiting_frame;

mod attempt;
#[cfg(test)]
mod tests;

pub use alignment::VectorPrior;
pub use attempt::try_initialize;
pub use checks::WaitReason;
pub use options::{InitializationOptions, StationaryPolicy};
pub use reconstruction::{Reconstruction, ReconstructionGuess, reconstruct_views};
pub use stationary::StationaryEstimate;

use nalgebra::Vector3;

use crate::estimator::{BiasPrior, ImuBias};
use crate::frontend::{FeatureId, TrackedFeature};
use crate::geometry::RigidTransform;
use crate::sensors::{ImuNoise, ImuSample};

#[derive(Clone, Copy, Debug)]
pub struct InitializationFrame<'a> {
    /// Index of the image in its camera's stream.
    pub frame_index: usize,
    /// Header stamp of the image since the start of the log.
    pub stamp_ns: i64,
    /// Features ordered by id; bearings are unit vectors in the camera.
    pub features: &'a [TrackedFeature],
    /// Extrinsics from calibration and encoders.
    pub imu_from_camera: RigidTransform,
    /// IMU samples from the previous frame's stamp to this one's, both ends included.
    pub imu: &'a [ImuSample],
}

#[derive(Clone, Debug)]
pub struct InitializationInput<'a> {
    /// Frames in time order, without gaps in the IMU samples between them.
    pub frames: &'a [InitializationFrame<'a>],
    /// Magnitude of gravity in m/s².
    pub gravity_m_per_s2: f64,
    pub imu_noise: ImuNoise,
    /// Last estimate of a stationary vehicle (from [`InitializationOutcome::Waiting`]), `None` if there was none.
    pub stationary: Option<StationaryEstimate>,
    /// Biases estimated by an earlier pass over the log.
    pub bias: Option<BiasPrior>,
}

#[derive(Clone, Debug, PartialEq)]
pub enum InitializationOutcome {
    Initialized(Box<InitializationSolution>),
    Waiting {
        /// Failed checks, in order; checks after the first failing group were not run.
        reasons: Vec<WaitReason>,
        /// Passed checks with their values.
        passed: Vec<WaitReason>,
        /// Estimate of a stationary vehicle, for later attempts.
        stationary: Option<StationaryEstimate>,
    },
}

/// Origin of the initial state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InitializationOrigin {
    /// Motion: scale and all states are estimated.
    FromMotion,
    /// Stationary vehicle: no landmark has a depth.
    FromStationary,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InitializedFrame {
    /// Index of the image in its camera's stream.
    pub frame_index: usize,
    /// Header stamp of the image since the start of the log.
    pub stamp_ns: i64,
    pub world_from_imu: RigidTransform,
    /// Velocity in the world.
    pub velocity_m_per_s: Vector3<f64>,
    /// Refined extrinsics; with poor encoders their rotation is much more accurate than the given one.
    pub imu_from_camera: RigidTransform,
}

/// Feature with a depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InitializedLandmark {
    pub id: FeatureId,
    /// `frame_index` of the first observing view.
    pub anchor_frame_index: usize,
    /// Position in the world, in metres.
    pub position_m: Vector3<f64>,
    /// Inverse depth along the anchor's optical axis, in 1/m.
    pub inverse_depth_per_m: f64,
    /// Number of views of the solution that observe it.
    pub views: usize,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct InitializationDiagnostics {
    /// Relative standard deviation of the metric scale.
    pub scale_sigma: f64,
    /// Standard deviation of the newest velocity (worst axis).
    pub velocity_sigma_m_per_s: f64,
    /// Standard deviation of gravity's direction.
    pub gravity_sigma_rad: f64,
    /// Standard deviation of the gyroscope bias (worst axis).
    pub gyroscope_bias_sigma_rad_per_s: f64,
    /// Standard deviation of the accelerometer bias (worst axis).
    pub accelerometer_bias_sigma_m_per_s2: f64,
    /// Root mean square angle error of a bearing, per coordinate.
    pub reprojection_rms_rad: f64,
    /// Mean square of the whitened IMU residuals (1 when the noise densities are correct, less with few intervals).
    pub imu_mean_square: f64,
    /// Largest rotation-compensated parallax between two views.
    pub parallax_rad: f64,
    /// Iterations of the refinement.
    pub refinement_rounds: usize,
}

#[derive(Clone, Debug, PartialEq)]
pub struct InitializationSolution {
    pub origin: InitializationOrigin,
    /// Views in time order: a subset of the given frames that includes the newest.
    pub frames: Vec<InitializedFrame>,
    /// Biases, constant over the window.
    pub bias: ImuBias,
    /// Landmarks by ascending id; empty for a stationary vehicle.
    pub landmarks: Vec<InitializedLandmark>,
    pub diagnostics: InitializationDiagnostics,
    /// Passed checks with their values.
    pub passed: Vec<WaitReason>,
}
