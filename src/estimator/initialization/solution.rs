//! Result of an initialization attempt.

use nalgebra::Vector3;

use super::checks::WaitReason;
use super::input::StationaryEstimate;
use crate::estimator::state::navigation::ImuBias;
use crate::frontend::FeatureId;
use crate::geometry::RigidTransform;

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

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InitializationOrigin {
    /// Motion: scale and all states are estimated.
    Motion,
    /// Stationary vehicle: no landmark has a depth.
    Stationary,
    /// Stereo pair, with or without motion: the window has the landmarks.
    Stereo,
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
    /// In the world frame.
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
