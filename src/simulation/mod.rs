//! Synthetic flights with ground truth, written as flight logs.
//!
//! A multirotor follows a smooth aggressive path within its limits, a gimbal under its nose looks around and stabilizes
//! the image with lag, and sensors measure with noise.
//! All randomness comes from a seed; the same options give the same bits for any number of threads.

#![cfg_attr(not(feature = "logs"), expect(dead_code, reason = "recorded flights use more than tracks do"))]

mod aim;
#[cfg(feature = "logs")]
mod disturbances;
mod equipment;
#[cfg(feature = "logs")]
mod error;
mod exercise;
mod experiment;
mod gimbal;
mod gimbal_imu;
mod imu;
mod motion;
mod motion_samples;
#[cfg(feature = "logs")]
mod options;
#[cfg(feature = "logs")]
mod planting;
#[cfg(feature = "logs")]
mod prescribed;
mod random;
#[cfg(feature = "logs")]
mod render;
#[cfg(feature = "logs")]
mod rig_of_file;
mod route;
mod scenario;
#[cfg(feature = "logs")]
mod simulate;
mod spline;
mod synthetic;
mod synthetic_stills;
#[cfg(test)]
mod tests;
mod trajectory;
mod vibration;
#[cfg(feature = "logs")]
mod world;

#[cfg(feature = "logs")]
pub use disturbances::Disturbances;
pub use equipment::Lens;
#[cfg(feature = "logs")]
pub use error::SimulationError;
pub use exercise::{Exercise, GROWTH_S, JOINT_PERIOD_S, JointSwing, ROCK_PERIOD_S, VehicleSwing};
pub use experiment::{Environment, Experiment, WorldKind};
pub use gimbal::JointMotion;
pub use imu::SimulatedBias;
pub use motion::MotionSplines;
pub use motion_samples::{MotionSample, PrescribedMotion};
#[cfg(feature = "logs")]
pub use options::{SimulationOptions, SimulationProgress, SimulationSummary};
#[cfg(feature = "logs")]
pub use simulate::{simulate, simulate_interruptible};
pub use synthetic::{
    SyntheticFlight, SyntheticFrame, SyntheticMotion, SyntheticMount, SyntheticOptions, synthetic_tracks,
};
pub use synthetic_stills::{SyntheticStills, SyntheticStillsOptions, synthetic_stills};
pub use trajectory::{Kinematics, Trajectory, VehicleLimits};
pub use vibration::Vibration;
