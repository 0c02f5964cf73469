//! Options of the estimator with their defaults.

use nalgebra::Vector3;

use crate::estimator::state::navigation::ImuBias;
use crate::optimization::{LandmarkModel, RobustLoss};

/// Rotation of a joint since the last keyframe above which a frame becomes a keyframe where rotations of the chain are
/// given inaccurately, in radians: images that differ by joint angles alone measure the chain, without parallax.
pub const KEYFRAME_JOINT_RAD: f64 = 0.05;

/// Shortest time since the last keyframe for that, in seconds; a moving vehicle makes keyframes more often.
pub const KEYFRAME_JOINT_INTERVAL_S: f64 = 0.2;

/// Shortest time between keyframes by parallax in the first window where rotations of the chain are given inaccurately,
/// in seconds: the window then covers more motion of the joints with fewer frames.
pub(crate) const FIRST_KEYFRAME_INTERVAL_S: f64 = 0.14;

/// Treatment of a tracked feature whose anchor leaves the window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TrackContinuation {
    /// Observations enter the marginalization prior and stay in the window, as in VINS-Fusion: they count
    /// twice, which makes the window overconfident and requires a larger pixel sigma.
    Reuse,
    /// Every observation is used once, as in Basalt: those in the prior leave the window, and the feature restarts
    /// with the next images.
    UseOnce,
    /// The anchor's observation is dropped, the others stay.
    DropAnchor,
}

/// Robust loss of the visual residuals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum VisualLoss {
    /// Cauchy's loss of each observation, and of each track as a whole, with scales that follow the residuals of the
    /// window, for each camera.
    Adaptive,
    /// Loss of each observation.
    Fixed(RobustLoss),
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EstimatorOptions {
    /// Number of keyframes in the window, not counting the newest frame.
    pub window: usize,
    /// Size of the first window before marginalization starts, as a multiple of `window`.
    pub first_window_factor: u16,
    /// First window factor if rotations of the chain are given with a standard deviation above 0.03 rad.
    pub inaccurate_first_window_factor: u16,
    /// Standard deviation of a well tracked pixel, per coordinate. Most tracks are better; some have errors of a
    /// pixel, whose weight `loss` limits.
    pub pixel_sigma_px: f64,
    pub loss: VisualLoss,
    pub landmark_model: LandmarkModel,
    /// Treatment of tracks whose anchor leaves the window.
    pub track_continuation: TrackContinuation,
    /// Largest number of iterations of a solve.
    pub iterations: usize,
    /// Convergence threshold: a step lowers the cost by less than this fraction and changes calibration and newest
    /// joint angles by less than a hundredth of a standard deviation.
    pub relative_cost_tolerance: f64,
    /// Smallest number of observations of a feature in the solve.
    pub min_observations: usize,
    /// Smallest parallax for triangulation, in radians.
    pub min_triangulation_angle_rad: f64,
    /// Smallest and largest distance of a triangulated feature, in metres.
    pub distance_range_m: (f64, f64),
    /// Rotation-compensated mean parallax to the last keyframe above which a frame becomes a keyframe, in radians.
    pub keyframe_parallax_rad: f64,
    /// Number of features in common with the last keyframe below which a frame becomes a keyframe.
    pub keyframe_min_tracked: usize,
    /// Ratio of new features since the last keyframe above which a frame becomes a keyframe.
    pub keyframe_new_ratio: f64,
    /// Mean reprojection error above which a feature is rejected, in pixels.
    pub outlier_px: f64,
    /// Rotation of the vehicle from the linearization point, in radians, within which Jacobians of states in the prior are
    /// evaluated there; beyond it, or with 0, they are evaluated at the current estimate. Joint angles with encoder
    /// readings stay at the linearization point, as the chain does; without readings the same limit applies to them.
    ///
    /// First-estimate Jacobians prevent spurious information along unobservable directions. With inaccurate first
    /// estimates, as after a start with a chain error of degrees, they bias the solution: an error of a hundredth of a
    /// radian changes a derivative by one percent.
    pub first_estimate_reach_rad: f64,
    /// Evaluate Jacobians of the static calibration always at the linearization point of the prior.
    pub calibration_first_estimates: bool,
    /// Initial standard deviation of the accelerometer bias, in m/s².
    pub accelerometer_bias_sigma: f64,
    /// Initial standard deviation of the gyroscope bias, in rad/s.
    pub gyroscope_bias_sigma: f64,
    /// Factor on the rig's IMU noise densities.
    pub imu_noise_factor: f64,
    /// Change of the biases above which an interval is integrated again.
    pub reintegration_change: ImuBias,
    /// Failure above this norm of the accelerometer bias, in m/s².
    pub max_accelerometer_bias: f64,
    /// Failure above this norm of the gyroscope bias, in rad/s.
    pub max_gyroscope_bias: f64,
    /// Failure above this norm of the velocity, in m/s.
    pub max_velocity_m_per_s: f64,
    /// Failure above this correction of the newest position relative to its prediction, in metres.
    pub max_position_correction_m: f64,
    /// Failure after this time with fewer than `min_landmarks` observed landmarks, in seconds. Until then IMU-only
    /// propagation continues the window, which is better than a restart.
    pub max_blind_s: f64,
    /// Number of observed landmarks below which the window counts as without visual measurements.
    pub min_landmarks: usize,
    /// Store the linearization of every step in [`crate::estimator::StepReport::linearization`].
    pub keep_linearization: bool,
    /// Keep the rows of factors without a feature in every report: [`crate::estimator::StepReport::factor_rows`].
    pub keep_factor_rows: bool,
}

impl Default for EstimatorOptions {
    fn default() -> Self {
        Self {
            window: 10,
            first_window_factor: 2,
            inaccurate_first_window_factor: 3,
            pixel_sigma_px: 0.25,
            loss: VisualLoss::Adaptive,
            landmark_model: LandmarkModel::BearingAndInverseDistance,
            track_continuation: TrackContinuation::UseOnce,
            iterations: 6,
            relative_cost_tolerance: 1e-2,
            min_observations: 3,
            min_triangulation_angle_rad: 0.01,
            distance_range_m: (0.1, 300.0),
            keyframe_parallax_rad: 10.0 / 460.0,
            keyframe_min_tracked: 50,
            keyframe_new_ratio: 0.5,
            outlier_px: 3.0,
            first_estimate_reach_rad: 0.01,
            calibration_first_estimates: true,
            accelerometer_bias_sigma: 0.5,
            gyroscope_bias_sigma: 0.02,
            imu_noise_factor: 1.0,
            reintegration_change: ImuBias {
                gyroscope_rad_per_s: Vector3::repeat(0.005),
                accelerometer_m_per_s2: Vector3::repeat(0.05),
            },
            max_accelerometer_bias: 3.0,
            max_gyroscope_bias: 0.5,
            max_velocity_m_per_s: 50.0,
            max_position_correction_m: 5.0,
            max_blind_s: 5.0,
            min_landmarks: 6,
            keep_linearization: false,
            keep_factor_rows: false,
        }
    }
}
