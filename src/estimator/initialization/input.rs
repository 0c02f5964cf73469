//! Input of an initialization attempt.

use nalgebra::Vector3;

use crate::estimator::state::earlier_pass::BiasPrior;
use crate::frontend::TrackedFeature;
use crate::geometry::RigidTransform;
use crate::sensors::{ImuNoise, ImuSample};

#[derive(Clone, Copy, Debug)]
pub struct InitializationFrame<'a> {
    /// Index of the image in its camera's stream.
    pub frame_index: usize,
    /// Header stamp of the image since the start of the log.
    pub stamp_ns: i64,
    /// Features ordered by id; bearings are unit vectors in the camera.
    pub features: &'a [TrackedFeature],
    /// Features that the other camera of a stereo pair observes as well, ordered by id; bearings in that camera.
    pub matched: &'a [TrackedFeature],
    /// Extrinsics from calibration and encoders.
    pub imu_from_camera: RigidTransform,
    /// IMU samples from the previous frame's stamp to this one's, both ends included.
    pub imu: &'a [ImuSample],
}

#[derive(Clone, Debug)]
pub struct InitializationInput<'a> {
    /// Frames in time order, without gaps in the IMU samples between them.
    pub frames: &'a [InitializationFrame<'a>],
    pub gravity_m_per_s2: f64,
    pub imu_noise: ImuNoise,
    /// Last estimate of a stationary vehicle (from [`super::InitializationOutcome::Waiting`]), `None` if there was none.
    pub stationary: Option<StationaryEstimate>,
    /// Biases estimated by an earlier pass over the log.
    pub bias: Option<BiasPrior>,
    /// Other camera of the stereo pair of the frames' camera, `None` without one.
    pub pair: Option<StereoPair>,
}

/// Other camera of a stereo pair.
#[derive(Clone, Copy, Debug)]
pub struct StereoPair {
    pub camera_from_other: RigidTransform,
    /// Standard deviations of that pose, in metres and radians.
    pub sigmas: (f64, f64),
}

/// Measurements of a stationary vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StationaryEstimate {
    /// Stamp of the newest frame of the stationary phase.
    pub stamp_ns: i64,
    /// Gyroscope bias: the mean angular velocity.
    pub gyroscope_bias_rad_per_s: Vector3<f64>,
    /// Standard deviation of the gyroscope bias (worst axis).
    pub gyroscope_bias_sigma_rad_per_s: f64,
    /// Mean specific force: upwards, plus accelerometer bias.
    pub specific_force_m_per_s2: Vector3<f64>,
}
