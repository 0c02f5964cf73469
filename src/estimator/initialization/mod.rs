//! Initialization: from a short stretch of tracked features and IMU samples to poses, velocities, gravity, biases and
//! landmarks in metres.
//!
//! [`try_initialize`] is a pure function of its input; call it at frames while waiting, with the frames of the last
//! [`InitializationOptions::longest_window_s`] seconds. It returns a solution, or the reasons for waiting.
//!
//! Steps, in the order of the reported checks:
//!
//! 1. *Stationary vehicle.* IMU samples of little variance and a constant image give gyroscope bias and gravity direction.
//!    An accelerometer's turn-on bias of 0.5 m/s² tilts that direction by 3°, and only motion separates the two.
//!    By default the estimate is kept ([`StationaryEstimate`]) and the initialization waits for motion; with
//!    [`StationaryPolicy::InitializeAtOnce`] it initializes right away, with velocity zero and no landmarks: the estimator
//!    then has to find depths itself once there is parallax, and must give the accelerometer's bias its full prior.
//! 2. *Selection.* A dozen views, spaced by parallax and time, so that a hover before the motion is represented by few of
//!    them: these few bind tilt and accelerometer bias together, which makes the scale of the motion after it reliable.
//! 3. *Structure.* Camera poses from the images alone. Encoders may have errors of many degrees and only give initial values.
//! 4. *Alignment.* Rotation of the extrinsics and gyroscope bias from rotations; scale, gravity of exact magnitude,
//!    velocities and accelerometer bias from a linear system.
//! 5. *Refinement.* All of it together with the IMU covariances, the calibration's error included as unknowns with priors.
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

/// One frame that the initialization may use.
#[derive(Clone, Copy, Debug)]
pub struct InitializationFrame<'a> {
    /// Number of the image in its camera's stream.
    pub frame_index: usize,
    /// Header stamp of the image since the log began.
    pub stamp_ns: i64,
    /// Its features, ordered by id; bearings are unit vectors in the camera.
    pub features: &'a [TrackedFeature],
    /// Extrinsics from calibration and encoders.
    pub imu_from_camera: RigidTransform,
    /// IMU samples from the previous frame's stamp to this one's, both ends included.
    pub imu: &'a [ImuSample],
}

/// Input of an attempt.
#[derive(Clone, Debug)]
pub struct InitializationInput<'a> {
    /// Frames in time order, without gaps in the IMU samples between them.
    pub frames: &'a [InitializationFrame<'a>],
    /// Magnitude of gravity in m/s².
    pub gravity_m_per_s2: f64,
    /// Noise of the IMU.
    pub imu_noise: ImuNoise,
    /// Last estimate of a stationary vehicle, if there was one ([`InitializationOutcome::Waiting`] has it).
    pub stationary: Option<StationaryEstimate>,
    /// Biases that an earlier pass over the log has found.
    pub bias: Option<BiasPrior>,
}

/// Result of an attempt.
#[derive(Clone, Debug, PartialEq)]
pub enum InitializationOutcome {
    /// There is a solution.
    Initialized(Box<InitializationSolution>),
    /// The initialization waits.
    Waiting {
        /// Failed checks, in order; checks after the first failing group were not made.
        reasons: Vec<WaitReason>,
        /// Passed checks with their values.
        passed: Vec<WaitReason>,
        /// Estimate of a stationary vehicle, to be passed to later attempts.
        stationary: Option<StationaryEstimate>,
    },
}

/// Origin of the initial state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InitializationOrigin {
    /// From motion: scale and all states are estimated.
    FromMotion,
    /// From a stationary vehicle: no landmark has a depth.
    FromStationary,
}

/// State of one view of the solution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InitializedFrame {
    /// Number of the image in its camera's stream.
    pub frame_index: usize,
    /// Stamp of the image since the log started.
    pub stamp_ns: i64,
    /// Pose.
    pub world_from_imu: RigidTransform,
    /// Velocity in the world.
    pub velocity_m_per_s: Vector3<f64>,
    /// Refined extrinsics: with poor encoders their rotation is much more accurate than the given one.
    pub imu_from_camera: RigidTransform,
}

/// A feature with a depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InitializedLandmark {
    /// Identity of the feature.
    pub id: FeatureId,
    /// `frame_index` of the first observing view.
    pub anchor_frame_index: usize,
    /// Position in the world, in metres.
    pub position_m: Vector3<f64>,
    /// Inverse depth along the anchor's optical axis, in 1/m.
    pub inverse_depth_per_m: f64,
    /// Number of observing views of the solution.
    pub views: usize,
}

/// Accuracy of the solution.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct InitializationDiagnostics {
    /// Relative standard deviation of the metric scale.
    pub scale_sigma: f64,
    /// Standard deviation of the newest velocity (worst axis).
    pub velocity_sigma_m_per_s: f64,
    /// Standard deviation of gravity's direction.
    pub gravity_sigma_rad: f64,
    /// Standard deviation of the gyroscope's bias (worst axis).
    pub gyroscope_bias_sigma_rad_per_s: f64,
    /// Standard deviation of the accelerometer's bias (worst axis).
    pub accelerometer_bias_sigma_m_per_s2: f64,
    /// Root mean square angle error of a bearing's coordinate.
    pub reprojection_rms_rad: f64,
    /// Mean square of the whitened IMU residuals (1 when the noise is as stated, less with few intervals).
    pub imu_mean_square: f64,
    /// Largest rotation-compensated parallax between two views.
    pub parallax_rad: f64,
    /// Rounds of the refinement.
    pub refinement_rounds: usize,
}

/// A solution.
#[derive(Clone, Debug, PartialEq)]
pub struct InitializationSolution {
    /// From motion or from a stationary vehicle.
    pub origin: InitializationOrigin,
    /// The views, in time order; a subset of the frames given, the newest among them.
    pub frames: Vec<InitializedFrame>,
    /// Biases over the window.
    pub bias: ImuBias,
    /// Landmarks by ascending id; empty for a stationary vehicle.
    pub landmarks: Vec<InitializedLandmark>,
    /// Accuracy of the solution.
    pub diagnostics: InitializationDiagnostics,
    /// The tests that it passed.
    pub passed: Vec<WaitReason>,
}
