//! Rig for a recording without one: known facts, usual values for the rest, and a list of those (`assumed`).

mod camera;
mod error;
mod mechanism;
#[cfg(test)]
mod tests;
mod text;
mod topics;

pub use camera::{CameraChoice, PublishedCamera};
pub use error::TemplateError;
pub use mechanism::{GimbalAxis, MechanismAxes};
pub use topics::{RigChoices, suggested_mechanism};

use nalgebra::Vector3;

use crate::camera::CameraModel;
use crate::files::urdf::DescribedChain;
use crate::geometry::RigidTransform;
use crate::sensors::{
    AssumedField, AttitudeSource, BodyAxes, CameraMount, CameraRig, ChainPrior, GimbalImuRig, GimbalRig, ImuIntrinsics,
    ImuNoise, ImuRig, IntrinsicsSigma, RequiredAccuracy, Rig,
};

/// Standard deviations of intrinsics from a field of view: of the focal length as a ratio (manufacturers round, crop
/// and stabilize), of the principal point as a ratio of the width, and of distortion coefficients.
const ASSUMED_FOCAL_RATIO: f64 = 0.1;
const ASSUMED_CENTRE_RATIO: f64 = 0.02;
const ASSUMED_DISTORTION: f64 = 0.1;
/// Standard deviation of a gimbal's joint angle if it has not been measured, in radians (0.5°).
const JOINT_SIGMA_RAD: f64 = 0.0087;
/// Standard deviation of an attitude that a gimbal estimates with an additional IMU (1°).
const ATTITUDE_SIGMA_RAD: f64 = 0.0175;
/// Bounds of the errors of a chain that is described by its axes: 3 cm and 10°.
const CHAIN_PRIOR: ChainPrior =
    ChainPrior { translation_bound_m: 0.03, rotation_bound_rad: std::f64::consts::PI / 18.0 };
const GRAVITY_M_PER_S2: f64 = 9.81;

/// Noise of an autopilot's MEMS IMU in flight: about five times the densities in data sheets of the ICM-20689,
/// ICM-42688 and BMI088 (gyroscope 0.005 to 0.014 °/s/√Hz, accelerometer 70 to 190 µg/√Hz), as estimators need it.
pub const TYPICAL_IMU_NOISE: ImuNoise = ImuNoise {
    accelerometer_noise_density: 0.01,
    accelerometer_random_walk: 0.002,
    gyroscope_noise_density: 1e-3,
    gyroscope_random_walk: 4e-5,
};

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sourced<T> {
    pub value: T,
    /// Reason of an assumption, as one sentence without a full stop; `None` for a known value.
    pub assumed: Option<String>,
}

impl<T> Sourced<T> {
    pub fn known(value: T) -> Self {
        Self { value, assumed: None }
    }

    /// Assumed value that a person must still confirm, with the reason.
    pub fn assumed(value: T, reason: impl Into<String>) -> Self {
        Self { value, assumed: Some(reason.into()) }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct ImuTemplate {
    /// Topic of messages `sensor_msgs/msg/Imu`.
    pub topic: Sourced<String>,
    /// Topic of the specific forces, if they are separate.
    pub accelerometer_topic: Option<String>,
    pub rate_hz: f64,
    /// Axes of the IMU in the vehicle.
    pub axes: Sourced<BodyAxes>,
    /// Noise densities, measured or [`TYPICAL_IMU_NOISE`].
    pub noise: Sourced<ImuNoise>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct CameraTemplate {
    pub topic: Sourced<String>,
    pub frame_id: String,
    pub rate_hz: f64,
    pub model: Sourced<CameraModel>,
    /// Kalibr's `timeshift_cam_imu`: `t_imu = t_cam + shift`.
    pub timeshift_cam_imu_s: Sourced<f64>,
}

/// Source of joint angles.
#[derive(Clone, Debug, PartialEq)]
pub enum AngleTemplate {
    /// Joint angles on a topic of `sensor_msgs/msg/JointState`, by these names in the order of the mechanism.
    Joints { topic: Sourced<String>, rate_hz: f64, names: Vec<String> },
    /// Attitude that is converted to joint angles (`gimbal.source`).
    Attitude(AttitudeTemplate),
    /// No measurement of the joints.
    None,
}

/// Attitude topic of a gimbal: `gimbal.source`.
#[derive(Clone, Debug, PartialEq)]
pub struct AttitudeTemplate {
    pub topic: String,
    pub rate_hz: f64,
    pub source: Sourced<AttitudeSource>,
}

impl CameraTemplate {
    /// Standard deviations of intrinsics from a field of view.
    fn intrinsics_sigma(&self) -> IntrinsicsSigma {
        IntrinsicsSigma {
            focal_ratio: ASSUMED_FOCAL_RATIO,
            centre_px: ASSUMED_CENTRE_RATIO * self.model.value.resolution_px[0] as f64,
            distortion: ASSUMED_DISTORTION,
        }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct GimbalTemplate {
    /// Axes from the vehicle to the camera; empty for a described chain.
    pub axes: MechanismAxes,
    /// Positive directions of rotation.
    pub positive: Sourced<BodyAxes>,
    pub angles: AngleTemplate,
}

/// Rig before any calibration.
///
/// [`Self::to_yaml`] returns the commented file; its entry `assumed` lists the assumptions, which `check` reports.
#[derive(Clone, Debug, PartialEq)]
pub struct RigTemplate {
    pub name: String,
    pub imu: ImuTemplate,
    pub camera: CameraTemplate,
    /// Chain in place of the axes of the gimbal, and of the pose of a rigid camera.
    pub described: Option<DescribedChain>,
    /// `None` for a rigid camera; it looks forward if its pose is not described.
    pub gimbal: Option<GimbalTemplate>,
    /// IMU in the camera's housing, with its axes in the camera (forward is its viewing direction); only with a gimbal.
    pub gimbal_imu: Option<ImuTemplate>,
    /// Position of the gimbal, or of the rigid camera: forward, left and up of the IMU, in metres.
    pub position_m: Sourced<Vector3<f64>>,
    /// Topic of the ground-truth pose of the IMU in the world.
    pub ground_truth_topic: Option<String>,
}

impl RigTemplate {
    /// Rig with its `assumed` fields.
    pub fn rig(&self) -> Rig {
        let imu_axes = self.imu.axes.value;
        let mount = if self.gimbal.is_some() {
            CameraMount::Gimbal
        } else {
            let forward = || MechanismAxes(Vec::new()).chain(imu_axes, imu_axes, self.position_m.value);
            let chain = self.described.as_ref().map_or_else(forward, |described| described.chain.clone());
            CameraMount::Static { imu_from_camera: chain.imu_from_base }
        };
        Rig {
            name: self.name.clone(),
            gravity_m_per_s2: GRAVITY_M_PER_S2,
            imu: ImuRig {
                topic: self.imu.topic.value.clone(),
                accelerometer_topic: self.imu.accelerometer_topic.clone(),
                use_log_time: false,
                frame_id: "imu".to_owned(),
                rate_hz: self.imu.rate_hz,
                noise: self.imu.noise.value,
                intrinsics: ImuIntrinsics::default(),
            },
            gimbal_imu: self.gimbal_imu.as_ref().map(gimbal_imu_rig),
            cameras: vec![CameraRig {
                key: "cam0".to_owned(),
                first_from_camera: RigidTransform::identity(),
                relative_prior: None,
                mount,
                topic: self.camera.topic.value.clone(),
                use_log_time: false,
                frame_id: self.camera.frame_id.clone(),
                rate_hz: self.camera.rate_hz,
                model: self.camera.model.value.clone(),
                timeshift_cam_imu_s: self.camera.timeshift_cam_imu_s.value,
                readout_s: 0.0,
                readout_sigma_s: None,
                intrinsics_sigma: self.camera.model.assumed.is_some().then(|| self.camera.intrinsics_sigma()),
                mask: None,
            }],
            gimbal: self.gimbal.as_ref().map(|gimbal| self.gimbal_rig(gimbal)),
            ground_truth_topic: self.ground_truth_topic.clone(),
            ground_truth_use_log_time: false,
            ground_truth_lever_arm: None,
            required_accuracy: RequiredAccuracy::default(),
            assumed: self.assumed_fields(),
        }
    }

    fn gimbal_rig(&self, gimbal: &GimbalTemplate) -> GimbalRig {
        let described = self.described.as_ref();
        let of_axes = || gimbal.axes.chain(gimbal.positive.value, self.imu.axes.value, self.position_m.value);
        let chain = described.map_or_else(of_axes, |described| described.chain.clone());
        let default_names = described.map_or_else(
            || gimbal.axes.default_names(),
            |described| described.joints.iter().map(|joint| joint.name.clone()).collect(),
        );
        let (topic, rate_hz, sigma_rad, names) = match &gimbal.angles {
            AngleTemplate::Joints { topic, rate_hz, names } => {
                (Some(topic.value.clone()), *rate_hz, Some(JOINT_SIGMA_RAD), names.clone())
            }
            AngleTemplate::Attitude(attitude) => {
                (Some(attitude.topic.clone()), attitude.rate_hz, Some(ATTITUDE_SIGMA_RAD), default_names)
            }
            AngleTemplate::None => (None, 0.0, None, default_names),
        };
        GimbalRig {
            topic,
            attitude: match &gimbal.angles {
                AngleTemplate::Attitude(attitude) => Some(attitude.source.value.clone()),
                _ => None,
            },
            use_log_time: false,
            timeshift_gimbal_imu_s: 0.0,
            rate_hz,
            encoder_sigma_rad: sigma_rad,
            prior: CHAIN_PRIOR,
            switches_parameterization: false,
            chain,
            joints: described.map_or_else(
                || gimbal.axes.joints(&names, gimbal.positive.value),
                |described| described.joints.clone(),
            ),
        }
    }

    /// Fields that a person must still confirm, in the order of the file.
    pub fn assumed_fields(&self) -> Vec<AssumedField> {
        let mut fields = Vec::new();
        let mut add = |field: &str, reason: Option<String>| {
            if let Some(reason) = reason {
                fields.push(AssumedField { field: field.to_owned(), reason });
            }
        };
        add("imu0.rostopic", self.imu.topic.assumed.clone());
        add("imu0.accelerometer_noise_density", self.imu.noise.assumed.clone());
        add("imu0.gyroscope_noise_density", self.imu.noise.assumed.clone());
        if let Some(imu) = &self.gimbal_imu {
            add("imu1.accelerometer_noise_density", imu.noise.assumed.clone());
            add("imu1.gyroscope_noise_density", imu.noise.assumed.clone());
            add("imu1.T_cam_imu", imu.axes.assumed.clone());
        }
        add("cam0.rostopic", self.camera.topic.assumed.clone());
        add("cam0.intrinsics", self.camera.model.assumed.clone());
        add("cam0.timeshift_cam_imu", self.camera.timeshift_cam_imu_s.assumed.clone());
        let both = |a: &Option<String>, b: &Option<String>| {
            let reasons: Vec<&str> = a.iter().chain(b).map(String::as_str).collect();
            (!reasons.is_empty()).then(|| reasons.join("; "))
        };
        let place = match &self.described {
            Some(described) => Some(described.reason.clone()),
            None => both(&self.position_m.assumed, &self.imu.axes.assumed),
        };
        let Some(gimbal) = &self.gimbal else {
            add("cam0.T_cam_imu", place);
            return fields;
        };
        match &gimbal.angles {
            AngleTemplate::Joints { topic, .. } => add("gimbal.rostopic", topic.assumed.clone()),
            AngleTemplate::Attitude(attitude) => add("gimbal.source", attitude.source.assumed.clone()),
            AngleTemplate::None => {}
        }
        if gimbal.angles != AngleTemplate::None {
            let reason = "usual standard deviation, not measured for this gimbal";
            add("gimbal.encoder_sigma", Some(reason.to_owned()));
        }
        add("gimbal.T_I_B", place);
        if let Some(described) = &self.described {
            add("gimbal.links", Some(described.reason.clone()));
            add("gimbal.T_E_C", Some(described.reason.clone()));
            return fields;
        }
        let meeting = format!(
            "the axes {} meet in one point at right angles; at angles zero the camera looks forward",
            gimbal.axes
        );
        add("gimbal.links", both(&Some(meeting), &gimbal.positive.assumed));
        add("gimbal.T_E_C", Some("the camera's centre is at the intersection of the axes".to_owned()));
        fields
    }
}

/// IMU at the centre of the camera with axes parallel to its own.
fn gimbal_imu_rig(imu: &ImuTemplate) -> GimbalImuRig {
    let imu_from_camera = MechanismAxes(Vec::new()).chain(imu.axes.value, imu.axes.value, Vector3::zeros());
    GimbalImuRig {
        sensor: ImuRig {
            topic: imu.topic.value.clone(),
            accelerometer_topic: imu.accelerometer_topic.clone(),
            use_log_time: false,
            frame_id: "gimbal_imu".to_owned(),
            rate_hz: imu.rate_hz,
            noise: imu.noise.value,
            intrinsics: ImuIntrinsics::default(),
        },
        camera_from_imu: imu_from_camera.imu_from_base.inverse(),
        timeshift_s: 0.0,
    }
}
