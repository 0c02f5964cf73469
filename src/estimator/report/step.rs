//! The immutable report that every step leaves behind.

use nalgebra::{DMatrix, DVector, Vector2, Vector3};

use crate::estimator::{FactorRows, InformationGain, JacobianSource, Observations};
use crate::frontend::FeatureId;
use crate::geometry::RigidTransform;
use crate::gimbal::{Chain, ClassicalChain};

/// Where the estimator is in its life.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Waiting for enough motion, or for a good standstill.
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

/// What kind of event a step reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum EventKind {
    /// An attempt to initialize that has to wait; the message says for what.
    InitializationWaits,
    /// The window was initialized from motion.
    InitializedFromMotion,
    /// The window was initialized from standstill.
    InitializedFromStandstill,
    /// The frame became a keyframe (or did not); the value is the deciding figure.
    KeyframeChosen,
    /// The oldest frame was marginalized.
    OldestMarginalized,
    /// The second-newest frame was dropped.
    SecondNewestMarginalized,
    /// Features were rejected as outliers after the solve.
    OutliersRejected,
    /// The vehicle stands still.
    Standstill,
    /// The estimator failed and starts again.
    Failure,
    /// The chart of the parameterization was switched.
    ChartSwitched,
    /// Measurements were missing or unusable.
    MeasurementMissing,
}

impl EventKind {
    /// Whether it tells that the step made the first window.
    pub fn begins_window(self) -> bool {
        matches!(self, Self::InitializedFromMotion | Self::InitializedFromStandstill)
    }

    /// Whether it is rare enough to jump to, and for the lane of events; nearly every frame has one of the others, which
    /// have lanes of their own or none.
    pub fn is_notable(self) -> bool {
        match self {
            Self::InitializedFromMotion
            | Self::InitializedFromStandstill
            | Self::Standstill
            | Self::Failure
            | Self::ChartSwitched
            | Self::MeasurementMissing => true,
            Self::InitializationWaits
            | Self::KeyframeChosen
            | Self::OldestMarginalized
            | Self::SecondNewestMarginalized
            | Self::OutliersRejected => false,
        }
    }
}

/// Something that happened in a step, with the figure that decided it.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// What kind.
    pub kind: EventKind,
    /// Why, in one sentence, with units.
    pub message: String,
    /// The measured value, when one decided.
    pub value: Option<f64>,
    /// The threshold it was held against.
    pub threshold: Option<f64>,
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
    /// Name of the parameterization in use, as on the command line.
    pub parameterization: String,
    /// Parameter names in column order, as in the golden files (`IB.rx`, `L1.theta`, …); those of a rigid camera beside
    /// the main one begin with its key (`cam1.rx`).
    pub names: Vec<String>,
    /// Unit of each: `rad` or `m`.
    pub units: Vec<&'static str>,
    /// Value of each (rotation blocks as rotation vectors relative to the rig's value, plus that value's own log).
    pub values: Vec<f64>,
    /// Posterior standard deviation of each (NaN before the first solve).
    pub sigmas: Vec<f64>,
    /// Prior standard deviation of each.
    pub prior_sigmas: Vec<f64>,
    /// The whole chain in the classical form.
    pub classical: ClassicalChain,
    /// Margins to the chart's locks: base, end, then |sin alpha| of each middle link.
    pub margins: Vec<(String, f64)>,
    /// The rigid cameras that are watched beside the main one, with their poses on the IMU; their columns follow the
    /// chain's.
    pub rigid_cameras: Vec<(String, RigidTransform)>,
}

/// One measurement of a feature by a frame of the window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObservationReport {
    /// Number of the observing image in its stream.
    pub frame_index: usize,
    /// Measured pixel.
    pub measured_px: Vector2<f64>,
    /// Predicted minus measured before the solve, in pixels.
    pub residual_before_px: Option<Vector2<f64>>,
    /// Predicted minus measured after the solve, in pixels.
    pub residual_after_px: Option<Vector2<f64>>,
    /// Squared whitened residual after the solve.
    pub chi2: f64,
    /// Weight that the robust loss left it, 0 to 1.
    pub robust_weight: f64,
}

/// One feature that took part in the solve.
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureReport {
    /// Who it is; [`FeatureId::camera`] tells which camera sees it.
    pub id: FeatureId,
    /// The frame it is anchored in.
    pub anchor_frame_index: usize,
    /// Inverse depth along the anchor's optical axis, in 1/m.
    pub inverse_depth_per_m: f64,
    /// All its observations in the window, the anchor's first.
    pub observations: Observations,
    /// Rejected as an outlier after this solve.
    pub rejected: bool,
}

/// How many features took part in the solve; known of every step, also where the features themselves are not kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FeatureCounts {
    /// Features that took part.
    pub solved: usize,
    /// Of them rejected as outliers after the solve.
    pub rejected: usize,
    /// All their observations in the window.
    pub observations: usize,
}

impl FeatureCounts {
    /// Of the features of a report.
    pub fn of(features: &[FeatureReport]) -> Self {
        Self {
            solved: features.len(),
            rejected: features.iter().filter(|feature| feature.rejected).count(),
            observations: features.iter().map(|feature| feature.observations.len()).sum(),
        }
    }

    /// Features that took part and were not rejected.
    pub fn inliers(&self) -> usize {
        self.solved - self.rejected
    }
}

/// A feature as a point of the world, for drawing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LandmarkReport {
    /// Who it is.
    pub id: FeatureId,
    /// Where, in the world.
    pub position_m: Vector3<f64>,
}

/// One iteration of the solver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IterationReport {
    /// Cost before the step.
    pub cost_before: f64,
    /// Cost after it.
    pub cost_after: f64,
    /// Damping or trust radius in use.
    pub damping: f64,
    /// Norm of the step.
    pub step_norm: f64,
    /// Whether the step was taken.
    pub accepted: bool,
}

/// Sum of squared whitened residuals of one kind of factor, and how many there are.
#[derive(Clone, Debug, PartialEq)]
pub struct ResidualSummary {
    /// `visual`, `imu`, `encoder`, `calibration prior`, `marginalization prior`, and `standstill` where there is one.
    pub factor: &'static str,
    /// Number of scalar residuals.
    pub count: usize,
    /// χ² before the solve.
    pub chi2_before: f64,
    /// χ² after the solve.
    pub chi2_after: f64,
}

impl ResidualSummary {
    /// Mean of the squared whitened residuals after the solve; `None` without residuals.
    pub fn mean_square(&self) -> Option<f64> {
        (self.count > 0).then(|| self.chi2_after / self.count as f64)
    }
}

/// What a block of columns stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ColumnGroup {
    /// Static calibration.
    Calibration,
    /// Joint angles of a frame.
    Joints,
    /// Pose of a frame (rotation, translation).
    Pose,
    /// Velocity and biases of a frame.
    SpeedBias,
    /// Inverse depth of a feature.
    InverseDepth,
}

/// A run of columns that belong together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ColumnBlock {
    /// What kind.
    pub group: ColumnGroup,
    /// For the calibration the parameter's name, else `pose 12`, `joints 12`, `depth 345`.
    pub name: String,
    /// First column.
    pub start: usize,
    /// Number of columns.
    pub len: usize,
}

/// The whitened linearization of the step at its final estimate, without the priors on the calibration.
///
/// The inverse depths are already projected out by orthogonal projection (each feature's own rows rotated and its first
/// row dropped), so that the rows stay whitened residuals and no normal equations were formed.
#[derive(Clone, Debug, PartialEq)]
pub struct Linearization {
    /// Column blocks in order: calibration, joints, poses, speed-biases.
    pub columns: Vec<ColumnBlock>,
    /// Names of calibration parameters that are held at their values: they are known, and have no columns.
    pub held: Vec<String>,
    /// Jacobian of the measurements, rows whitened.
    pub jacobian: DMatrix<f64>,
    /// Jacobian of the priors (rig prior on the calibration, marginalization prior), same columns, whitened.
    pub prior_jacobian: DMatrix<f64>,
    /// How many rows of these, the first ones, are the rig's prior.
    pub rig_prior_rows: usize,
    /// Norm of each calibration column before the depths were projected out, for the reference of the rank rule.
    pub calibration_column_norms: DVector<f64>,
    /// The chain at which the calibration's columns were taken (with first estimates not the present one).
    pub chain: Chain,
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
    /// Rejecting outliers, switching charts, marginalizing.
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
    /// The same with the robust weights of this step: the one that tells as much as its pixels do on average.
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
    /// What the newest image tells about the calibration, when the linearization was asked for and the estimator is tracking:
    /// nothing unless it becomes a keyframe, since another image is forgotten again.
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
