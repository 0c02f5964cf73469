//! The sliding-window estimator: state (Eq. 7), residuals (Eqs. 8–10), solver, marginalization.
//!
//! It processes a [`StepInput`] per image and returns a [`StepReport`].

mod config;
mod earlier_pass;
#[expect(clippy::module_inception, reason = "the type that the folder is about")]
mod estimator;
mod factors;
mod hypothetical;
pub mod initialization;
mod interventions;
mod options;
mod packed;
mod report;
mod setup;
mod state;
mod step_input;
#[cfg(test)]
mod tests;
mod window;

pub use config::{
    CameraSensorPrior, DEFAULT_CHAIN_PRIOR, EstimatorConfig, RigidCamera, imu_columns, imu_intrinsics, rigid_columns,
};
pub use earlier_pass::{BiasPrior, EarlierPass};
pub use estimator::Estimator;
pub use factors::{imu_factor, preintegration};
pub use hypothetical::{HypotheticalFrame, HypotheticalLandmark, HypotheticalWindow, JointKnowledge, PoseKnowledge};
pub use interventions::{InterventionError, SensorColumns};
pub use options::{EstimatorOptions, TrackContinuation};
pub use packed::{PackedEstimator, StepMeasurements};
pub use preintegration::{ImuBias, MotionIncrement, NavigationState, Preintegration};
pub use report::{
    CalibrationEstimate, ColumnBlock, ColumnGroup, ColumnId, Event, EventKind, FactorKind, FactorRows, FailureCause,
    FeatureCounts, FeatureReport, FeatureRows, FrameId, FrameStateReport, InformationGain, IterationReport,
    JacobianFactor, JacobianRow, JacobianSource, LandmarkReport, Linearization, Motion, ObservationReport,
    Observations, Phase, PoseCovariance, ReportBytes, ResidualSummary, StageTimes, StepJacobian, StepReport,
    allocated_bytes,
};
pub use setup::gravity_in_world;
pub use step_input::StepInput;
