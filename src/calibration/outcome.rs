//! What a calibration came to, as plain numbers.

use super::statistics::Statistics;
use crate::geometry::{RigidTransform, so3};
use crate::gimbal::{ClassicalChain, ParameterId};
use crate::observability::RankReport;

/// One calibrated number.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibratedParameter {
    /// Which of the chain's.
    pub parameter: ParameterId,
    /// What the rig gave.
    pub initial: f64,
    /// What the calibration found.
    pub value: f64,
    /// Its standard deviation.
    pub sigma: f64,
    /// Its standard deviation by the rig alone.
    pub prior_sigma: f64,
}

/// Residuals of one camera.
#[derive(Clone, Debug, PartialEq)]
pub struct PixelReport {
    /// Key of the camera.
    pub camera: String,
    /// Landmarks with a sighting by this camera.
    pub landmarks: usize,
    /// Lengths of the residuals in pixels.
    pub residuals_px: Statistics,
    /// Standard deviation of a pixel's coordinate by their median.
    pub sigma_px: f64,
}

/// What the inertial samples disagree by with the adjusted motion.
#[derive(Clone, Debug, PartialEq)]
pub struct ImuResidualReport {
    /// Mean angular velocity between instants against the gyroscope's, in rad/s.
    pub gyroscope_rad_per_s: Statistics,
    /// Mean acceleration between instants against the accelerometer's, in m/s².
    pub accelerometer_m_per_s2: Statistics,
}

/// The chain by the pose loops alone.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseLoopReport {
    /// Reconstructions of the gimbal camera.
    pub segments: usize,
    /// Pairs of camera poses.
    pub pairs: usize,
    /// Pairs that kept at least half of their weight.
    pub fitting: usize,
    /// Lengths of the gaps of the loops in metres.
    pub gaps_m: Statistics,
    /// Standard deviation of a measured position per coordinate, by their median.
    pub position_sigma_m: f64,
    /// The chain.
    pub chain: ClassicalChain,
    /// Standard deviations of the chain's parameters if measured poses erred independently; what the poses of one
    /// reconstruction have in common is not in them.
    pub sigmas: Vec<f64>,
    /// Steps of the solver.
    pub iterations: usize,
}

/// The static camera's pose on the IMU after a stage.
#[derive(Clone, Debug, PartialEq)]
pub struct ExtrinsicsReport {
    /// What the rig gave.
    pub initial: RigidTransform,
    /// What was found.
    pub imu_from_camera: RigidTransform,
    /// Its standard deviations, `[φ; t]` in radians and metres.
    pub sigmas: [f64; 6],
    /// What is to be added to the rig's time offset, in seconds, and its standard deviation.
    pub time_shift_s: (f64, f64),
}

/// The result of an offline calibration.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibrationOutcome {
    /// Begin and end of the stretch that was used, since the log began.
    pub stretch_ns: (i64, i64),
    /// Instants whose states were estimated.
    pub frame_sets: usize,
    /// Static camera and IMU alone.
    pub static_camera_imu: ExtrinsicsReport,
    /// Residuals of that stage.
    pub static_pixels: PixelReport,
    /// The pose loops.
    pub pose_loop: PoseLoopReport,
    /// The static camera after the bundle of both cameras.
    pub extrinsics: ExtrinsicsReport,
    /// What is to be added to the gimbal camera's time offset, in seconds, and its standard deviation.
    pub gimbal_time_shift_s: (f64, f64),
    /// The chain after the bundle.
    pub chain: ClassicalChain,
    /// The chain as the rig gave it.
    pub given_chain: ClassicalChain,
    /// Name of the form that was estimated.
    pub parameterization: &'static str,
    /// The chain's parameters.
    pub parameters: Vec<CalibratedParameter>,
    /// Residuals of the bundle, static camera first.
    pub pixels: [PixelReport; 2],
    /// Steps of the solver: static camera alone, both cameras.
    pub iterations: [usize; 2],
    /// Residuals of the inertial samples.
    pub inertial: ImuResidualReport,
    /// Observability of the chain in the whole flight.
    pub rank: Option<RankReport>,
    /// Joint angles of the measurements, as estimated.
    pub visited_rad: Vec<Vec<f64>>,
    /// What a user should know.
    pub warnings: Vec<String>,
}

/// Distance of a chain from another one over joint angles: translation in metres, rotation in radians.
///
/// `None` without angles.
pub fn chain_distance(
    chain: &ClassicalChain,
    reference: &ClassicalChain,
    angles_rad: &[Vec<f64>],
) -> Option<(Statistics, Statistics)> {
    let (translations, rotations): (Vec<f64>, Vec<f64>) = angles_rad
        .iter()
        .map(|angles| transform_distance(&chain.imu_from_camera(angles), &reference.imu_from_camera(angles)))
        .unzip();
    Some((Statistics::of(&translations)?, Statistics::of(&rotations)?))
}

/// Distance and angle between two transforms, in metres and radians.
pub fn transform_distance(transform: &RigidTransform, reference: &RigidTransform) -> (f64, f64) {
    (
        (transform.translation_m - reference.translation_m).norm(),
        so3::log(&(reference.rotation.inverse() * transform.rotation)).norm(),
    )
}
