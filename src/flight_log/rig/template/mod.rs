//! A rig for a recording without one: what is known of it, usual values for the rest, and a list of those (`assumed`).

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
pub use topics::RigChoices;

use nalgebra::Vector3;

use crate::camera::CameraModel;
use crate::sensors::{
    AssumedField, AttitudeSource, BodyAxes, CameraMount, CameraRig, ChainPrior, GimbalRig, ImuIntrinsics, ImuNoise,
    ImuRig, IntrinsicsSigma, Rig,
};

/// Standard deviations of intrinsics that follow from a field of view: of the focal length as a ratio (makers round, crop and
/// stabilize), of the principal point as a ratio of the width, and of distortion coefficients.
const ASSUMED_FOCAL_RATIO: f64 = 0.1;
const ASSUMED_CENTRE_RATIO: f64 = 0.02;
const ASSUMED_DISTORTION: f64 = 0.1;
/// Standard deviation of a joint angle of a gimbal whose encoders nobody has measured, in radians (0.5°).
const JOINT_SIGMA_RAD: f64 = 0.0087;
/// The same of an attitude that a gimbal estimates with an IMU of its own (1°).
const ATTITUDE_SIGMA_RAD: f64 = 0.0175;
/// Bounds of the errors of a chain that was described in words: 3 cm and 10°.
const CHAIN_PRIOR: ChainPrior =
    ChainPrior { translation_bound_m: 0.03, rotation_bound_rad: std::f64::consts::PI / 18.0 };
const GRAVITY_M_PER_S2: f64 = 9.81;

/// Noise of an autopilot's MEMS IMU in flight: about five times the densities in data sheets of the ICM-20689, ICM-42688 and
/// BMI088 (gyroscope 0.005 to 0.014 °/s/√Hz, accelerometer 70 to 190 µg/√Hz), as estimators need it.
pub const TYPICAL_IMU_NOISE: ImuNoise = ImuNoise {
    accelerometer_noise_density: 0.01,
    accelerometer_random_walk: 0.002,
    gyroscope_noise_density: 1e-3,
    gyroscope_random_walk: 4e-5,
};

/// A value with where it comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sourced<T> {
    /// The value.
    pub value: T,
    /// Why it is only assumed, as one sentence without a full stop; `None` for a known value.
    pub assumed: Option<String>,
}

impl<T> Sourced<T> {
    /// A value that is known.
    pub fn known(value: T) -> Self {
        Self { value, assumed: None }
    }

    /// A value that a person must still confirm, with the reason.
    pub fn assumed(value: T, reason: impl Into<String>) -> Self {
        Self { value, assumed: Some(reason.into()) }
    }
}

/// The IMU of a template.
#[derive(Clone, Debug, PartialEq)]
pub struct ImuTemplate {
    /// Topic of its `sensor_msgs/msg/Imu`.
    pub topic: Sourced<String>,
    /// Topic of the specific forces, when they are apart.
    pub accelerometer_topic: Option<String>,
    /// Rate in Hz.
    pub rate_hz: f64,
    /// Its axes in the vehicle.
    pub axes: Sourced<BodyAxes>,
    /// Noise densities, measured or [`TYPICAL_IMU_NOISE`].
    pub noise: Sourced<ImuNoise>,
}

/// The camera of a template.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraTemplate {
    /// Topic of its images.
    pub topic: Sourced<String>,
    /// Frame name.
    pub frame_id: String,
    /// Rate in Hz.
    pub rate_hz: f64,
    /// Its model.
    pub model: Sourced<CameraModel>,
    /// Kalibr's `timeshift_cam_imu`: `t_imu = t_cam + shift`.
    pub timeshift_cam_imu_s: Sourced<f64>,
}

/// Where the angles of a template's gimbal come from.
#[derive(Clone, Debug, PartialEq)]
pub enum AngleTemplate {
    /// Joint angles on a topic of `sensor_msgs/msg/JointState`, by these names in the order of the mechanism.
    Joints {
        /// The topic.
        topic: Sourced<String>,
        /// Rate in Hz.
        rate_hz: f64,
        /// Joint names.
        names: Vec<String>,
    },
    /// An attitude, from which the angles follow (`gimbal.source`).
    Attitude(AttitudeTemplate),
    /// Nothing measures them.
    None,
}

/// The attitude topic of a gimbal: `gimbal.source`.
#[derive(Clone, Debug, PartialEq)]
pub struct AttitudeTemplate {
    /// The topic.
    pub topic: String,
    /// Rate in Hz.
    pub rate_hz: f64,
    /// What its messages mean.
    pub source: Sourced<AttitudeSource>,
}

impl CameraTemplate {
    /// How wrong intrinsics from a field of view may be.
    fn intrinsics_sigma(&self) -> IntrinsicsSigma {
        IntrinsicsSigma {
            focal_ratio: ASSUMED_FOCAL_RATIO,
            centre_px: ASSUMED_CENTRE_RATIO * self.model.value.resolution_px[0] as f64,
            distortion: ASSUMED_DISTORTION,
        }
    }
}

/// The gimbal of a template.
#[derive(Clone, Debug, PartialEq)]
pub struct GimbalTemplate {
    /// Its axes from the vehicle to the camera.
    pub axes: MechanismAxes,
    /// Which directions of rotation are positive.
    pub positive: Sourced<BodyAxes>,
    /// Source of its angles.
    pub angles: AngleTemplate,
}

/// A rig before anything was calibrated.
///
/// [`Self::to_yaml`] is the commented file; what has to be assumed is its entry `assumed`, and `check` asks for it.
#[derive(Clone, Debug, PartialEq)]
pub struct RigTemplate {
    /// Name of the rig.
    pub name: String,
    /// The IMU.
    pub imu: ImuTemplate,
    /// The camera.
    pub camera: CameraTemplate,
    /// The gimbal; `None` for a camera that is rigidly mounted and looks forward.
    pub gimbal: Option<GimbalTemplate>,
    /// Position of the gimbal, or of the rigid camera: forward, left and up of the IMU, in metres.
    pub position_m: Sourced<Vector3<f64>>,
    /// Topic of the true pose of the IMU in the world.
    pub ground_truth_topic: Option<String>,
}

impl RigTemplate {
    /// The rig with its `assumed` fields.
    pub fn rig(&self) -> Rig {
        let imu_axes = self.imu.axes.value;
        let mount = if self.gimbal.is_some() {
            CameraMount::Gimbal
        } else {
            let chain = MechanismAxes(Vec::new()).chain(imu_axes, imu_axes, self.position_m.value);
            CameraMount::Static { imu_from_camera: chain.imu_from_base }
        };
        Rig {
            name: self.name.clone(),
            gravity_m_per_s2: GRAVITY_M_PER_S2,
            imu: ImuRig {
                topic: self.imu.topic.value.clone(),
                accelerometer_topic: self.imu.accelerometer_topic.clone(),
                frame_id: "imu".to_owned(),
                rate_hz: self.imu.rate_hz,
                noise: self.imu.noise.value,
                intrinsics: ImuIntrinsics::default(),
            },
            cameras: vec![CameraRig {
                key: "cam0".to_owned(),
                mount,
                topic: self.camera.topic.value.clone(),
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
            ground_truth_lever_arm: None,
            assumed: self.assumed_fields(),
        }
    }

    fn gimbal_rig(&self, gimbal: &GimbalTemplate) -> GimbalRig {
        let chain = gimbal.axes.chain(gimbal.positive.value, self.imu.axes.value, self.position_m.value);
        let (topic, rate_hz, sigma_rad, names) = match &gimbal.angles {
            AngleTemplate::Joints { topic, rate_hz, names } => {
                (Some(topic.value.clone()), *rate_hz, Some(JOINT_SIGMA_RAD), names.clone())
            }
            AngleTemplate::Attitude(attitude) => {
                (Some(attitude.topic.clone()), attitude.rate_hz, Some(ATTITUDE_SIGMA_RAD), gimbal.axes.default_names())
            }
            AngleTemplate::None => (None, 0.0, None, gimbal.axes.default_names()),
        };
        GimbalRig {
            topic,
            attitude: match &gimbal.angles {
                AngleTemplate::Attitude(attitude) => Some(attitude.source.value.clone()),
                _ => None,
            },
            timeshift_gimbal_imu_s: 0.0,
            rate_hz,
            encoder_sigma_rad: sigma_rad,
            prior: CHAIN_PRIOR,
            switches_parameterization: false,
            chain,
            joints: gimbal.axes.joints(&names, gimbal.positive.value),
        }
    }

    /// What a person must still say, in the order of the file.
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
        add("cam0.rostopic", self.camera.topic.assumed.clone());
        add("cam0.intrinsics", self.camera.model.assumed.clone());
        add("cam0.timeshift_cam_imu", self.camera.timeshift_cam_imu_s.assumed.clone());
        let both = |a: &Option<String>, b: &Option<String>| {
            let reasons: Vec<&str> = a.iter().chain(b).map(String::as_str).collect();
            (!reasons.is_empty()).then(|| reasons.join("; "))
        };
        let place = both(&self.position_m.assumed, &self.imu.axes.assumed);
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
            let reason = "a usual standard deviation; the gimbal's own is not known";
            add("gimbal.encoder_sigma", Some(reason.to_owned()));
        }
        add("gimbal.T_I_B", place);
        let meeting = format!(
            "the axes {} meet in one point at right angles, with zero where the camera looks forward",
            gimbal.axes
        );
        add("gimbal.links", both(&Some(meeting), &gimbal.positive.assumed));
        add("gimbal.T_E_C", Some("the camera's centre is where the axes meet".to_owned()));
        fields
    }
}
