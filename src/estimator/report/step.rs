//! Report of one step: window, calibration, features, residuals, times.

use nalgebra::Vector3;

use super::features::{FeatureCounts, LandmarkReport};
use super::pose_covariance::PoseCovariance;
use super::{Event, FactorRows, FeatureReport, JacobianSource, ResidualSummary};
use crate::estimator::problem::information_gain::InformationGain;
use crate::estimator::problem::linearization::Linearization;
use crate::estimator::problem::solver::IterationReport;
use crate::geometry::RigidTransform;
use crate::gimbal::{ClassicalChain, ParameterId, Parameterization, Singularity};

/// Phase of the estimator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Waiting for enough motion, or for a stationary vehicle.
    Initializing,
    /// Estimating.
    Tracking,
}

impl Phase {
    /// Name in panels and tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Initializing => "initializing",
            Self::Tracking => "tracking",
        }
    }
}

/// One frame of the window.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameStateReport {
    /// Number of the image in its camera's stream.
    pub frame_index: usize,
    /// Stamp of the image since the log started.
    pub stamp_ns: i64,
    /// Estimated pose of the vehicle.
    pub world_from_imu: RigidTransform,
    /// Velocity in the world.
    pub velocity_m_per_s: Vector3<f64>,
    /// Accelerometer bias in the IMU frame.
    pub accelerometer_bias_m_per_s2: Vector3<f64>,
    /// Gyroscope bias in the IMU frame.
    pub gyroscope_bias_rad_per_s: Vector3<f64>,
    /// Estimated joint angles (without the static offsets), empty for a rigid camera.
    pub joint_angles_rad: Vec<f64>,
    /// Encoder angles at the stamp, `None` without encoders.
    pub encoder_angles_rad: Option<Vec<f64>>,
    /// Their standard deviations, from the noise of the readings and the number of averaged readings.
    pub encoder_sigmas_rad: Option<Vec<f64>>,
    /// Camera pose in the IMU frame at the estimated joint angles.
    pub imu_from_camera: RigidTransform,
    /// Whether it is a keyframe.
    pub keyframe: bool,
}

/// The static calibration after the step.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibrationEstimate {
    /// The parameterization of the chain in use.
    pub parameterization: Parameterization,
    /// The parameters in column order: those of the chain, then those of the rigid cameras beside the main one.
    pub parameters: Vec<ParameterId>,
    /// Value of each in its SI unit (rotation blocks as rotation vectors relative to the rig's value, plus that value's
    /// own log).
    pub values: Vec<f64>,
    /// Posterior standard deviation of each (NaN before the first solve).
    pub sigmas: Vec<f64>,
    /// Standard deviation of each by the rig, before any measurement.
    pub prior_sigmas: Vec<f64>,
    /// The whole chain in the classical form.
    pub classical: ClassicalChain,
    /// Margins to the parameterization's singularities: base, end, then |sin alpha| of each middle link.
    pub margins: Vec<(Singularity, f64)>,
    /// Further rigid cameras with their extrinsics; their columns follow the chain's.
    pub rigid_cameras: Vec<(String, RigidTransform)>,
}

/// Milliseconds spent in each stage of the step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageTimes {
    /// Tracking and detecting (images are read and decoded ahead, on a thread of their own).
    pub frontend_ms: f64,
    /// Preintegrating, predicting and solving; the initialization while there is no window.
    pub optimize_ms: f64,
    /// The window linearized at its final estimate, for the observability analysis.
    pub linearize_ms: f64,
    /// Building the report.
    pub report_ms: f64,
    /// Rejecting outliers, switching the parameterization, marginalizing.
    pub marginalize_ms: f64,
    /// Observability analysis.
    pub observability_ms: f64,
    /// The whole step.
    pub step_ms: f64,
}

/// Result of one step of the estimator.
#[derive(Clone, Debug, PartialEq)]
pub struct StepReport {
    /// Number of the image in its camera's stream.
    pub frame_index: usize,
    /// Stamp of the image since the log started.
    pub stamp_ns: i64,
    /// Phase of the estimator.
    pub phase: Phase,
    /// Number of restarts so far.
    pub restarts: usize,
    /// Assumed standard deviation of a well tracked pixel, per coordinate.
    pub pixel_sigma_px: f64,
    /// Standard deviation of a pixel with the same average information, robust weights of this step included.
    pub effective_pixel_sigma_px: f64,
    /// Events of the step.
    pub events: Vec<Event>,
    /// The frames of the window after the solve, oldest first; empty while initializing.
    pub window: Vec<FrameStateReport>,
    /// Covariance of the newest pose, `None` while initializing.
    pub newest_pose_covariance: Option<PoseCovariance>,
    /// The static calibration (the given one while initializing).
    pub calibration: CalibrationEstimate,
    /// Features of the solve.
    pub features: Vec<FeatureReport>,
    /// Numbers of features.
    pub counts: FeatureCounts,
    /// Points of the map in the world.
    pub landmarks: Vec<LandmarkReport>,
    /// χ² by kind of factor.
    pub residuals: Vec<ResidualSummary>,
    /// Root mean square of the reprojection residuals before the solve, in pixels.
    pub reprojection_rms_before_px: f64,
    /// The same after the solve.
    pub reprojection_rms_after_px: f64,
    /// Median length of the residuals after the solve, robust against outliers; NaN without residuals.
    pub reprojection_median_after_px: f64,
    /// The solver's iterations.
    pub iterations: Vec<IterationReport>,
    /// The linearization, when it was requested and the estimator is tracking.
    pub linearization: Option<Linearization>,
    /// Source of the Jacobian's blocks ([`StepReport::jacobian`]), when the linearization was requested and the
    /// estimator is tracking.
    pub jacobian_source: Option<JacobianSource>,
    /// Rows of the factors without a feature, when they were requested and the estimator is tracking.
    pub factor_rows: Option<Vec<FactorRows>>,
    /// Information gain of the newest image about the calibration, when the linearization was requested and the
    /// estimator is tracking; zero for an image that is no keyframe, since it is dropped.
    pub gain: Option<InformationGain>,
    /// Whether the frame is a keyframe.
    pub keyframe: bool,
    /// Stage timings (the only part of a report that differs between replays).
    pub times: StageTimes,
    /// Problems that did not stop the step.
    pub warnings: Vec<String>,
}

impl StepReport {
    /// The newest frame of the window, `None` while initializing.
    pub fn newest(&self) -> Option<&FrameStateReport> {
        self.window.last()
    }
}
