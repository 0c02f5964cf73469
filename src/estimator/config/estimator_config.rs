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
    /// Key of the main camera in the rig.
    pub key: String,
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
    /// Cameras in addition to the main one.
    pub further_cameras: Vec<FurtherCamera>,
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

/// Camera in addition to the main one, rigidly mounted on the IMU or on another camera of the run.
#[derive(Clone, Debug)]
pub struct FurtherCamera {
    /// Key of the camera in the rig, used in parameter names: `cam1`.
    pub key: String,
    /// [`Rig::camera_number`], which its parameters have.
    pub number: u8,
    pub model: CameraModel,
    /// Camera that it is mounted on, by its index in the run: the main one on a gimbal, the first one of a stereo pair.
    /// `None` for a rigid camera whose pose is known relative to the IMU.
    pub base: Option<usize>,
    /// Pose of the rig relative to its base, else to the IMU.
    pub base_from_camera: RigidTransform,
    /// True if features of its base are matched in its images: a stereo pair.
    pub is_matched: bool,
    /// Prior standard deviations of that pose, in metres and radians.
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

/// Parameters and values of the six extrinsics columns of a further camera with this number: rotation vector and
/// translation of its pose.
pub fn pose_columns(number: u8, base_from_camera: &RigidTransform) -> Vec<(ParameterId, f64)> {
    let chain = Chain::from_classical(&rigid_chain(base_from_camera), Parameterization::Minimal);
    let parameters = chain.parameters().into_iter().map(|parameter| parameter.of_camera(number));
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

/// Chain without joints: the pose of a camera that is mounted rigidly.
pub(crate) fn rigid_chain(base_from_camera: &RigidTransform) -> ClassicalChain {
    ClassicalChain { imu_from_base: *base_from_camera, ..ClassicalChain::default() }
}

/// Default standard deviations of a calibration of unstated accuracy: 5 mm and 0.5°.
pub const DEFAULT_CHAIN_PRIOR: (f64, f64) = (0.005, 0.0087);

impl FurtherCamera {
    /// Camera of a run with the `others` before it, the main one first; `None` for a camera on a gimbal without another one
    /// of that gimbal in the run.
    pub fn of_rig(rig: &Rig, others: &[&CameraRig], camera: &CameraRig) -> Option<Self> {
        let of_base = |one: &CameraRig| rig.base_of(one).map_or_else(|| one.key.clone(), |base| base.key.clone());
        let is_beside = |other: &&&CameraRig| other.is_on_gimbal() == camera.is_on_gimbal();
        let base = camera.relative_prior.and_then(|prior| {
            let other = others.iter().position(|other| is_beside(&other) && of_base(other) == of_base(camera));
            Some((other?, prior))
        });
        let (base, prior) = base.unzip();
        Some(Self {
            key: camera.key.clone(),
            number: rig.camera_number(&camera.key),
            model: camera.model.clone(),
            base,
            base_from_camera: rig.base_from_camera(base.map(|base| others[base].key.as_str()), &camera.key)?,
            is_matched: base
                .is_some_and(|base| rig.stereo_partner(others[base]).is_some_and(|partner| partner.key == camera.key)),
            prior: prior.unwrap_or_else(|| rig.extrinsics_prior(camera)).sigmas(),
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
            key: camera.key.clone(),
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
            // Its pose is relative to the first camera on the gimbal.
            gimbal_imu: gimbal.filter(|_| camera.relative_prior.is_none()).and_then(|_| rig.gimbal_imu.clone()),
            estimate_gimbal_imu: false,
            sensor: CameraSensorPrior::of_rig(camera),
            timeshift_s: camera.timeshift_cam_imu_s,
            further_cameras: Vec::new(),
            frame_camera: None,
            calibration_prior: None,
            earlier_pass: None,
            options: EstimatorOptions::default(),
            clock_ms: || 0.0,
        })
    }

    /// Model of a camera by its number, the main one first.
    pub(crate) fn model(&self, camera: usize) -> &CameraModel {
        camera.checked_sub(1).map_or(&self.camera, |rigid| &self.further_cameras[rigid].model)
    }

    /// Shutter of a camera by its number, and how well its intrinsics are known.
    pub(crate) fn sensor(&self, camera: usize) -> CameraSensorPrior {
        camera.checked_sub(1).map_or(self.sensor, |rigid| self.further_cameras[rigid].sensor)
    }

    /// Prior standard deviations of a camera's extrinsics, in metres and radians.
    pub(crate) fn extrinsics_sigmas(&self, camera: usize) -> (f64, f64) {
        let main = self.chain_prior.unwrap_or(DEFAULT_CHAIN_PRIOR);
        camera.checked_sub(1).map_or(main, |rigid| self.further_cameras[rigid].prior)
    }

    /// Other camera of the stereo pair of a camera, by its number; `None` without one. Both images have as many blocks, and
    /// the intrinsics are fixed.
    pub fn partner(&self, camera: usize) -> Option<usize> {
        let is_rolling = |camera: usize| self.sensor(camera).readout_s != 0.0;
        let is_partner = |further: &FurtherCamera| further.is_matched && further.base == Some(camera);
        let partner = self.further_cameras.iter().position(is_partner)? + 1;
        let same_shutter = self.estimate_readout || is_rolling(camera) == is_rolling(partner);
        (same_shutter && !self.estimate_intrinsics).then_some(partner)
    }

    /// Standard deviation of an encoder reading in radians, `None` if encoders are absent or unused.
    pub fn encoder_in_use(&self) -> Option<f64> {
        self.encoder_sigma_rad.filter(|_| self.use_encoder)
    }
}
