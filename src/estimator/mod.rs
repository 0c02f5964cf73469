//! The sliding-window estimator: state (Eq. 7), residuals (Eqs. 8–10), solver, marginalization.
//!
//! It processes a [`StepInput`] per image and returns a [`StepReport`].

mod config;
#[expect(clippy::module_inception, reason = "the type that the folder is about")]
mod estimator;
mod explain;
pub(crate) mod factors;
pub mod initialization;
mod interventions;
mod packed;
mod problem;
mod report;
mod start;
pub(crate) mod state;
mod stationary;
mod step_input;
#[cfg(test)]
mod tests;
mod window;

pub use config::{
    CameraSensorPrior, DEFAULT_CHAIN_PRIOR, EstimatorConfig, EstimatorOptions, FurtherCamera,
    KEYFRAME_JOINT_INTERVAL_S, KEYFRAME_JOINT_RAD, TrackContinuation, VisualLoss, imu_columns, imu_intrinsics,
    pose_columns,
};
pub use estimator::Estimator;
pub use explain::{FeatureRows, StepJacobian};
pub use factors::{FactorKind, imu as imu_factor};
pub use interventions::{InterventionError, SensorParameters};
pub use packed::PackedEstimator;
pub use problem::hypothetical::{
    HypotheticalCameraImu, HypotheticalFrame, HypotheticalLandmark, HypotheticalWindow, JointKnowledge, PoseKnowledge,
};
pub use problem::information_gain::{InformationGain, Motion};
pub use problem::linearization::Linearization;
pub use problem::solver::IterationReport;
pub use report::{
    CalibrationEstimate, Event, EventKind, FactorRows, FailureCause, FeatureCounts, FeatureReport, FrameStateReport,
    FurtherCameraEstimate, JacobianFactor, JacobianRow, JacobianSource, LandmarkReport, ObservationReport,
    Observations, Phase, PoseCovariance, ReportBytes, ResidualSummary, Stage, StageTimes, StepReport, StepWarning,
};
pub use state::allocation::allocated_bytes;
pub use state::calibration::INACCURATE_ROTATION_RAD;
pub use state::calibration_posterior::{CalibrationPosterior, CalibrationPrior, CameraPosterior, ColumnBelief};
pub use state::columns::{ColumnBlock, ColumnGroup, ColumnId, FrameId};
pub use state::earlier_pass::{BiasPrior, EarlierPass};
pub use state::navigation::GimbalImuState;
pub use state::preintegration::{self, ImuBias, MotionIncrement, NavigationState, Preintegration};
pub use step_input::{OTHER_CAMERA_FRAMES, StepInput, StepMeasurements};
pub use window::setup::gravity_in_world;
