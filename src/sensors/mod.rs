//! Plain types of sensor data and rig: IMU samples, joint angles, gray images, noise densities. They do not
//! depend on the source of the data (log, simulation, driver).

mod angular_rates;
mod attitude_source;
mod image_mask;
mod imu;
mod imu_intrinsics;
mod joints;
mod named_axes;
mod pose;
mod required_accuracy;
mod rig;
mod stills;

pub use angular_rates::AngularRates;
pub use attitude_source::{
    AngleUnit, AttitudeFrame, AttitudeMessage, AttitudeSource, AttitudeValue, EulerAngles, EulerRotation,
};
pub use image_mask::{GrayImage, ImageMask};
pub(crate) use imu::LONGEST_INTERVAL_S;
pub use imu::{ImuNoise, ImuSample, STANDARD_GRAVITY_M_PER_S2, rotation_steps, sample_at, samples_between};
pub use imu_intrinsics::{ImuIntrinsics, ImuIntrinsicsParameters, KalibrImuMatrices, ScaleMisalignment};
pub use joints::{JointAngles, JointMotionFit, JointSample};
pub use named_axes::{BodyAxes, NamedAxes};
pub use pose::{LeverArm, MAX_LEVER_ARM_M, NEAREST_POSE_NS, PoseSample, PoseTrack, PositionSample};
pub use required_accuracy::RequiredAccuracy;
pub use rig::{
    AssumedField, CameraMask, CameraMount, CameraRig, ChainPrior, GimbalImuRig, GimbalRig, ImuRig, IntrinsicsSigma,
    Joint, Rig, UnknownCamera,
};
pub use stills::{MapPoint, StillCamera, StillSet, StillView, Stills, StillsChain};
