//! Rig: sensors of a log and their calibration, with Kalibr's names.

use nalgebra::UnitQuaternion;

use super::{AttitudeFrame, AttitudeSource, ImageMask, ImuIntrinsics, ImuNoise, LeverArm, RequiredAccuracy};
use crate::camera::CameraModel;
use crate::geometry::RigidTransform;
use crate::gimbal::{ClassicalChain, InverseChain, ParameterNames, Quantity};

/// Error: the rig has no camera with this key.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the rig has no camera '{key}'; it has {}", quoted(available))]
pub struct UnknownCamera {
    pub key: String,
    /// Keys of the rig's cameras.
    pub available: Vec<String>,
}

fn quoted(keys: &[String]) -> String {
    if keys.is_empty() {
        return "none".to_owned();
    }
    keys.iter().map(|key| format!("'{key}'")).collect::<Vec<_>>().join(", ")
}

#[derive(Clone, Debug, PartialEq)]
pub struct ImuRig {
    /// Topic of `sensor_msgs/msg/Imu`; only its angular velocities are read if `accelerometer_topic` is given.
    pub topic: String,
    /// Topic of the specific forces (`sensor_msgs/msg/Imu`), if they are recorded separately from the angular
    /// velocities.
    pub accelerometer_topic: Option<String>,
    /// True if the log times of the messages replace their header stamps, which were never set.
    pub use_log_time: bool,
    pub frame_id: String,
    pub rate_hz: f64,
    pub noise: ImuNoise,
    /// Scale and misalignment, the identity if they are not given.
    pub intrinsics: ImuIntrinsics,
}

impl ImuRig {
    /// True for the topics of its angular velocities and of its specific forces.
    pub fn reads(&self, topic: &str) -> bool {
        self.topic == topic || self.accelerometer_topic.as_deref() == Some(topic)
    }
}

/// IMU on the gimbal, rigidly attached to the camera there.
#[derive(Clone, Debug, PartialEq)]
pub struct GimbalImuRig {
    /// Topic, rate and noise, as of the vehicle's IMU.
    pub sensor: ImuRig,
    /// `camera_from_imu1` (`T_cam_imu`): axes and position of this IMU in the frame of the gimbal's camera.
    pub camera_from_imu: RigidTransform,
    /// `timeshift_imu1_imu`: `t_imu = t_imu1 + shift`, in seconds.
    pub timeshift_s: f64,
}

/// Extrinsics of a camera: rigid, or by the gimbal.
#[derive(Clone, Debug, PartialEq)]
pub enum CameraMount {
    Gimbal,
    /// Rigid, at this pose (the inverse of Kalibr's `T_cam_imu`).
    Static {
        imu_from_camera: RigidTransform,
    },
}

#[derive(Clone, Debug, PartialEq)]
pub struct CameraRig {
    /// Key in the rig file, `cam0`, `cam1`, ….
    pub key: String,
    pub mount: CameraMount,
    /// Pose in the frame of the first camera on the gimbal; the identity for that one and for rigid cameras.
    pub first_from_camera: RigidTransform,
    /// Prior of the pose relative to the camera before it with the same mount (Kalibr's `T_cn_cnm1`), which is known better
    /// than the pose of either relative to the IMU: of a stereo pair, or of cameras on one gimbal. `None` if the pose is
    /// only known relative to the IMU.
    pub relative_prior: Option<ChainPrior>,
    pub topic: String,
    /// True if the log times of the images replace their header stamps, which were never set.
    pub use_log_time: bool,
    pub frame_id: String,
    pub rate_hz: f64,
    pub model: CameraModel,
    /// Kalibr's `timeshift_cam_imu`: `t_imu = t_cam + shift`.
    pub timeshift_cam_imu_s: f64,
    /// Time from the exposure of the first row to the exposure of a row after the last one: 0 for a global shutter,
    /// negative if rows are read upwards.
    pub readout_s: f64,
    /// Standard deviation of `readout_s`, `None` if it has not been measured.
    pub readout_sigma_s: Option<f64>,
    /// Standard deviations of the intrinsics of `model`, `None` if the rig does not give them.
    pub intrinsics_sigma: Option<IntrinsicsSigma>,
    /// Mask of the pixels that show the vehicle.
    pub mask: Option<CameraMask>,
}

/// Standard deviations of a camera's intrinsics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IntrinsicsSigma {
    /// Of each focal length, relative to the focal length.
    pub focal_ratio: f64,
    /// Of each coordinate of the principal point.
    pub centre_px: f64,
    /// Of each distortion coefficient.
    pub distortion: f64,
}

impl CameraRig {
    pub fn is_on_gimbal(&self) -> bool {
        self.mount == CameraMount::Gimbal
    }

    /// Pose of this camera in a frame in which the first camera with its mount has a pose.
    pub fn beside(&self, first: RigidTransform) -> RigidTransform {
        match self.relative_prior {
            None => first,
            Some(_) => first * self.first_from_camera,
        }
    }

    /// Time in seconds from an image's stamp to the exposure of a row (0 is the centre of the first one), in camera
    /// time: `row / height · readout`.
    pub fn row_time_s(&self, row_px: f64) -> f64 {
        row_px / self.model.resolution_px[1] as f64 * self.readout_s
    }
}

/// Mask of a camera, with the name of its file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CameraMask {
    /// Name of the PNG, relative to the folder of the rig; also the name of the attachment in a log.
    pub file: String,
    /// Mask with the size of the camera's images.
    pub image: ImageMask,
}

/// Prior of the rig's chain: bounds of a uniform error on each parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChainPrior {
    /// Bound on every translation, in metres.
    pub translation_bound_m: f64,
    /// Bound on every angle, in radians.
    pub rotation_bound_rad: f64,
}

impl ChainPrior {
    /// Prior on the pose of a camera relative to the one before it: both were calibrated with the same images.
    pub const RELATIVE: Self = Self { translation_bound_m: 0.001, rotation_bound_rad: 0.00175 };

    /// Prior on a rigid camera's extrinsics if the rig has none: calibrations with a target are better than this.
    const RIGID_CAMERA: Self = Self { translation_bound_m: 0.01, rotation_bound_rad: 0.0175 };

    /// Standard deviations of the uniform errors, `bound / √3`: of every translation in metres and of every angle in
    /// radians.
    pub fn sigmas(self) -> (f64, f64) {
        const SIGMA_PER_BOUND: f64 = 0.577_350_269_189_625_8;
        (self.translation_bound_m * SIGMA_PER_BOUND, self.rotation_bound_rad * SIGMA_PER_BOUND)
    }
}

/// Smallest ratio of the image of a camera in the field of view of another one for a stereo pair.
const MIN_COMMON_FIELD: f64 = 0.25;

/// Name and range of a joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Name in the `JointState` messages.
    pub name: String,
    /// Lower and upper stop, in radians.
    pub limits_rad: (f64, f64),
}

#[derive(Clone, Debug, PartialEq)]
pub struct GimbalRig {
    /// Topic of `sensor_msgs/msg/JointState` or of the gimbal's attitude, `None` without either.
    pub topic: Option<String>,
    /// Interpretation of the topic's messages as attitudes, `None` for joint angles.
    pub attitude: Option<AttitudeSource>,
    /// True if the log times of the messages of `topic` replace their header stamps, which were never set.
    pub use_log_time: bool,
    /// `timeshift_gimbal_imu`: `t_imu = t_gimbal + shift`, for the stamps of `topic`.
    pub timeshift_gimbal_imu_s: f64,
    pub rate_hz: f64,
    /// Standard deviation of a reading, `None` without encoders.
    pub encoder_sigma_rad: Option<f64>,
    pub prior: ChainPrior,
    /// True if runs in a minimal parameterization switch to another one near a singularity (`parameterization: auto`).
    pub switches_parameterization: bool,
    /// Classical chain (Eqs. 5–6), links in order.
    pub chain: ClassicalChain,
    /// One joint per link of `chain`.
    pub joints: Vec<Joint>,
}

impl GimbalRig {
    /// Inverse of the chain that converts attitudes to joint angles; `None` unless the rig has an attitude source and
    /// one to three joints.
    pub fn inverse_chain(&self) -> Option<InverseChain> {
        let source = self.attitude.as_ref()?;
        let limits: Vec<(f64, f64)> = self.joints.iter().map(|joint| joint.limits_rad).collect();
        let chain = source.chain.as_deref().unwrap_or(&self.chain);
        Some(InverseChain::new(chain, &limits)?.with_first_joint_offset(source.first_joint_offset_rad))
    }

    /// Sets a calibrated chain; attitudes are still converted to joint angles by the previous chain.
    pub fn set_chain(&mut self, chain: ClassicalChain) {
        let before = std::mem::replace(&mut self.chain, chain);
        if let Some(source) = &mut self.attitude {
            source.chain.get_or_insert_with(|| Box::new(before));
        }
    }
}

/// Field of the rig with an assumed value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AssumedField {
    /// Path in the rig file, such as `gimbal.T_I_B`.
    pub field: String,
    /// Assumption, as one sentence without a full stop.
    pub reason: String,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    pub name: String,
    pub gravity_m_per_s2: f64,
    pub imu: ImuRig,
    /// IMU on the gimbal (`imu1`), `None` without one.
    pub gimbal_imu: Option<GimbalImuRig>,
    /// Cameras in the order of their keys.
    pub cameras: Vec<CameraRig>,
    pub gimbal: Option<GimbalRig>,
    /// Topic of the ground-truth pose of the IMU in the world, or of the ground-truth position of an antenna.
    pub ground_truth_topic: Option<String>,
    /// True if the log times of that topic replace its header stamps, which were never set.
    pub ground_truth_use_log_time: bool,
    /// Position of that antenna, `None` if the rig does not give it.
    pub ground_truth_lever_arm: Option<LeverArm>,
    /// Accuracy that the calibration must reach.
    pub required_accuracy: RequiredAccuracy,
    /// Fields that have not been measured yet.
    pub assumed: Vec<AssumedField>,
}

impl Rig {
    /// Camera with a key such as `cam0`.
    pub fn camera(&self, key: &str) -> Result<&CameraRig, UnknownCamera> {
        self.cameras.iter().find(|camera| camera.key == key).ok_or_else(|| UnknownCamera {
            key: key.to_owned(),
            available: self.cameras.iter().map(|camera| camera.key.clone()).collect(),
        })
    }

    /// Topic of the vehicle's attitude, required if the gimbal's attitude is relative to a frame other than the body.
    pub fn vehicle_topic(&self) -> Option<&str> {
        let source = self.gimbal.as_ref()?.attitude.as_ref()?;
        source.vehicle_topic.as_deref().filter(|_| source.frame != AttitudeFrame::Body)
    }

    /// True if the log times of a topic replace its header stamps.
    pub fn uses_log_time(&self, topic: &str) -> bool {
        let imu = |imu: &ImuRig| imu.use_log_time && imu.reads(topic);
        let second = |second: &GimbalImuRig| imu(&second.sensor);
        let camera = |camera: &CameraRig| camera.use_log_time && camera.topic == topic;
        let gimbal = |gimbal: &GimbalRig| gimbal.use_log_time && gimbal.topic.as_deref() == Some(topic);
        imu(&self.imu)
            || self.gimbal_imu.as_ref().is_some_and(second)
            || self.cameras.iter().any(camera)
            || self.gimbal.as_ref().is_some_and(gimbal)
            || (self.ground_truth_use_log_time && self.ground_truth_topic.as_deref() == Some(topic))
    }

    /// Names of the gimbal's joints, starting at the base; empty without a gimbal.
    pub fn joint_names(&self) -> Vec<String> {
        self.gimbal.iter().flat_map(|gimbal| &gimbal.joints).map(|joint| joint.name.clone()).collect()
    }

    /// Names of calibration parameters: links by their joints, all cameras but the [first](Self::first_camera) by their
    /// keys.
    pub fn parameter_names(&self) -> ParameterNames {
        let further = self.further_cameras().map(|camera| camera.key.clone());
        ParameterNames { joints: self.joint_names(), cameras: further.collect() }
    }

    /// Camera that a run uses unless it names another one: the first one on the gimbal, else the first one.
    pub fn first_camera(&self) -> Option<&CameraRig> {
        let on_gimbal = self.cameras.iter().find(|camera| camera.mount == CameraMount::Gimbal);
        on_gimbal.or_else(|| self.cameras.first())
    }

    /// Number of a camera in the names of parameters: 0 for the [first](Self::first_camera) one, which is also the number
    /// of an unknown camera; the others are counted in their order.
    pub fn camera_number(&self, key: &str) -> u8 {
        let place = self.further_cameras().position(|camera| camera.key == key);
        place.and_then(|place| u8::try_from(place + 1).ok()).unwrap_or_default()
    }

    /// All cameras but the [first](Self::first_camera) one.
    fn further_cameras(&self) -> impl Iterator<Item = &CameraRig> {
        let first = self.first_camera().map(|camera| camera.key.as_str());
        self.cameras.iter().filter(move |camera| Some(camera.key.as_str()) != first)
    }

    /// Chain of the camera with a key: the gimbal's, or one without links for a rigid camera. `None` for an
    /// unknown key, or for a camera on a gimbal that the rig does not describe.
    pub fn chain_of_camera(&self, key: &str) -> Option<ClassicalChain> {
        let camera = self.cameras.iter().find(|camera| camera.key == key)?;
        match &camera.mount {
            CameraMount::Gimbal => self.gimbal.as_ref().map(|gimbal| {
                // The chain ends at the first camera.
                let effector_from_camera = camera.beside(gimbal.chain.effector_from_camera);
                ClassicalChain { effector_from_camera, ..gimbal.chain.clone() }
            }),
            CameraMount::Static { imu_from_camera } => {
                Some(ClassicalChain { imu_from_base: *imu_from_camera, ..ClassicalChain::default() })
            }
        }
    }

    /// First camera before another one with the same topic of images, which is a mistake in the rig.
    pub fn first_of_topic(&self, camera: &CameraRig) -> Option<&CameraRig> {
        let mut before = self.cameras.iter().take_while(|other| other.key != camera.key);
        before.find(|other| other.topic == camera.topic)
    }

    /// Nearest camera before another one with the same mount.
    pub fn camera_before(&self, camera: &CameraRig) -> Option<&CameraRig> {
        self.cameras_before(camera).last()
    }

    fn cameras_before(&self, camera: &CameraRig) -> impl Iterator<Item = &CameraRig> {
        let before = self.cameras.iter().take_while(|other| other.key != camera.key);
        before.filter(|other| other.is_on_gimbal() == camera.is_on_gimbal())
    }

    /// Camera relative to which the pose of another one is known: the nearest one before it with the same mount whose pose
    /// is known relative to the IMU. `None` if the pose of `camera` itself is.
    pub fn base_of(&self, camera: &CameraRig) -> Option<&CameraRig> {
        camera.relative_prior?;
        self.cameras_before(camera).filter(|other| other.relative_prior.is_none()).last()
    }

    /// Other camera of the stereo pair of a rigid camera: the first one mounted beside it that sees a part of its field of
    /// view.
    pub fn stereo_partner(&self, camera: &CameraRig) -> Option<&CameraRig> {
        let is_beside = |other: &&CameraRig| self.base_of(other).is_some_and(|base| base.key == camera.key);
        let is_seen = |other: &&CameraRig| {
            let here_from_camera = self.base_from_camera(Some(&camera.key), &other.key).map(|pose| pose.inverse());
            here_from_camera
                .is_some_and(|pose| other.model.common_field(&camera.model, &pose.rotation) >= MIN_COMMON_FIELD)
        };
        // Two cameras of one topic, a mistake in the rig, have the same images.
        let has_own_images = |other: &&CameraRig| other.topic != camera.topic;
        let beside = self.cameras.iter().filter(|other| !camera.is_on_gimbal() && is_beside(other));
        beside.filter(has_own_images).find(is_seen)
    }

    /// Pose of a camera in the frame of another one, or of the IMU without one. `None` for an unknown key, for cameras with
    /// different mounts, and for a camera on the gimbal without another one.
    pub fn base_from_camera(&self, base: Option<&str>, key: &str) -> Option<RigidTransform> {
        let camera = self.camera(key).ok()?;
        let base = base.map(|base| self.camera(base)).transpose().ok()?;
        match (base, &camera.mount) {
            (None, CameraMount::Gimbal) => None,
            (None, CameraMount::Static { imu_from_camera }) => Some(*imu_from_camera),
            (Some(base), CameraMount::Gimbal) => {
                base.is_on_gimbal().then(|| base.first_from_camera.inverse() * camera.first_from_camera)
            }
            (Some(base), CameraMount::Static { imu_from_camera }) => match &base.mount {
                CameraMount::Static { imu_from_camera: imu_from_base } => {
                    Some(imu_from_base.inverse() * *imu_from_camera)
                }
                CameraMount::Gimbal => None,
            },
        }
    }

    /// Sets the pose of a camera in the frame of another one, or of the IMU without one; see [`Self::base_from_camera`].
    pub fn set_base_from_camera(&mut self, base: Option<&str>, key: &str, base_from_camera: RigidTransform) {
        let base = base.and_then(|base| self.camera(base).ok());
        let imu_from_base = base.map_or_else(RigidTransform::identity, |base| match &base.mount {
            CameraMount::Static { imu_from_camera } => *imu_from_camera,
            CameraMount::Gimbal => base.first_from_camera,
        });
        let Some(camera) = self.cameras.iter_mut().find(|camera| camera.key == key) else { return };
        match &mut camera.mount {
            CameraMount::Static { imu_from_camera } => *imu_from_camera = imu_from_base * base_from_camera,
            CameraMount::Gimbal => camera.first_from_camera = imu_from_base * base_from_camera,
        }
    }

    /// Prior of the rig's extrinsics of one of its cameras.
    pub fn extrinsics_prior(&self, camera: &CameraRig) -> ChainPrior {
        match (&self.gimbal, &camera.mount) {
            (Some(gimbal), CameraMount::Gimbal) => gimbal.prior,
            // The rigid camera of a gimbal rig is assumed to be calibrated as well as the gimbal, but never worse than
            // the usual rigid camera.
            (Some(gimbal), CameraMount::Static { .. }) => ChainPrior {
                translation_bound_m: gimbal.prior.translation_bound_m.min(ChainPrior::RIGID_CAMERA.translation_bound_m),
                rotation_bound_rad: gimbal.prior.rotation_bound_rad.min(ChainPrior::RIGID_CAMERA.rotation_bound_rad),
            },
            (None, _) => ChainPrior::RIGID_CAMERA,
        }
    }
}

impl CameraRig {
    /// Rig value of time offset, readout time or an intrinsic, in the unit of its dimension; `None` for another
    /// quantity.
    pub fn value(&self, quantity: Quantity) -> Option<f64> {
        match quantity {
            Quantity::Timeshift => Some(self.timeshift_cam_imu_s),
            Quantity::Readout => Some(self.readout_s),
            _ => {
                let place = Quantity::INTRINSICS.into_iter().position(|known| known == quantity)?;
                Some(self.model.intrinsics()[place])
            }
        }
    }

    /// Sets calibrated values of [`CameraRig::value`]; intrinsics outside of their range leave the camera model
    /// unchanged.
    pub fn set_values(&mut self, values: &[(Quantity, f64)]) {
        let mut intrinsics = self.model.intrinsics();
        for (quantity, value) in values {
            match quantity {
                Quantity::Timeshift => self.timeshift_cam_imu_s = *value,
                Quantity::Readout => self.readout_s = *value,
                _ => {
                    let mut known = Quantity::INTRINSICS.iter().zip(&mut intrinsics);
                    if let Some((_, intrinsic)) = known.find(|(known, _)| *known == quantity) {
                        *intrinsic = *value;
                    }
                }
            }
        }
        if intrinsics != self.model.intrinsics()
            && let Ok(model) = self.model.with_intrinsics(intrinsics)
        {
            self.model = model;
        }
    }
}

impl Rig {
    /// Neutral joint angles in radians, one per joint: encoder angle 0, or the limit nearest to it. Empty
    /// without a gimbal.
    pub fn neutral_joint_angles_rad(&self) -> Vec<f64> {
        let joints = self.gimbal.iter().flat_map(|gimbal| &gimbal.joints);
        joints.map(|joint| 0.0_f64.clamp(joint.limits_rad.0, joint.limits_rad.1)).collect()
    }

    /// Returns the rig with its gimbal fixed at encoder angles in radians, one per joint: its cameras are static and
    /// there is no gimbal. `None` if the number of angles differs from the number of joints.
    pub fn at_joint_angles(&self, angles_rad: &[f64]) -> Option<Self> {
        let mut rig = self.clone();
        let Some(gimbal) = rig.gimbal.take() else { return angles_rad.is_empty().then_some(rig) };
        if gimbal.chain.joint_count() != angles_rad.len() {
            return None;
        }
        let imu_from_camera = gimbal.chain.imu_from_camera(angles_rad);
        for camera in rig.cameras.iter_mut().filter(|camera| camera.mount == CameraMount::Gimbal) {
            camera.mount = CameraMount::Static { imu_from_camera: camera.beside(imu_from_camera) };
            camera.first_from_camera = RigidTransform::identity();
        }
        rig.assumed.retain(|assumed| !assumed.field.starts_with("gimbal"));
        Some(rig)
    }

    /// Returns the rig with static cameras and IMU in Kalibr's IMU frame, in which the accelerometer's matrix is lower
    /// triangular, and `kalibr_from_imu`. If the matrix is lower triangular already (as for a calibrated IMU), that is
    /// the identity and all values keep their bits. Cameras on a gimbal are unchanged.
    pub fn in_kalibr_imu_frame(&self) -> (Self, UnitQuaternion<f64>) {
        let (kalibr_from_imu, intrinsics) = self.imu.intrinsics.in_lower_triangular_frame();
        let mut rig = self.clone();
        if kalibr_from_imu == UnitQuaternion::identity() {
            return (rig, kalibr_from_imu);
        }
        rig.imu.intrinsics = intrinsics;
        let rotation = RigidTransform { rotation: kalibr_from_imu, ..RigidTransform::identity() };
        for camera in &mut rig.cameras {
            if let CameraMount::Static { imu_from_camera } = &mut camera.mount {
                *imu_from_camera = rotation * *imu_from_camera;
            }
        }
        (rig, kalibr_from_imu)
    }
}
