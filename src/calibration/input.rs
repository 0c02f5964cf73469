//! Input of the calibration.

use std::sync::Arc;

use crate::camera::CameraModel;
use crate::estimator::EstimatorConfig;
use crate::frontend::TrackedFrame;
use crate::geometry::RigidTransform;
use crate::gimbal::ClassicalChain;
use crate::sensors::{ChainPrior, ImuNoise, ImuSample, JointAngles};

/// One image of a camera without its pixels.
#[derive(Clone, Debug)]
pub struct TrackedView {
    /// Number of the image in its camera's stream.
    pub frame_index: usize,
    /// Stamp of the image since the log began, on the IMU's clock: the rig's time offset is added.
    pub stamp_ns: i64,
    /// IMU samples from the previous image's stamp to this one's, both ends included and interpolated.
    pub imu: Vec<ImuSample>,
    /// Encoder angles at the stamp, with standard deviations.
    pub joint_angles: Option<JointAngles>,
    /// Tracked features of the image.
    pub tracks: Arc<TrackedFrame>,
}

/// The static camera with its given extrinsics.
#[derive(Clone, Debug)]
pub struct StaticCamera {
    /// Key in the rig.
    pub key: String,
    /// Projection model with intrinsics.
    pub model: CameraModel,
    /// Given extrinsics.
    pub imu_from_camera: RigidTransform,
    /// Error bounds of the extrinsics.
    pub prior: ChainPrior,
    /// Images in time order.
    pub views: Vec<TrackedView>,
}

/// The camera on the gimbal with its given chain.
#[derive(Clone, Debug)]
pub struct GimbalCamera {
    /// Key in the rig.
    pub key: String,
    /// Projection model with intrinsics.
    pub model: CameraModel,
    /// Given chain from IMU to camera.
    pub chain: ClassicalChain,
    /// Joint names, from base to end effector.
    pub joints: Vec<String>,
    /// Error bounds of the chain.
    pub prior: ChainPrior,
    /// Images in time order.
    pub views: Vec<TrackedView>,
}

/// Tracked images, IMU samples and encoder readings of a flight with both cameras.
#[derive(Clone, Debug)]
pub struct CalibrationInput {
    /// The camera fixed to the vehicle.
    pub static_camera: StaticCamera,
    /// The camera on the gimbal.
    pub gimbal_camera: GimbalCamera,
    /// Noise densities of the IMU.
    pub imu_noise: ImuNoise,
    /// Magnitude of gravity in m/s².
    pub gravity_m_per_s2: f64,
    /// Configuration of the estimator that processes the static camera for the initial trajectory.
    pub estimator: EstimatorConfig,
}
