//! The rig: which sensors a log holds and where they are mounted, in Kalibr's names.

use crate::camera::CameraModel;
use crate::geometry::RigidTransform;
use crate::gimbal::{ClassicalChain, InverseChain, ParameterNames};

use super::{AttitudeFrame, AttitudeSource, ImageMask, ImuIntrinsics, ImuNoise, LeverArm};

/// The rig has no camera with this key.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the rig has no camera '{key}'; it has {}", quoted(available))]
pub struct UnknownCamera {
    /// What was asked for.
    pub key: String,
    /// The keys that the rig has.
    pub available: Vec<String>,
}

fn quoted(keys: &[String]) -> String {
    if keys.is_empty() {
        return "none".to_owned();
    }
    keys.iter().map(|key| format!("'{key}'")).collect::<Vec<_>>().join(", ")
}

/// The IMU with its noise densities.
#[derive(Clone, Debug, PartialEq)]
pub struct ImuRig {
    /// Topic of its `sensor_msgs/msg/Imu`; only the angular velocities are read of it when the accelerometer is apart.
    pub topic: String,
    /// Topic of the specific forces (`sensor_msgs/msg/Imu`), when they are apart from the angular velocities.
    pub accelerometer_topic: Option<String>,
    /// Frame name.
    pub frame_id: String,
    /// Nominal rate.
    pub rate_hz: f64,
    /// Noise densities.
    pub noise: ImuNoise,
    /// Scale and misalignment, the identity when nothing is known of them.
    pub intrinsics: ImuIntrinsics,
}

/// How a camera is carried.
#[derive(Clone, Debug, PartialEq)]
pub enum CameraMount {
    /// At the end of the rig's gimbal.
    Gimbal,
    /// Rigidly, at this pose (the inverse of Kalibr's `T_cam_imu`).
    Static {
        /// Maps points from the camera to the IMU.
        imu_from_camera: RigidTransform,
    },
}

/// One camera.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraRig {
    /// Key in the rig file, `cam0`, `cam1`, ….
    pub key: String,
    /// How it is carried.
    pub mount: CameraMount,
    /// Topic of its images.
    pub topic: String,
    /// Frame name.
    pub frame_id: String,
    /// Nominal rate.
    pub rate_hz: f64,
    /// Projection model with its resolution.
    pub model: CameraModel,
    /// Kalibr's `timeshift_cam_imu`: `t_imu = t_cam + shift`.
    pub timeshift_cam_imu_s: f64,
    /// Time from the exposure of the first row to that of a row behind the last one: 0 for a global shutter, negative where
    /// rows are read upwards.
    pub readout_s: f64,
    /// Standard deviation of `readout_s`, `None` when nobody has measured it.
    pub readout_sigma_s: Option<f64>,
    /// How wrong the intrinsics of `model` may be, `None` when the rig does not say.
    pub intrinsics_sigma: Option<IntrinsicsSigma>,
    /// Pixels that show the vehicle, `None` without.
    pub mask: Option<CameraMask>,
}

/// Standard deviations of a camera's intrinsics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IntrinsicsSigma {
    /// Of each focal length, as a ratio of it.
    pub focal_ratio: f64,
    /// Of each coordinate of the principal point.
    pub centre_px: f64,
    /// Of each distortion coefficient.
    pub distortion: f64,
}

impl CameraRig {
    /// Time in seconds from an image's stamp to the exposure of a row (0 is the centre of the first one), in the camera's
    /// clock: `row / height · readout`.
    pub fn row_time_s(&self, row_px: f64) -> f64 {
        row_px / self.model.resolution_px[1] as f64 * self.readout_s
    }
}

/// The mask of a camera with the file that it came from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CameraMask {
    /// Name of the PNG, relative to the folder of the rig; the same name as an attachment of a log.
    pub file: String,
    /// The mask, of the size of the images.
    pub image: ImageMask,
}

/// How wrong the rig's chain may be: bounds of a uniform error on each parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChainPrior {
    /// Bound on every translation, in metres.
    pub translation_bound_m: f64,
    /// Bound on every angle, in radians.
    pub rotation_bound_rad: f64,
}

impl ChainPrior {
    /// Prior on a rigid camera's extrinsics when the rig has none: calibrations with a target are better than this.
    const RIGID_CAMERA: Self = Self { translation_bound_m: 0.01, rotation_bound_rad: 0.0175 };

    /// Standard deviations of the uniform errors, `bound / √3`: of every translation in metres and of every angle in
    /// radians.
    pub fn sigmas(self) -> (f64, f64) {
        const SIGMA_PER_BOUND: f64 = 0.577_350_269_189_625_8;
        (self.translation_bound_m * SIGMA_PER_BOUND, self.rotation_bound_rad * SIGMA_PER_BOUND)
    }
}

/// One joint's name and range.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Name in the `JointState` messages.
    pub name: String,
    /// Lower and upper stop, in radians.
    pub limits_rad: (f64, f64),
}

/// The gimbal.
#[derive(Clone, Debug, PartialEq)]
pub struct GimbalRig {
    /// Topic of its `sensor_msgs/msg/JointState` or of its attitude, `None` when there is neither.
    pub topic: Option<String>,
    /// What the topic's messages mean when they are attitudes, `None` for joint angles.
    pub attitude: Option<AttitudeSource>,
    /// `timeshift_gimbal_imu`: `t_imu = t_gimbal + shift`, for the stamps of `topic`.
    pub timeshift_gimbal_imu_s: f64,
    /// Nominal rate.
    pub rate_hz: f64,
    /// Standard deviation of a reading, `None` without encoders.
    pub encoder_sigma_rad: Option<f64>,
    /// How wrong `chain` may be.
    pub prior: ChainPrior,
    /// Whether runs in a minimal parameterization switch to another one near a singularity (`parameterization: auto`).
    pub switches_parameterization: bool,
    /// The chain in the classical form (Eqs. 5–6), links in order.
    pub chain: ClassicalChain,
    /// The joints, one per link of `chain`.
    pub joints: Vec<Joint>,
}

impl GimbalRig {
    /// The inverse of the chain by which joint angles follow from an attitude; `None` unless the rig names one and has one to
    /// three joints.
    pub fn inverse_chain(&self) -> Option<InverseChain> {
        let source = self.attitude.as_ref()?;
        let limits: Vec<(f64, f64)> = self.joints.iter().map(|joint| joint.limits_rad).collect();
        let chain = source.chain.as_deref().unwrap_or(&self.chain);
        Some(InverseChain::new(chain, &limits)?.with_first_joint_offset(source.first_joint_offset_rad))
    }

    /// Takes a calibrated chain; joint angles go on to follow from an attitude as before.
    pub fn set_chain(&mut self, chain: ClassicalChain) {
        let before = std::mem::replace(&mut self.chain, chain);
        if let Some(source) = &mut self.attitude {
            source.chain.get_or_insert_with(|| Box::new(before));
        }
    }
}

/// A field of the rig whose value is only assumed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AssumedField {
    /// Its path in the rig file, as in `gimbal.T_I_B`.
    pub field: String,
    /// What is assumed, as one sentence without a full stop.
    pub reason: String,
}

/// A whole rig.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    /// Its name.
    pub name: String,
    /// Magnitude of gravity in m/s².
    pub gravity_m_per_s2: f64,
    /// The IMU with its noise densities.
    pub imu: ImuRig,
    /// Cameras in the order of their keys.
    pub cameras: Vec<CameraRig>,
    /// The gimbal, when there is one.
    pub gimbal: Option<GimbalRig>,
    /// Topic of the true pose of the IMU in the world, or of the true position of an antenna.
    pub ground_truth_topic: Option<String>,
    /// Where that antenna is, `None` when the rig does not say.
    pub ground_truth_lever_arm: Option<LeverArm>,
    /// Fields that nobody has measured yet.
    pub assumed: Vec<AssumedField>,
}

impl Rig {
    /// The camera with a key such as `cam0`.
    pub fn camera(&self, key: &str) -> Result<&CameraRig, UnknownCamera> {
        self.cameras.iter().find(|camera| camera.key == key).ok_or_else(|| UnknownCamera {
            key: key.to_owned(),
            available: self.cameras.iter().map(|camera| camera.key.clone()).collect(),
        })
    }

    /// Topic of the vehicle's attitude, when the gimbal's is relative to another frame than the body.
    pub fn vehicle_topic(&self) -> Option<&str> {
        let source = self.gimbal.as_ref()?.attitude.as_ref()?;
        source.vehicle_topic.as_deref().filter(|_| source.frame != AttitudeFrame::Body)
    }

    /// Names of the gimbal's joints, from the base on; none without a gimbal.
    pub fn joint_names(&self) -> Vec<String> {
        self.gimbal.iter().flat_map(|gimbal| &gimbal.joints).map(|joint| joint.name.clone()).collect()
    }

    /// What calibration parameters are called: links by the joints, rigid cameras beside a gimballed one by their keys.
    pub fn parameter_names(&self) -> ParameterNames {
        let rigid = self.cameras.iter().filter(|camera| camera.mount != CameraMount::Gimbal);
        ParameterNames { joints: self.joint_names(), cameras: rigid.map(|camera| camera.key.clone()).collect() }
    }

    /// The chain that carries the camera with a key: the gimbal's, or one without links for a rigid camera. `None` for an
    /// unknown key, or for a camera on a gimbal that the rig does not describe.
    pub fn chain_of_camera(&self, key: &str) -> Option<ClassicalChain> {
        let camera = self.cameras.iter().find(|camera| camera.key == key)?;
        match &camera.mount {
            CameraMount::Gimbal => self.gimbal.as_ref().map(|gimbal| gimbal.chain.clone()),
            CameraMount::Static { imu_from_camera } => {
                Some(ClassicalChain { imu_from_base: *imu_from_camera, ..ClassicalChain::default() })
            }
        }
    }

    /// How wrong the rig's extrinsics of one of its cameras may be.
    pub fn extrinsics_prior(&self, camera: &CameraRig) -> ChainPrior {
        match (&self.gimbal, &camera.mount) {
            (Some(gimbal), CameraMount::Gimbal) => gimbal.prior,
            // The rigid camera of a gimbal rig was calibrated with the same care as the gimbal, but never worse than a
            // rigid camera usually is.
            (Some(gimbal), CameraMount::Static { .. }) => ChainPrior {
                translation_bound_m: gimbal.prior.translation_bound_m.min(ChainPrior::RIGID_CAMERA.translation_bound_m),
                rotation_bound_rad: gimbal.prior.rotation_bound_rad.min(ChainPrior::RIGID_CAMERA.rotation_bound_rad),
            },
            (None, _) => ChainPrior::RIGID_CAMERA,
        }
    }
}
