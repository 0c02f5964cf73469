//! What sensors deliver and what a rig says of them, as plain types: IMU samples, joint angles, gray images, noise
//! densities, the rig. Where they come from (a log, a simulation, a driver) is not known here.

mod gray_image;
mod imu;
mod joints;
mod pose;
mod rig;

pub use gray_image::GrayImage;
pub use imu::{ImuNoise, ImuSample};
pub use joints::{JointAngles, JointSample};
pub use pose::PoseSample;
pub use rig::{CameraMount, CameraRig, ChainPrior, GimbalRig, ImuRig, Joint, Rig, UnknownCamera};
