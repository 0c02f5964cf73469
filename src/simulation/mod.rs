//! Synthetic flights with ground truth, written as flight logs.
//!
//! A multirotor follows a smooth aggressive path within its limits, a gimbal under its nose looks around and stabilizes
//! the image with lag, and sensors measure with noise.
//! All randomness comes from a seed; the same options give the same bits for any number of threads.

pub mod aim;
pub mod equipment;
pub mod exercise;
pub mod experiment;
pub mod gimbal;
pub mod gimbal_imu;
pub mod imu;
pub mod motion;
pub mod motion_samples;
pub mod random;
pub mod route;
pub mod scenario;
pub mod spline;
pub mod synthetic;
pub mod synthetic_stills;
#[cfg(test)]
pub mod tests;
pub mod trajectory;
pub mod vibration;

pub use equipment::Lens;
pub use exercise::{Exercise, GROWTH_S, JOINT_PERIOD_S, JointSwing, ROCK_PERIOD_S, VehicleSwing};
pub use experiment::{Environment, Experiment, WorldKind};
pub use gimbal::JointMotion;
pub use imu::SimulatedBias;
pub use motion::MotionSplines;
pub use motion_samples::{MotionSample, PrescribedMotion};
pub use synthetic::{
    SyntheticFlight, SyntheticFrame, SyntheticMotion, SyntheticMount, SyntheticOptions, synthetic_tracks,
};
pub use synthetic_stills::{SyntheticStills, SyntheticStillsOptions, synthetic_stills};
pub use trajectory::{Kinematics, Trajectory, VehicleLimits};
pub use vibration::Vibration;
