//! Input and options of the calibration.

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

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibrationOptions {
    /// Time between frame sets, in seconds.
    pub spacing_s: f64,
    /// Longest track in frame sets; longer ones are cut, which bounds the computing time.
    pub max_frame_sets_per_track: usize,
    /// Smallest number of observations of a landmark.
    pub min_observations: usize,
    /// Smallest angle between two rays of a landmark, in radians.
    pub min_parallax_rad: f64,
    /// Largest number of iterations of one adjustment.
    pub iterations: usize,
    /// Convergence threshold: a step lowers the cost by less than this fraction.
    pub relative_cost_tolerance: f64,
    /// Number of bundle adjustments, with outlier rejection between them.
    pub rounds: usize,
    /// Standard deviations beyond which an observation is dropped.
    pub outlier_sigmas: f64,
    /// Largest number of views in one reconstruction of the gimbal camera's poses.
    pub segment_views: usize,
    /// Smallest number of pairs of poses; the paper uses 39.
    pub min_measurements: usize,
    /// Smallest standard deviation of the angle of a moving joint, in radians.
    pub min_joint_motion_rad: f64,
    /// Compute the covariance of every pose of the trajectory.
    pub pose_covariances: bool,
    /// Prior standard deviation of a camera's time offset, in seconds.
    pub time_shift_sigma_s: f64,
    /// Prior standard deviations of the first biases about zero, in rad/s and m/s².
    pub bias_sigmas: (f64, f64),
}

impl Default for CalibrationOptions {
    fn default() -> Self {
        Self {
            spacing_s: 0.1,
            max_frame_sets_per_track: 18,
            min_observations: 3,
            min_parallax_rad: 0.015,
            iterations: 15,
            relative_cost_tolerance: 1e-5,
            rounds: 3,
            outlier_sigmas: 4.0,
            segment_views: 16,
            min_measurements: 39,
            min_joint_motion_rad: 1.5_f64.to_radians(),
            pose_covariances: false,
            time_shift_sigma_s: 0.01,
            bias_sigmas: (0.05, 0.5),
        }
    }
}
