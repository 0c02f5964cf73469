//! Configuration of an estimator: sensors, given calibration and options.

mod estimator_config;
mod options;

pub(crate) use estimator_config::rigid_chain;
pub use estimator_config::{
    CameraSensorPrior, DEFAULT_CHAIN_PRIOR, EstimatorConfig, FurtherCamera, imu_columns, imu_intrinsics, pose_columns,
};
pub(crate) use options::FIRST_KEYFRAME_INTERVAL_S;
pub use options::{EstimatorOptions, KEYFRAME_JOINT_INTERVAL_S, KEYFRAME_JOINT_RAD, TrackContinuation, VisualLoss};
