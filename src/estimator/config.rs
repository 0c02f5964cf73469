//! What an estimator is made from.

use super::options::EstimatorOptions;
use crate::camera::CameraModel;
use crate::geometry::RigidTransform;
use crate::gimbal::{Chain, ClassicalChain, ParameterId, Parameterization};
use crate::sensors::{CameraMount, CameraRig, ImuNoise, Rig, UnknownCamera};

/// Configuration of an estimator: sensors, calibration as given, options.
#[derive(Clone, Debug)]
pub struct EstimatorConfig {
    /// The camera that it watches.
    pub camera: CameraModel,
    /// Noise of the IMU.
    pub imu_noise: ImuNoise,
    /// Magnitude of gravity in m/s².
    pub gravity_m_per_s2: f64,
    /// The mount as given; without links a rigid camera.
    pub chain: ClassicalChain,
    /// The form in which the mount is estimated.
    pub parameterization: Parameterization,
    /// Whether the minimal parameterization may switch to another one near a singularity.
    pub auto_parameterize: bool,
    /// Standard deviation of an encoder reading, `None` without encoders.
    pub encoder_sigma_rad: Option<f64>,
    /// Whether encoder readings are used.
    pub use_encoder: bool,
    /// Whether the mount's static parameters are estimated; joint angles always are.
    pub calibrate: bool,
    /// Standard deviations of the given chain's numbers, in metres and radians; `None` for [`DEFAULT_CHAIN_PRIOR`].
    pub chain_prior: Option<(f64, f64)>,
    /// Whether the offsets of the clocks of cameras and encoders against the IMU's are estimated as well; only
    /// together with `calibrate`.
    pub estimate_timeshift: bool,
    /// What the rig says about `camera`'s offset, in seconds (`t_imu = t_cam + shift`): stamps have it in them already.
    pub timeshift_s: f64,
    /// Rigid cameras that are watched beside `camera`.
    pub rigid_cameras: Vec<RigidCamera>,
    /// Tunables.
    pub options: EstimatorOptions,
    /// Milliseconds of a clock that only runs forward, for the stage times of the reports.
    pub clock_ms: fn() -> f64,
}

/// A rigid camera that is watched beside the main one.
#[derive(Clone, Debug)]
pub struct RigidCamera {
    /// What its columns are called by: its key in the rig, `cam1`.
    pub key: String,
    /// Its model.
    pub model: CameraModel,
    /// Its pose on the IMU as given.
    pub imu_from_camera: RigidTransform,
    /// Standard deviations of that pose's numbers, in metres and radians.
    pub prior: (f64, f64),
    /// What the rig says about the offset of its clock, in seconds.
    pub timeshift_s: f64,
}

/// Parameters and values of the six columns of a rigid camera that is watched beside the main one, by the camera's number:
/// rotation vector and translation of its pose on the IMU.
pub fn rigid_columns(camera: u8, imu_from_camera: &RigidTransform) -> Vec<(ParameterId, f64)> {
    let chain = Chain::from_classical(&rigid_chain(imu_from_camera), Parameterization::Minimal);
    let parameters = chain.parameters().into_iter().map(|parameter| parameter.of_camera(camera));
    parameters.zip(chain.values().iter().copied()).collect()
}

/// A mount without joints.
pub(super) fn rigid_chain(imu_from_camera: &RigidTransform) -> ClassicalChain {
    ClassicalChain { imu_from_base: *imu_from_camera, ..ClassicalChain::default() }
}

/// What a calibration that says nothing about its quality is taken to be worth, per number: 5 mm and 0.5°.
pub const DEFAULT_CHAIN_PRIOR: (f64, f64) = (0.005, 0.0087);

impl RigidCamera {
    /// A rigid camera of a rig; `None` for a camera on the gimbal.
    pub fn of_rig(rig: &Rig, camera: &CameraRig) -> Option<Self> {
        let CameraMount::Static { imu_from_camera } = &camera.mount else { return None };
        Some(Self {
            key: camera.key.clone(),
            model: camera.model.clone(),
            imu_from_camera: *imu_from_camera,
            prior: rig.extrinsics_prior(camera).sigmas(),
            timeshift_s: camera.timeshift_cam_imu_s,
        })
    }
}

impl EstimatorConfig {
    /// Configuration for one camera of a rig (`cam0`), estimated alone: encoders are used where the rig has them, the
    /// calibration is estimated from the rig's prior, clocks are not; default options, no clock for the stage times.
    ///
    /// # Errors
    /// When the rig has no camera with this key.
    pub fn for_camera(rig: &Rig, camera_key: &str, parameterization: Parameterization) -> Result<Self, UnknownCamera> {
        let camera = rig.camera(camera_key)?;
        let gimbal = rig.gimbal.as_ref().filter(|_| camera.mount == CameraMount::Gimbal);
        // Without a topic there are no readings, whatever their noise would be.
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
            timeshift_s: camera.timeshift_cam_imu_s,
            rigid_cameras: Vec::new(),
            options: EstimatorOptions::default(),
            clock_ms: || 0.0,
        })
    }

    /// Model of a camera by its number, the main one's first.
    pub(super) fn model(&self, camera: usize) -> &CameraModel {
        camera.checked_sub(1).map_or(&self.camera, |rigid| &self.rigid_cameras[rigid].model)
    }

    /// Standard deviations of the numbers of a camera's mount as given, in metres and radians.
    pub(super) fn extrinsics_sigmas(&self, camera: usize) -> (f64, f64) {
        let main = self.chain_prior.unwrap_or(DEFAULT_CHAIN_PRIOR);
        camera.checked_sub(1).map_or(main, |rigid| self.rigid_cameras[rigid].prior)
    }

    /// Whether encoder readings with a known noise are there to be used.
    pub(super) fn encoder_in_use(&self) -> Option<f64> {
        self.encoder_sigma_rad.filter(|_| self.use_encoder)
    }
}
