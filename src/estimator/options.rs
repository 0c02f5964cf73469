//! What can be tuned in the estimator, with its defaults.

use nalgebra::Vector3;

use crate::estimator::state::navigation::ImuBias;
use crate::optimization::{LandmarkModel, RobustLoss};

/// What becomes of a feature whose anchor leaves the window while it is still being tracked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TrackContinuation {
    /// Its measurements go into the marginalization prior and stay in the window as well, as in VINS-Fusion: they count
    /// twice, which stiffens the window and asks for a pixel sigma that is too large.
    Reuse,
    /// Every measurement is used once, as in Basalt: those that went into the prior leave the window, and the feature begins
    /// anew with the images to come.
    UseOnce,
    /// The anchor's measurement is dropped and the others stay.
    DropAnchor,
}

/// Tunables of the estimator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EstimatorOptions {
    /// Number of keyframes in the window beside the newest frame.
    pub window: usize,
    /// The first window grows to this many times `window` before anything is marginalized.
    pub first_window_factor: usize,
    /// Standard deviation of a well tracked pixel, per coordinate. Tracks differ: most are better than this, some are off by
    /// a pixel, and what those count for is up to `loss`.
    pub pixel_sigma_px: f64,
    /// Loss on the visual residuals.
    pub loss: RobustLoss,
    /// Unknowns of a feature.
    pub landmark_model: LandmarkModel,
    /// What happens to tracks whose anchor leaves.
    pub track_continuation: TrackContinuation,
    /// Most iterations of a solve.
    pub iterations: usize,
    /// A solve ends when the cost falls by less than this share.
    pub relative_cost_tolerance: f64,
    /// A feature takes part from this many observations on.
    pub min_observations: usize,
    /// Rays of a feature must open this far before it is triangulated, in radians.
    pub min_triangulation_angle_rad: f64,
    /// Nearest and farthest distance at which a triangulated feature is believed, in metres.
    pub distance_range_m: (f64, f64),
    /// Rotation-compensated mean parallax against the last keyframe that makes a keyframe, in radians.
    pub keyframe_parallax_rad: f64,
    /// Fewer features in common with the last keyframe than this make a keyframe.
    pub keyframe_min_tracked: usize,
    /// A larger share of features new since the last keyframe makes a keyframe.
    pub keyframe_new_ratio: f64,
    /// Features whose mean reprojection error exceeds this are rejected, in pixels.
    pub outlier_px: f64,
    /// Jacobians of states that the prior holds are evaluated where it was linearized, as long as attitude and joint
    /// angles are no farther from there, in radians; 0 evaluates all at the present estimate.
    ///
    /// First estimates keep what the window cannot see from being learned by mistake. A poor one, as after a start with a
    /// chain that is degrees off, pulls the solution to a wrong place instead: a hundredth of a radian makes a derivative
    /// wrong by a percent.
    pub first_estimate_reach_rad: f64,
    /// Jacobians of the static calibration's columns are evaluated where the prior was linearized, however far.
    pub calibration_first_estimates: bool,
    /// Standard deviation of the accelerometer's bias at the start, in m/s².
    pub accelerometer_bias_sigma: f64,
    /// Standard deviation of the gyroscope's bias at the start, in rad/s.
    pub gyroscope_bias_sigma: f64,
    /// The IMU noise densities of the rig are multiplied by this.
    pub imu_noise_factor: f64,
    /// Change of the biases at which an interval is integrated again.
    pub reintegration_change: ImuBias,
    /// Failure: norm of the accelerometer's bias, in m/s².
    pub max_accelerometer_bias: f64,
    /// Failure: norm of the gyroscope's bias, in rad/s.
    pub max_gyroscope_bias: f64,
    /// Failure: norm of the velocity, in m/s.
    pub max_velocity_m_per_s: f64,
    /// Failure: correction of the newest position against its prediction, in metres.
    pub max_position_correction_m: f64,
    /// Failure: fewer than `min_landmarks` landmarks in view for so long, in seconds. Until then the IMU carries
    /// the window on, which costs less than to restart.
    pub max_blind_s: f64,
    /// Fewer landmarks in view than this count as blind.
    pub min_landmarks: usize,
    /// Fill [`super::StepReport::linearization`].
    pub keep_linearization: bool,
    /// Keep the rows of the factors that are not of features in every report, too: [`super::StepReport::factor_rows`].
    pub keep_factor_rows: bool,
}

impl Default for EstimatorOptions {
    fn default() -> Self {
        Self {
            window: 10,
            first_window_factor: 2,
            pixel_sigma_px: 0.25,
            loss: RobustLoss::Cauchy(1.0),
            landmark_model: LandmarkModel::BearingAndInverseDistance,
            track_continuation: TrackContinuation::UseOnce,
            iterations: 6,
            relative_cost_tolerance: 1e-3,
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
