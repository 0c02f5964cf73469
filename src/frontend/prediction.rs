use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::geometry::{ns_from_seconds, seconds_from_ns, so3};
use crate::gimbal::ClassicalChain;
use crate::sensors::{ImuSample, rotation_steps};

/// Predicted rotation of a camera between two images, with its covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PredictedRotation {
    /// `camera_now_from_camera_previous`; for a rolling shutter, between the middle rows.
    pub rotation: UnitQuaternion<f64>,
    /// Rotation of the camera during the readout of both images; `None` for a global shutter.
    pub rows: Option<RowRotations>,
    /// Covariance (3 × 3, rad²) of the error `δ` in the current camera frame, true rotation = `Exp(δ)·rotation`.
    pub covariance_rad2: Matrix3<f64>,
}

impl PredictedRotation {
    /// Prediction with the same standard deviation about every axis.
    pub fn isotropic(rotation: UnitQuaternion<f64>, sigma_rad: f64) -> Self {
        Self { rotation, rows: None, covariance_rad2: Matrix3::identity() * sigma_rad.powi(2) }
    }

    /// Converts a prediction between the first rows to one between the middle rows of a camera with this readout; the
    /// rates (rad/s, camera frame) are taken during the previous and the current image.
    #[must_use]
    pub fn with_readout(self, readout_s: f64, rates_rad_per_s: [Vector3<f64>; 2]) -> Self {
        if readout_s == 0.0 {
            return self;
        }
        let [previous_rad, now_rad] = rates_rad_per_s.map(|rate| rate * readout_s);
        let rotation = so3::exp(&(now_rad * -0.5)) * self.rotation * so3::exp(&(previous_rad * 0.5));
        Self { rotation, rows: Some(RowRotations { previous_rad, now_rad }), ..self }
    }

    /// Largest standard deviation over all axes, in radians.
    pub fn sigma_rad(&self) -> f64 {
        self.covariance_rad2.symmetric_eigenvalues().max().max(0.0).sqrt()
    }

    /// Inverse of the covariance (3 × 3, 1/rad²); zero for a singular one.
    pub(super) fn information(&self) -> Matrix3<f64> {
        let floor = Matrix3::identity() * MIN_SIGMA_RAD.powi(2);
        (self.covariance_rad2 + floor).try_inverse().unwrap_or_else(Matrix3::zeros)
    }
}

/// Rotation vectors of a rolling-shutter camera over the readout of two images, in the camera frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RowRotations {
    /// During the previous image.
    pub previous_rad: Vector3<f64>,
    /// During the current image.
    pub now_rad: Vector3<f64>,
}

impl RowRotations {
    /// Transforms a direction from the camera at a row (as a ratio of the image height) to the camera at the middle
    /// row.
    pub(super) fn to_middle(over_readout_rad: &Vector3<f64>, row: f64, bearing: &Vector3<f64>) -> Vector3<f64> {
        so3::exp(&(over_readout_rad * (row - 0.5))) * bearing
    }

    /// Transforms a direction from the camera at the middle row to the camera at a row.
    pub(super) fn from_middle(over_readout_rad: &Vector3<f64>, row: f64, bearing: &Vector3<f64>) -> Vector3<f64> {
        so3::exp(&(over_readout_rad * (0.5 - row))) * bearing
    }
}

/// Lower bound of a prediction's standard deviation: a tenth of a pixel or less.
const MIN_SIGMA_RAD: f64 = 2e-4;

/// Standard deviations, per axis, of the inputs of a predicted rotation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PredictionNoise {
    /// Gyroscope bias after correction, in rad/s.
    pub gyroscope_bias_rad_per_s: f64,
    /// Gyroscope noise density, in rad/s/√Hz.
    pub gyroscope_noise_density: f64,
    /// Rotation of each link of the chain, in radians.
    pub chain_rotation_rad: f64,
}

/// Orientations of base, joints, end effector and camera relative to the IMU at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct ChainOrientation {
    /// `imu_from_frame` of the base, of the frame after each joint, and of the camera: N + 2 rotations.
    imu_from_frame: Vec<UnitQuaternion<f64>>,
    /// Standard deviations of the joint angles, in radians.
    joint_sigmas_rad: Vec<f64>,
    /// Angular rates of the joints in rad/s; empty if unknown.
    joint_rates_rad_per_s: Vec<f64>,
}

impl ChainOrientation {
    /// Orientations of a chain at joint angles with their standard deviations; a chain without links is a rigid camera.
    ///
    /// # Panics
    /// If the number of angles or of standard deviations differs from the number of joints.
    pub fn new(chain: &ClassicalChain, joint_angles_rad: &[f64], joint_sigmas_rad: &[f64]) -> Self {
        assert_eq!(joint_sigmas_rad.len(), chain.joint_count(), "one standard deviation per joint");
        let frames = chain.frames_in_imu(joint_angles_rad);
        Self {
            imu_from_frame: frames.iter().map(|frame| frame.rotation).collect(),
            joint_sigmas_rad: joint_sigmas_rad.to_vec(),
            joint_rates_rad_per_s: Vec::new(),
        }
    }

    /// Adds the angular rates of the joints.
    #[must_use]
    pub fn with_joint_rates(self, joint_rates_rad_per_s: &[f64]) -> Self {
        Self { joint_rates_rad_per_s: joint_rates_rad_per_s.to_vec(), ..self }
    }

    /// Angular velocity of the camera in its own frame, in rad/s, for this angular velocity of the IMU.
    fn camera_rate(&self, imu_rad_per_s: &Vector3<f64>) -> Vector3<f64> {
        let joints = self.imu_from_frame.iter().zip(&self.joint_rates_rad_per_s);
        let of_joints: Vector3<f64> = joints.map(|(frame, rate)| frame * (Vector3::z() * *rate)).sum();
        self.imu_from_camera().inverse() * (imu_rad_per_s + of_joints)
    }

    fn imu_from_camera(&self) -> UnitQuaternion<f64> {
        self.imu_from_frame.last().copied().unwrap_or_else(UnitQuaternion::identity)
    }

    /// Rotation vector of the camera due to an error of one standard deviation in each joint, in the camera frame, in
    /// radians.
    fn joint_errors_in_camera(&self) -> impl Iterator<Item = Vector3<f64>> {
        let camera_from_imu = self.imu_from_camera().inverse();
        // Each joint rotates about the z axis of the frame before it.
        let joints = self.imu_from_frame.iter().zip(&self.joint_sigmas_rad);
        joints.map(move |(frame, sigma_rad)| camera_from_imu * (frame * (Vector3::z() * *sigma_rad)))
    }
}

/// Predicts the rotation of a camera between two images, from the gyroscope and the orientation on the IMU at both
/// images.
///
/// `imu` goes from the previous image's stamp to the current one's (see `SensorFrame::imu` of the flight log); the
/// angular velocity is interpolated linearly.
/// `gyroscope_bias_rad_per_s` is subtracted; zero if unknown.
/// The covariance consists of gyroscope bias and noise, joint angles at both images, and the error of the chain, of
/// which only the change between the images counts: `Rᵀ_now·(G·F_previous − F_now)` for a frame `F` of the chain and
/// the rotation `G` of the IMU.
/// Returns `None` with fewer than two samples, if stamps do not increase, or if a value is not finite.
pub fn predict_camera_rotation(
    imu: &[ImuSample],
    gyroscope_bias_rad_per_s: &Vector3<f64>,
    previous: &ChainOrientation,
    now: &ChainOrientation,
    noise: &PredictionNoise,
) -> Option<PredictedRotation> {
    let (first, last) = (imu.first()?, imu.last()?);
    if imu.len() < 2 || !imu.is_sorted_by_key(|sample| sample.stamp_ns) {
        return None;
    }
    let mut imu_previous_from_imu_now = UnitQuaternion::identity();
    for step in rotation_steps(imu, gyroscope_bias_rad_per_s) {
        if !step.iter().all(|value| value.is_finite()) {
            return None;
        }
        imu_previous_from_imu_now *= so3::exp(&step);
    }
    let imu_now_from_imu_previous = imu_previous_from_imu_now.inverse();
    let camera_now_from_imu = now.imu_from_camera().inverse();
    let rotation = camera_now_from_imu * imu_now_from_imu_previous * previous.imu_from_camera();

    let interval_s = seconds_from_ns(last.stamp_ns - first.stamp_ns);
    let gyroscope =
        (noise.gyroscope_bias_rad_per_s * interval_s).powi(2) + noise.gyroscope_noise_density.powi(2) * interval_s;
    let mut covariance_rad2 = Matrix3::identity() * gyroscope;
    let of_previous = previous.joint_errors_in_camera().map(|error| rotation * error);
    for error in now.joint_errors_in_camera().chain(of_previous) {
        covariance_rad2 += error * error.transpose();
    }
    let imu_rotation = imu_now_from_imu_previous.to_rotation_matrix().into_inner();
    let camera_from_imu = camera_now_from_imu.to_rotation_matrix().into_inner();
    for (before, after) in previous.imu_from_frame.iter().zip(&now.imu_from_frame) {
        let before = before.to_rotation_matrix().into_inner();
        let by_error = camera_from_imu * (imu_rotation * before - after.to_rotation_matrix().into_inner());
        covariance_rad2 += by_error * by_error.transpose() * noise.chain_rotation_rad.powi(2);
    }
    let finite = rotation.coords.iter().chain(covariance_rad2.iter()).all(|value| value.is_finite());
    finite.then_some(PredictedRotation { rotation, rows: None, covariance_rad2 })
}

/// Angular velocities of the camera in its own frame (rad/s) during the readout of the previous and the current image,
/// for [`PredictedRotation::with_readout`]: the mean of the gyroscope over `readout_s` after the previous stamp and
/// before the current one (the rows of the current image come after the samples), with the rates of the joints.
/// Arguments as in [`predict_camera_rotation`].
pub fn camera_rates(
    imu: &[ImuSample],
    gyroscope_bias_rad_per_s: &Vector3<f64>,
    previous: &ChainOrientation,
    now: &ChainOrientation,
    readout_s: f64,
) -> [Vector3<f64>; 2] {
    let reach_ns = ns_from_seconds(readout_s.abs());
    let mean = |from_ns: i64, to_ns: i64| {
        let near = imu.iter().filter(|sample| (from_ns..=to_ns).contains(&sample.stamp_ns));
        let (sum, count) = near.fold((Vector3::zeros(), 0.0), |(sum, count), sample| {
            (sum + sample.angular_velocity_rad_per_s, count + 1.0)
        });
        if count > 0.0 { sum / count - gyroscope_bias_rad_per_s } else { Vector3::zeros() }
    };
    let (Some(first), Some(last)) = (imu.first(), imu.last()) else { return [Vector3::zeros(); 2] };
    let rates = [
        previous.camera_rate(&mean(first.stamp_ns, first.stamp_ns + reach_ns)),
        now.camera_rate(&mean(last.stamp_ns - reach_ns, last.stamp_ns)),
    ];
    rates.map(|rate| if rate.iter().all(|value| value.is_finite()) { rate } else { Vector3::zeros() })
}
