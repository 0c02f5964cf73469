//! Configuration of an estimator.

use std::sync::Arc;

use super::EstimatorOptions;
use crate::camera::CameraModel;
use crate::estimator::state::calibration_posterior::CalibrationPrior;
use crate::estimator::state::earlier_pass::EarlierPass;
use crate::estimator::state::imu_errors::{self, ImuErrors};
use crate::geometry::RigidTransform;
use crate::gimbal::{Chain, ClassicalChain, ParameterId, Parameterization};
use crate::sensors::{
    CameraMount, CameraRig, GimbalImuRig, ImuIntrinsics, ImuNoise, IntrinsicsSigma, Rig, UnknownCamera,
};

#[derive(Clone, Debug)]
pub struct EstimatorConfig {
    pub camera: CameraModel,
    pub imu_noise: ImuNoise,
    pub gravity_m_per_s2: f64,
    /// Given chain of the main camera; without links for a rigid camera.
    pub chain: ClassicalChain,
    /// Parameterization in which the chain is estimated.
    pub parameterization: Parameterization,
    /// True if the minimal parameterization may switch to another one near a singularity.
    pub auto_parameterize: bool,
    /// Standard deviation of an encoder reading, `None` without encoders.
    pub encoder_sigma_rad: Option<f64>,
    pub use_encoder: bool,
    /// Estimate the static calibration; joint angles are always estimated.
    pub calibrate: bool,
    /// Standard deviations of the given chain's parameters, in metres and radians; `None` for
    /// [`DEFAULT_CHAIN_PRIOR`].
    pub chain_prior: Option<(f64, f64)>,
    /// Estimate the time offsets of cameras and encoders relative to the IMU; requires `calibrate`.
    pub estimate_timeshift: bool,
    /// Estimate the readout times of the cameras' rolling shutters; requires `calibrate`.
    pub estimate_readout: bool,
    /// Estimate the intrinsics of the cameras; requires `calibrate`.
    pub estimate_intrinsics: bool,
    /// Estimate the intrinsics of the IMU; requires `calibrate`.
    pub estimate_imu_intrinsics: bool,
    /// Rig's intrinsics of the IMU; samples are already corrected by them.
    pub imu_intrinsics: ImuIntrinsics,
    /// IMU on the gimbal of the main camera, `None` without one or if it is not used.
    pub gimbal_imu: Option<GimbalImuRig>,
    /// Estimate orientation and time offset of the IMU on the gimbal; requires `calibrate`.
    pub estimate_gimbal_imu: bool,
    /// Shutter of the main camera, and the uncertainty of its intrinsics.
    pub sensor: CameraSensorPrior,
    /// Given time offset of the main camera, in seconds (`t_imu = t_cam + shift`); stamps already include it.
    pub timeshift_s: f64,
    /// Rigid cameras in addition to the main one.
    pub rigid_cameras: Vec<RigidCamera>,
    /// Camera at whose images the frames lie, the main one first, where images of other cameras are exposed between them;
    /// `None` if all images of a step have one stamp.
    pub frame_camera: Option<usize>,
    /// Calibrations of earlier flights: initial values and prior of the calibration, which replace the given chains.
    pub calibration_prior: Option<Arc<CalibrationPrior>>,
    /// Result of an earlier pass over the same measurements: initial values and prior of the calibration, which replace
    /// the given chains, and prior of the biases.
    pub earlier_pass: Option<Arc<EarlierPass>>,
    pub options: EstimatorOptions,
    /// Monotonic clock in milliseconds, for the stage times in the reports.
    pub clock_ms: fn() -> f64,
}

/// Rigid camera in addition to the main one.
#[derive(Clone, Debug)]
pub struct RigidCamera {
    /// Key of the camera in the rig, used in parameter names: `cam1`.
    pub key: String,
    pub model: CameraModel,
    /// Extrinsics of the rig, `imu_from_camera`.
    pub imu_from_camera: RigidTransform,
    /// Prior standard deviations of the extrinsics, in metres and radians.
    pub prior: (f64, f64),
    /// Given time offset, in seconds.
    pub timeshift_s: f64,
    /// Shutter, and the uncertainty of the intrinsics.
    pub sensor: CameraSensorPrior,
}

/// Shutter of a camera, with the uncertainty of shutter and intrinsics.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CameraSensorPrior {
    /// Time from the exposure of the first row to the end of the last one, in seconds; zero for a global shutter.
    pub readout_s: f64,
    /// Standard deviation of the readout time, `None` if the rig does not state it.
    pub readout_sigma_s: Option<f64>,
    /// Standard deviations of the intrinsics, `None` if the rig does not state them.
    pub intrinsics_sigma: Option<IntrinsicsSigma>,
}

impl CameraSensorPrior {
    /// Shutter and uncertainties of a camera of a rig.
    pub fn of_rig(camera: &CameraRig) -> Self {
        Self {
            readout_s: camera.readout_s,
            readout_sigma_s: camera.readout_sigma_s,
            intrinsics_sigma: camera.intrinsics_sigma,
        }
    }
}

/// Parameters and values of the six extrinsics columns of rigid camera `camera`: rotation vector and translation of
/// `imu_from_camera`.
pub fn rigid_columns(camera: u8, imu_from_camera: &RigidTransform) -> Vec<(ParameterId, f64)> {
    let chain = Chain::from_classical(&rigid_chain(imu_from_camera), Parameterization::Minimal);
    let parameters = chain.parameters().into_iter().map(|parameter| parameter.of_camera(camera));
    parameters.zip(chain.values().iter().copied()).collect()
}

/// Parameters and values of the 15 columns of IMU intrinsics, gyroscope first.
pub fn imu_columns(intrinsics: &ImuIntrinsics) -> Vec<(ParameterId, f64)> {
    imu_errors::parameters().into_iter().zip(imu_errors::of_intrinsics(intrinsics).iter().copied()).collect()
}

/// IMU intrinsics from values of [`imu_columns`]; missing columns are zero.
pub fn imu_intrinsics(columns: &[(ParameterId, f64)]) -> ImuIntrinsics {
    let value_of = |parameter| columns.iter().find(|(known, _)| *known == parameter).map_or(0.0, |(_, value)| *value);
    let values = ImuErrors::from_iterator(imu_errors::parameters().into_iter().map(value_of));
    imu_errors::intrinsics(&values)
}

/// Chain without joints: the extrinsics of a rigid camera.
pub(crate) fn rigid_chain(imu_from_camera: &RigidTransform) -> ClassicalChain {
    ClassicalChain { imu_from_base: *imu_from_camera, ..ClassicalChain::default() }
}

/// Default standard deviations of a calibration of unstated accuracy: 5 mm and 0.5°.
pub const DEFAULT_CHAIN_PRIOR: (f64, f64) = (0.005, 0.0087);

impl RigidCamera {
    /// Rigid camera of a rig; `None` for a camera on the gimbal.
    pub fn of_rig(rig: &Rig, camera: &CameraRig) -> Option<Self> {
        let CameraMount::Static { imu_from_camera } = &camera.mount else { return None };
        Some(Self {
            key: camera.key.clone(),
            model: camera.model.clone(),
            imu_from_camera: *imu_from_camera,
            prior: rig.extrinsics_prior(camera).sigmas(),
            timeshift_s: camera.timeshift_cam_imu_s,
            sensor: CameraSensorPrior::of_rig(camera),
        })
    }
}

impl EstimatorConfig {
    /// Configuration for a single camera of a rig (`cam0`): encoders are used if the rig has them, the calibration
    /// is estimated from the rig's prior, time offsets are fixed; default options, no clock for stage times.
    ///
    /// # Errors
    ///
    /// If the rig has no camera with this key.
    pub fn for_camera(rig: &Rig, camera_key: &str, parameterization: Parameterization) -> Result<Self, UnknownCamera> {
        let camera = rig.camera(camera_key)?;
        let gimbal = rig.gimbal.as_ref().filter(|_| camera.mount == CameraMount::Gimbal);
        // Without a topic there are no readings, even if their noise is given.
        let encoder_sigma_rad = gimbal.filter(|gimbal| gimbal.topic.is_some()).and_then(|it| it.encoder_sigma_rad);
        Ok(Self {
            camera: camera.model.clone(),
            imu_noise: rig.imu.noise,
            gravity_m_per_s2: rig.gravity_m_per_s2,
            chain: rig.chain_of_camera(camera_key).unwrap_or_default(),
            parameterization,
            auto_parameterize: false,
            encoder_sigma_rad,
            use_encoder: encoder_sigma_rad.is_some(),
            calibrate: true,
            chain_prior: Some(rig.extrinsics_prior(camera).sigmas()),
            estimate_timeshift: false,
            estimate_readout: false,
            estimate_intrinsics: false,
            estimate_imu_intrinsics: false,
            imu_intrinsics: rig.imu.intrinsics,
            gimbal_imu: gimbal.and_then(|_| rig.gimbal_imu.clone()),
            estimate_gimbal_imu: false,
            sensor: CameraSensorPrior::of_rig(camera),
            timeshift_s: camera.timeshift_cam_imu_s,
            rigid_cameras: Vec::new(),
            frame_camera: None,
            calibration_prior: None,
            earlier_pass: None,
            options: EstimatorOptions::default(),
            clock_ms: || 0.0,
        })
    }

    /// Model of a camera by its number, the main one first.
    pub(crate) fn model(&self, camera: usize) -> &CameraModel {
        camera.checked_sub(1).map_or(&self.camera, |rigid| &self.rigid_cameras[rigid].model)
    }

    /// Shutter of a camera by its number, and how well its intrinsics are known.
    pub(crate) fn sensor(&self, camera: usize) -> CameraSensorPrior {
        camera.checked_sub(1).map_or(self.sensor, |rigid| self.rigid_cameras[rigid].sensor)
    }

    /// Prior standard deviations of a camera's extrinsics, in metres and radians.
    pub(crate) fn extrinsics_sigmas(&self, camera: usize) -> (f64, f64) {
        let main = self.chain_prior.unwrap_or(DEFAULT_CHAIN_PRIOR);
        camera.checked_sub(1).map_or(main, |rigid| self.rigid_cameras[rigid].prior)
    }

    /// Standard deviation of an encoder reading in radians, `None` if encoders are absent or unused.
    pub(crate) fn encoder_in_use(&self) -> Option<f64> {
        self.encoder_sigma_rad.filter(|_| self.use_encoder)
    }
}
