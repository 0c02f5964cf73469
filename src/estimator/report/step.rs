//! Report of one step: window, calibration, features, residuals, times.

use nalgebra::Vector3;

use super::features::{FeatureCounts, LandmarkReport};
use super::pose_covariance::PoseCovariance;
use super::{Event, FactorRows, FeatureReport, JacobianSource, ResidualSummary, StepWarning};
use crate::estimator::problem::information_gain::InformationGain;
use crate::estimator::problem::linearization::Linearization;
use crate::estimator::problem::solver::IterationReport;
use crate::estimator::state::navigation::GimbalImuState;
use crate::estimator::step_input::OTHER_CAMERA_FRAMES;
use crate::frontend::FeatureId;
use crate::geometry::RigidTransform;
use crate::gimbal::{ClassicalChain, ParameterId, Parameterization, Singularity};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Waiting for enough motion, or for a stationary vehicle.
    Initializing,
    Tracking,
}

impl Phase {
    /// Label in panels and tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Initializing => "initializing",
            Self::Tracking => "tracking",
        }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct FrameStateReport {
    /// Index of the image in its camera's stream.
    pub frame_index: usize,
    /// Header stamp of the image since the start of the log.
    pub stamp_ns: i64,
    /// Estimated pose of the vehicle.
    pub world_from_imu: RigidTransform,
    /// Velocity in the world.
    pub velocity_m_per_s: Vector3<f64>,
    /// Accelerometer bias in the IMU frame.
    pub accelerometer_bias_m_per_s2: Vector3<f64>,
    /// Gyroscope bias in the IMU frame.
    pub gyroscope_bias_rad_per_s: Vector3<f64>,
    /// Estimated joint angles (without the static offsets); empty for a rigid camera.
    pub joint_angles_rad: Vec<f64>,
    /// Velocity and biases of the IMU on the gimbal, `None` without one.
    pub gimbal_imu: Option<GimbalImuState>,
    /// Encoder angles at the stamp, `None` without encoders.
    pub encoder_angles_rad: Option<Vec<f64>>,
    /// Standard deviations of `encoder_angles_rad`, from the noise of a reading and the number of averaged readings.
    pub encoder_sigmas_rad: Option<Vec<f64>>,
    /// Camera pose in the IMU frame at the estimated joint angles.
    pub imu_from_camera: RigidTransform,
    pub keyframe: bool,
}

/// Static calibration after the step.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibrationEstimate {
    /// Current parameterization of the chain.
    pub parameterization: Parameterization,
    /// Parameters in column order: chain of the main camera, then the rigid cameras.
    pub parameters: Vec<ParameterId>,
    /// Values in SI units (rotation blocks as rotation vectors relative to the rig's value, plus the logarithm of that
    /// value).
    pub values: Vec<f64>,
    /// Posterior standard deviations (NaN before the first solve).
    pub sigmas: Vec<f64>,
    /// Factor by which the standard deviations of the measurements were multiplied in `sigmas`; the estimator gives 1, a
    /// session the factor by which the estimates of the run have changed more than their standard deviations allow.
    pub sigma_scale: f64,
    /// Standard deviations of the rig's prior.
    pub prior_sigmas: Vec<f64>,
    /// Complete chain in the classical parameterization.
    pub classical: ClassicalChain,
    /// Singularity margins of the parameterization: base, end, then |sin alpha| of each middle link.
    pub margins: Vec<(Singularity, f64)>,
    /// Cameras besides the main one, in the order of their features; their columns follow the chain's.
    pub further_cameras: Vec<FurtherCameraEstimate>,
}

/// Extrinsics of a camera besides the main one.
#[derive(Clone, Debug, PartialEq)]
pub struct FurtherCameraEstimate {
    /// Key in the rig.
    pub key: String,
    /// Number of its parameters.
    pub number: u8,
    /// Key of the camera that it is mounted on, `None` for a rigid camera whose pose is relative to the IMU.
    pub base: Option<String>,
    /// Pose relative to its base, else to the IMU.
    pub base_from_camera: RigidTransform,
}

impl CalibrationEstimate {
    /// Column of a parameter; `None` if it is not estimated.
    pub fn index_of(&self, parameter: ParameterId) -> Option<usize> {
        self.parameters.iter().position(|known| *known == parameter)
    }

    /// Estimate of a parameter.
    pub fn value_of(&self, parameter: ParameterId) -> Option<f64> {
        self.values.get(self.index_of(parameter)?).copied()
    }

    /// Posterior standard deviation of a parameter.
    pub fn sigma_of(&self, parameter: ParameterId) -> Option<f64> {
        self.sigmas.get(self.index_of(parameter)?).copied()
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageTimes {
    /// Feature tracking and detection (images are read and decoded in advance on another thread).
    pub frontend_ms: f64,
    /// Preintegration, prediction and solve; the initialization while there is no window.
    pub optimize_ms: f64,
    /// Linearization of the window at its final estimate, for the observability analysis.
    pub linearize_ms: f64,
    pub report_ms: f64,
    /// Outlier rejection, switch of the parameterization, marginalization.
    pub marginalize_ms: f64,
    pub observability_ms: f64,
    pub step_ms: f64,
}

/// Stage of a step whose time is measured.
pub struct Stage {
    pub key: &'static str,
    pub meaning: &'static str,
    pub time_ms: fn(&StageTimes) -> f64,
}

impl StageTimes {
    /// Stages in their order, and the whole step.
    pub const STAGES: [Stage; 7] = [
        Stage { key: "frontend", meaning: "feature tracking", time_ms: |times| times.frontend_ms },
        Stage { key: "optimize", meaning: "nonlinear solve", time_ms: |times| times.optimize_ms },
        Stage {
            key: "linearize",
            meaning: "linearization for the observability analysis",
            time_ms: |times| times.linearize_ms,
        },
        Stage { key: "report", meaning: "building the report", time_ms: |times| times.report_ms },
        Stage { key: "marginalize", meaning: "marginalization", time_ms: |times| times.marginalize_ms },
        Stage { key: "observability", meaning: "observability analysis", time_ms: |times| times.observability_ms },
        Stage { key: "step", meaning: "whole step", time_ms: |times| times.step_ms },
    ];
}

/// Result of one step of the estimator.
#[derive(Clone, Debug, PartialEq)]
pub struct StepReport {
    /// Index of the image in its camera's stream.
    pub frame_index: usize,
    /// Header stamp of the image since the start of the log.
    pub stamp_ns: i64,
    pub phase: Phase,
    /// Number of restarts so far.
    pub restarts: usize,
    /// Standard deviation of a well tracked pixel by camera, per coordinate; it follows the residuals. Empty while
    /// initializing.
    pub pixel_sigmas_px: Vec<f64>,
    /// Standard deviation of a pixel with the same average information, robust weights of this step included.
    pub effective_pixel_sigma_px: f64,
    /// Scale of the robust loss by camera, in pixels; with Cauchy's loss an observation with this residual has half
    /// weight. Empty while initializing, infinite without a loss.
    pub loss_scales_px: Vec<f64>,
    pub events: Vec<Event>,
    /// Frames of the window after the solve, oldest first; empty while initializing.
    pub window: Vec<FrameStateReport>,
    /// Covariance of the newest pose, `None` while initializing.
    pub newest_pose_covariance: Option<PoseCovariance>,
    /// Static calibration (the given one while initializing).
    pub calibration: CalibrationEstimate,
    /// Features used in the solve.
    pub features: Vec<FeatureReport>,
    pub counts: FeatureCounts,
    /// Landmark positions in the world.
    pub landmarks: Vec<LandmarkReport>,
    /// χ² by kind of factor.
    pub residuals: Vec<ResidualSummary>,
    /// Root mean square of the reprojection residuals before the solve, in pixels.
    pub reprojection_rms_before_px: f64,
    /// Root mean square of the reprojection residuals after the solve, in pixels.
    pub reprojection_rms_after_px: f64,
    /// Median length of the reprojection residuals after the solve, in pixels; robust against outliers, NaN without
    /// residuals.
    pub reprojection_median_after_px: f64,
    pub iterations: Vec<IterationReport>,
    /// Linearization, if requested and the estimator is tracking.
    pub linearization: Option<Linearization>,
    /// Source of the Jacobian's blocks ([`StepReport::jacobian`]), if the linearization was requested and the estimator
    /// is tracking.
    pub jacobian_source: Option<JacobianSource>,
    /// Rows of the factors without a feature, if requested and the estimator is tracking.
    pub factor_rows: Option<Vec<FactorRows>>,
    /// Information gain of the newest image about the calibration, if the linearization was requested and the estimator
    /// is tracking; zero for an image that is no keyframe, since it is dropped.
    pub gain: Option<InformationGain>,
    pub keyframe: bool,
    /// Stage timings (the only part of a report that may differ between replays).
    pub times: StageTimes,
    /// Problems that did not stop the step.
    pub warnings: Vec<StepWarning>,
}

impl StepReport {
    /// Name of the frame: the number of the main camera's image, or the number and the camera of another one, as in
    /// `12 of cam1`.
    pub fn frame_name(&self) -> String {
        let (camera, index) = (self.frame_index / OTHER_CAMERA_FRAMES, self.frame_index % OTHER_CAMERA_FRAMES);
        let other = camera.checked_sub(1).and_then(|further| self.calibration.further_cameras.get(further));
        other.map_or_else(|| index.to_string(), |other| format!("{index} of {}", other.key))
    }

    /// Standard deviation of a pixel of a feature's camera, per coordinate; NaN while initializing.
    pub fn pixel_sigma_px(&self, feature: FeatureId) -> f64 {
        self.pixel_sigmas_px.get(feature.camera()).copied().unwrap_or(f64::NAN)
    }

    /// Newest frame of the window, `None` while initializing.
    pub fn newest(&self) -> Option<&FrameStateReport> {
        self.window.last()
    }
}
