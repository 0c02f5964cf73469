//! Input of the calibration.

use std::sync::Arc;

use crate::camera::CameraModel;
use crate::estimator::{CalibrationPosterior, EstimatorConfig};
use crate::frontend::TrackedFrame;
use crate::geometry::RigidTransform;
use crate::gimbal::ClassicalChain;
use crate::sensors::{ChainPrior, ImuNoise, ImuSample, JointAngles};

/// Image of a camera without its pixels.
#[derive(Clone, Debug)]
pub struct TrackedView {
    /// Index of the image in its camera's stream.
    pub frame_index: usize,
    /// Stamp of the image in IMU time since the start of the log; includes the rig's time offset.
    pub stamp_ns: i64,
    /// IMU samples from the previous image's stamp to this one's, both ends included and interpolated.
    pub imu: Vec<ImuSample>,
    /// Encoder angles at the stamp with standard deviations, `None` without readings.
    pub joint_angles: Option<JointAngles>,
    pub tracks: Arc<TrackedFrame>,
}

/// Static camera with its given extrinsics.
#[derive(Clone, Debug)]
pub struct StaticCamera {
    pub key: String,
    pub model: CameraModel,
    pub imu_from_camera: RigidTransform,
    /// Error bounds of the extrinsics.
    pub prior: ChainPrior,
    pub views: Vec<TrackedView>,
}

/// Gimbal camera with its given chain.
#[derive(Clone, Debug)]
pub struct GimbalCamera {
    pub key: String,
    pub model: CameraModel,
    /// Given chain from IMU to camera.
    pub chain: ClassicalChain,
    /// Joint names, from base to end effector.
    pub joints: Vec<String>,
    /// Error bounds of the chain.
    pub prior: ChainPrior,
    pub views: Vec<TrackedView>,
}

/// Posterior of earlier flights as prior of a calibration.
#[derive(Clone, Debug, PartialEq)]
pub struct EarlierFlights {
    pub posterior: CalibrationPosterior,
    /// Places of static and gimbal camera among the cameras of the posterior; the rig's prior holds for a missing one.
    pub places: [Option<usize>; 2],
    /// Time offsets of both cameras in the rig, in seconds.
    pub given_shifts_s: [f64; 2],
}

/// Tracked images, IMU samples and encoder readings of a flight with both cameras.
#[derive(Clone, Debug)]
pub struct CalibrationInput {
    /// Camera fixed to the vehicle.
    pub static_camera: StaticCamera,
    pub gimbal_camera: GimbalCamera,
    pub imu_noise: ImuNoise,
    pub gravity_m_per_s2: f64,
    /// Posterior of earlier flights, from which values and prior of the calibration are taken.
    pub earlier: Option<EarlierFlights>,
    /// Configuration of the estimator that processes the static camera for the initial trajectory.
    pub estimator: EstimatorConfig,
}
