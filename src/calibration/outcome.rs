//! Result of a calibration as plain numbers.

use serde::Serialize;

use super::trajectory::BatchPose;
use crate::estimator::CalibrationPosterior;
use crate::geometry::{RigidTransform, median, so3};
use crate::gimbal::{ClassicalChain, ParameterId, Parameterization};
use crate::observability::RankReport;

/// Value of a calibrated parameter, in radians, metres or seconds.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibratedParameter {
    pub parameter: ParameterId,
    /// Value in the given rig.
    pub initial: f64,
    pub value: f64,
    pub sigma: f64,
    pub prior_sigma: f64,
}

/// Reprojection residuals of one camera.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PixelReport {
    pub camera: String,
    /// Number of landmarks with an observation by this camera.
    pub landmarks: usize,
    /// Lengths of the residuals in pixels.
    #[serde(rename = "error_px")]
    pub residuals_px: Statistics,
    /// Standard deviation of a pixel coordinate, from the median residual.
    #[serde(skip)]
    pub sigma_px: f64,
}

/// IMU residuals after the adjustment.
#[derive(Clone, Debug, PartialEq)]
pub struct ImuResidualReport {
    /// Mean angular velocity between frame sets minus the gyroscope's, in rad/s.
    pub gyroscope_rad_per_s: Statistics,
    /// Mean acceleration between frame sets minus the accelerometer's, in m/s².
    pub accelerometer_m_per_s2: Statistics,
}

/// Chain calibrated by the pose loops only.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PoseLoopReport {
    /// Number of reconstructions of the gimbal camera.
    pub segments: usize,
    /// Number of pairs of camera poses.
    pub pairs: usize,
    /// Number of pairs with a robust weight of at least one half.
    pub fitting: usize,
    /// Lengths of the position gaps of the loops, in metres.
    #[serde(rename = "gap_m")]
    pub gaps_m: Statistics,
    /// Standard deviation of a measured position per coordinate in metres, from the median gap.
    #[serde(skip)]
    pub position_sigma_m: f64,
    #[serde(skip)]
    pub chain: ClassicalChain,
    /// Standard deviations of the chain's parameters for independent errors of the measured poses; excludes common
    /// errors of the poses of one reconstruction.
    #[serde(skip)]
    pub sigmas: Vec<f64>,
    #[serde(skip)]
    pub iterations: usize,
}

/// Extrinsics of the static camera after a stage.
#[derive(Clone, Debug, PartialEq)]
pub struct ExtrinsicsReport {
    pub initial: RigidTransform,
    pub imu_from_camera: RigidTransform,
    /// Standard deviations of `[φ; t]`, in radians and metres.
    pub sigmas: [f64; 6],
    /// Correction of the rig's time offset and its standard deviation, in seconds.
    pub time_shift_s: (f64, f64),
}

#[derive(Clone, Debug, PartialEq)]
pub struct CalibrationOutcome {
    /// Start and end of the used interval in nanoseconds since the start of the log.
    pub stretch_ns: (i64, i64),
    pub frame_sets: usize,
    /// Extrinsics after the stage with only static camera and IMU.
    pub static_camera_imu: ExtrinsicsReport,
    /// Reprojection residuals of the stage with only static camera and IMU.
    pub static_pixels: PixelReport,
    pub pose_loop: PoseLoopReport,
    /// Extrinsics of the static camera after the bundle of both cameras.
    pub extrinsics: ExtrinsicsReport,
    /// Correction of the gimbal camera's time offset and its standard deviation, in seconds.
    pub gimbal_time_shift_s: (f64, f64),
    /// Chain after the bundle of both cameras.
    pub chain: ClassicalChain,
    /// Chain in the given rig.
    pub given_chain: ClassicalChain,
    /// Parameterization of the estimated chain.
    pub parameterization: Parameterization,
    /// Gimbal camera, then static camera, as prior of another flight; time offsets relative to the rig's.
    pub posterior: CalibrationPosterior,
    /// Parameters of the chain, in the order of its columns.
    pub parameters: Vec<CalibratedParameter>,
    /// Reprojection residuals of the bundle, static camera first.
    pub pixels: [PixelReport; 2],
    /// Solver iterations of the static camera alone, then of both cameras.
    pub iterations: [usize; 2],
    pub imu: ImuResidualReport,
    /// Observability of the chain over the whole flight, `None` if it cannot be computed.
    pub rank: Option<RankReport>,
    /// Estimated joint angles of all measurements, in radians.
    pub visited_rad: Vec<Vec<f64>>,
    /// From static camera and IMU only, without covariances.
    pub static_trajectory: Vec<BatchPose>,
    /// From both cameras, with covariances if they were requested.
    pub trajectory: Vec<BatchPose>,
    /// Problems that did not stop the calibration.
    pub warnings: Vec<String>,
}

/// Distance of `imu_from_camera` from a reference over joint angles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ChainDistance {
    /// Mean distance of the camera positions in metres.
    pub translation_mean_m: f64,
    /// Standard deviation of the distance.
    pub translation_std_m: f64,
    /// Mean angle between the camera attitudes in radians.
    pub rotation_mean_rad: f64,
    /// Standard deviation of the angle.
    pub rotation_std_rad: f64,
}

impl ChainDistance {
    /// Distance of a chain from a reference, `None` without joint angles.
    pub fn over<'a>(
        chain: &ClassicalChain,
        reference: &ClassicalChain,
        angles_rad: impl IntoIterator<Item = &'a Vec<f64>>,
    ) -> Option<Self> {
        let (translations, rotations): (Vec<f64>, Vec<f64>) = angles_rad
            .into_iter()
            .map(|angles| transform_distance(&chain.imu_from_camera(angles), &reference.imu_from_camera(angles)))
            .unzip();
        let (translation, rotation) = (Statistics::of(&translations)?, Statistics::of(&rotations)?);
        Some(Self {
            translation_mean_m: translation.mean,
            translation_std_m: translation.std,
            rotation_mean_rad: rotation.mean,
            rotation_std_rad: rotation.std,
        })
    }

    /// Distance of extrinsics that no joint moves.
    pub fn of_extrinsics(imu_from_camera: &RigidTransform, reference: &RigidTransform) -> Self {
        let (translation_mean_m, rotation_mean_rad) = transform_distance(imu_from_camera, reference);
        Self { translation_mean_m, translation_std_m: 0.0, rotation_mean_rad, rotation_std_rad: 0.0 }
    }
}

/// Distance between two transforms: translation in metres, rotation angle in radians.
pub fn transform_distance(transform: &RigidTransform, reference: &RigidTransform) -> (f64, f64) {
    (
        (transform.translation_m - reference.translation_m).norm(),
        so3::log(&(reference.rotation.inverse() * transform.rotation)).norm(),
    )
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Statistics {
    pub count: usize,
    pub mean: f64,
    pub median: f64,
    /// Standard deviation about the mean.
    pub std: f64,
    pub rms: f64,
}

impl Statistics {
    /// Statistics of the values, `None` without values.
    pub fn of(values: &[f64]) -> Option<Self> {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let mean_square = values.iter().map(|value| value * value).sum::<f64>() / count;
        let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count;
        let median = median(values.iter().copied())?;
        Some(Self { count: values.len(), mean, median, std: variance.sqrt(), rms: mean_square.sqrt() })
    }
}
