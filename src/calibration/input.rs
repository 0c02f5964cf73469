//! What the calibration is given.

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
    /// Encoder angles at the stamp with their standard deviations.
    pub joint_angles: Option<JointAngles>,
    /// The tracked features.
    pub tracks: Arc<TrackedFrame>,
}

/// The static camera as the rig gives it.
#[derive(Clone, Debug)]
pub struct StaticCamera {
    /// Key in the rig.
    pub key: String,
    /// Projection.
    pub model: CameraModel,
    /// Its pose on the IMU.
    pub imu_from_camera: RigidTransform,
    /// How wrong that pose may be.
    pub prior: ChainPrior,
    /// Its images in time order.
    pub views: Vec<TrackedView>,
}

/// The camera on the gimbal as the rig gives it.
#[derive(Clone, Debug)]
pub struct GimbalCamera {
    /// Key in the rig.
    pub key: String,
    /// Projection.
    pub model: CameraModel,
    /// The chain that carries it.
    pub chain: ClassicalChain,
    /// Names of the joints.
    pub joints: Vec<String>,
    /// How wrong the chain may be.
    pub prior: ChainPrior,
    /// Its images in time order.
    pub views: Vec<TrackedView>,
}

/// A flight with both cameras.
#[derive(Clone, Debug)]
pub struct CalibrationInput {
    /// The camera fixed to the vehicle.
    pub static_camera: StaticCamera,
    /// The camera on the gimbal.
    pub gimbal_camera: GimbalCamera,
    /// Noise of the inertial sensor.
    pub imu_noise: ImuNoise,
    /// Magnitude of gravity in m/s².
    pub gravity_m_per_s2: f64,
    /// The estimator that flies the static camera for the first trajectory.
    pub estimator: EstimatorConfig,
}
