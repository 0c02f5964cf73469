//! Everything there is to know about one step: window, calibration, features, residuals, times.

use nalgebra::Vector3;

use super::events::Event;
use super::features::{FeatureCounts, FeatureReport, LandmarkReport};
use super::information_gain::InformationGain;
use super::jacobian_source::{FactorRows, JacobianSource};
use super::linearization::Linearization;
use super::residuals::{IterationReport, ResidualSummary};
use crate::geometry::RigidTransform;
use crate::gimbal::{ClassicalChain, ParameterId, Parameterization, Singularity};

/// Where the estimator is in its life.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Waiting for enough motion, or for a stationary vehicle.
    Initializing,
    /// Estimating.
    Tracking,
}

impl Phase {
    /// One word for panels and tables.
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
    /// Its stamp since the log began.
    pub stamp_ns: i64,
    /// Pose.
    pub world_from_imu: RigidTransform,
    /// Velocity in the world.
    pub velocity_m_per_s: Vector3<f64>,
    /// Accelerometer bias in the IMU frame.
    pub accelerometer_bias_m_per_s2: Vector3<f64>,
    /// Gyroscope bias in the IMU frame.
    pub gyroscope_bias_rad_per_s: Vector3<f64>,
    /// Joint angles as estimated (without the static offsets), empty for a rigid camera.
    pub joint_angles_rad: Vec<f64>,
    /// Encoder angles at the stamp, `None` without encoders.
    pub encoder_angles_rad: Option<Vec<f64>>,
    /// Their standard deviations, from the noise of the readings and how many could be averaged.
    pub encoder_sigmas_rad: Option<Vec<f64>>,
    /// Pose of the camera on the IMU at these joint angles.
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
    /// Prior standard deviation of each.
    pub prior_sigmas: Vec<f64>,
    /// The whole chain in the classical form.
    pub classical: ClassicalChain,
    /// Margins to the parameterization's singularities: base, end, then |sin alpha| of each middle link.
    pub margins: Vec<(Singularity, f64)>,
    /// The rigid cameras that are watched beside the main one, with their poses on the IMU; their columns follow the
    /// chain's.
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

/// Everything there is to know about one step.
#[derive(Clone, Debug, PartialEq)]
pub struct StepReport {
    /// Number of the image in its camera's stream.
    pub frame_index: usize,
    /// Its stamp since the log began.
    pub stamp_ns: i64,
    /// Where the estimator is in its life.
    pub phase: Phase,
    /// How often it has restarted so far.
    pub restarts: usize,
    /// Standard deviation of a well tracked pixel that it counts with, per coordinate.
    pub pixel_sigma_px: f64,
    /// The same with the robust weights of this step: the one that carries as much information as its pixels do on average.
    pub effective_pixel_sigma_px: f64,
    /// What happened.
    pub events: Vec<Event>,
    /// The frames of the window after the solve, oldest first; empty while initializing.
    pub window: Vec<FrameStateReport>,
    /// The static calibration (the given one while initializing).
    pub calibration: CalibrationEstimate,
    /// Features that took part in the solve.
    pub features: Vec<FeatureReport>,
    /// How many they are.
    pub counts: FeatureCounts,
    /// Points of the map in the world.
    pub landmarks: Vec<LandmarkReport>,
    /// χ² by kind of factor.
    pub residuals: Vec<ResidualSummary>,
    /// Root mean square of the reprojection residuals before the solve, in pixels.
    pub reprojection_rms_before_px: f64,
    /// The same after the solve.
    pub reprojection_rms_after_px: f64,
    /// Median length of those after the solve, which a few bad tracks do not lead; not-a-number without any.
    pub reprojection_median_after_px: f64,
    /// The solver's iterations.
    pub iterations: Vec<IterationReport>,
    /// The linearization, when it was asked for and the estimator is tracking.
    pub linearization: Option<Linearization>,
    /// What the blocks of the Jacobian can be written out from ([`StepReport::jacobian`]), when the linearization was asked
    /// for and the estimator is tracking.
    pub jacobian_source: Option<JacobianSource>,
    /// The rows of the factors that are not of features, when they were asked for and the estimator is tracking.
    pub factor_rows: Option<Vec<FactorRows>>,
    /// Information gain of the newest image about the calibration, when the linearization was asked for and the estimator
    /// is tracking: nothing unless it becomes a keyframe, since another image is dropped again.
    pub gain: Option<InformationGain>,
    /// Whether the frame is a keyframe.
    pub keyframe: bool,
    /// Stage timings (the only part of a report that differs between replays).
    pub times: StageTimes,
    /// What went wrong without stopping the step.
    pub warnings: Vec<String>,
}

impl StepReport {
    /// The newest frame of the window, `None` while initializing.
    pub fn newest(&self) -> Option<&FrameStateReport> {
        self.window.last()
    }
}
