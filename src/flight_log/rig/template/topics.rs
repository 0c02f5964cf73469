//! Template for a log: its topics, rates, image size and the direction of gravity in its IMU.

use std::path::Path;

use nalgebra::Vector3;

use super::camera::{of_field_of_view, of_published};
use super::{
    AngleTemplate, AttitudeTemplate, CameraChoice, CameraTemplate, GimbalAxis, GimbalTemplate, ImuTemplate,
    MechanismAxes, RigTemplate, Sourced, TYPICAL_IMU_NOISE, TemplateError,
};
use crate::camera::CameraModel;
use crate::files::FileError;
use crate::files::located::Located;
use crate::files::rig::fields::Field;
use crate::files::urdf::DescribedChain;
use crate::flight_log::{FlightLog, MessageKind, TopicInfo, messages};
use crate::sensors::{BodyAxes, ImuNoise};
use crate::text::Named as _;

/// Number of IMU messages over which gravity is averaged.
const GRAVITY_SAMPLES: usize = 2000;
/// Smallest ratio of gravity along an axis to the mean specific force for a vertical axis.
const VERTICAL_RATIO: f64 = 0.8;
/// Words in the names of topics with externally measured poses.
const GROUND_TRUTH_WORDS: [&str; 6] = ["truth", "vicon", "optitrack", "mocap", "leica", "qualisys"];
/// Rates of templates without a log, in Hz.
const IMU_RATE_HZ: f64 = 200.0;
const IMAGE_RATE_HZ: f64 = 30.0;
/// Topics of the IMU of an autopilot and of a camera in converted recordings, alone or the first of several.
const VEHICLE_IMUS: [&str; 2] = ["/imu", "/imu0"];
const CAMERA_IMUS: [&str; 2] = ["/camera/imu", "/camera/imu0"];
/// Endings of the topics of an IMU whose sensors have separate ones.
const GYROSCOPE: &str = "/gyroscope";
const ACCELEROMETER: &str = "/accelerometer";

#[derive(Clone, Debug, PartialEq)]
pub struct RigChoices {
    pub name: String,
    pub camera: CameraChoice,
    /// Size of the images, `None` to read it from the log.
    pub resolution_px: Option<[usize; 2]>,
    pub mechanism: MechanismAxes,
    /// Chain in place of the mechanism.
    pub described: Option<DescribedChain>,
    /// Positive directions of rotation; `None` if unknown.
    pub positive: Option<BodyAxes>,
    /// Axes of the IMU; `None` to determine them from gravity.
    pub imu_axes: Option<BodyAxes>,
    /// Position of the gimbal: forward, left and up of the IMU, in metres; `None` if it has not been measured.
    pub position_m: Option<Vector3<f64>>,
    /// Topic of the IMU, or of its gyroscope; `None` for the log's only one, and for the autopilot's of a recording that
    /// also has the camera's.
    pub imu_topic: Option<String>,
    /// Topic of an IMU in the camera's housing on a gimbal, or of its gyroscope; `None` for the topic of a converted
    /// recording, or without such an IMU.
    pub gimbal_imu_topic: Option<String>,
    /// Its axes in the camera, forward being the viewing direction; `None` if unknown.
    pub gimbal_imu_axes: Option<BodyAxes>,
    /// Topic of the images, `None` for the log's only one.
    pub image_topic: Option<String>,
    /// Topic of the joint angles, `None` for the log's only one.
    pub joint_topic: Option<String>,
    /// Joint names in the order of the mechanism, empty to match them to the axes by words in the names.
    pub joint_names: Vec<String>,
    /// Attitude topic of the gimbal with the entries of `gimbal.source`, to compute joint angles from.
    pub attitude: Option<(String, Vec<(String, String)>)>,
    /// Noise densities of the IMU, if they were measured.
    pub noise: Option<ImuNoise>,
}

impl RigChoices {
    /// Mechanism in messages: its axes, or the joints of a described chain.
    fn mechanism_text(&self) -> String {
        self.described.as_ref().map_or_else(
            || self.mechanism.to_string(),
            |described| described.joints.iter().map(|joint| joint.name.as_str()).collect::<Vec<_>>().join(", "),
        )
    }
}

impl RigTemplate {
    /// Template for these choices, with the rest from the log, if there is one.
    ///
    /// # Errors
    /// When the log has no images or no IMU, or several of them of which none is chosen, or when the size of the images
    /// is not known.
    pub fn new(choices: &RigChoices, log: Option<&FlightLog>) -> Result<Self, TemplateError> {
        let imu = imu(choices, log)?;
        let camera = camera(choices, log)?;
        let described_joints = choices.described.as_ref().map_or(0, |described| described.joints.len());
        let is_rigid = choices.mechanism.0.is_empty() && described_joints == 0;
        let gimbal = if is_rigid { None } else { Some(gimbal(choices, imu.axes.value, log)?) };
        let nothing_known = "gimbal position not measured: assumed at the IMU, ±3 cm per link";
        let position_m = choices.position_m.map_or_else(
            || Sourced::assumed(Vector3::zeros(), nothing_known),
            |position_m| Sourced::assumed(position_m, "position measured by hand"),
        );
        let of_camera = || log.and_then(camera_imu).filter(|topic| choices.imu_topic.as_ref() != Some(topic));
        let gimbal_imu = choices.gimbal_imu_topic.clone().or_else(of_camera).filter(|_| !is_rigid);
        Ok(Self {
            name: choices.name.clone(),
            gimbal_imu: gimbal_imu.map(|topic| gimbal_imu_of(&topic, choices, log)).transpose()?,
            imu,
            camera,
            described: choices.described.clone(),
            gimbal,
            position_m,
            ground_truth_topic: log.and_then(ground_truth_topic),
        })
    }
}

/// Rounds a rate to a tenth of a percent.
fn rounded_hz(rate_hz: f64, default_hz: f64) -> f64 {
    if rate_hz <= 0.0 {
        return default_hz;
    }
    let unit = 10_f64.powf(rate_hz.log10().floor() - 3.0);
    ((rate_hz / unit).round() * unit * 1e6).round() / 1e6
}

fn topics_of<'a>(log: &'a FlightLog, kinds: &[MessageKind]) -> Vec<&'a TopicInfo> {
    log.topics().iter().filter(|info| info.kind.is_some_and(|kind| kinds.contains(&kind))).collect()
}

/// Chosen topic, or the only one of these kinds, or the only one whose name contains `preferred`; `None` without any.
fn one_topic<'a>(
    log: &'a FlightLog,
    kinds: &[MessageKind],
    chosen: Option<&String>,
    preferred: &str,
    (what, option): (&str, &'static str),
) -> Result<Option<&'a TopicInfo>, TemplateError> {
    let topics = topics_of(log, kinds);
    let available = || topics.iter().map(|info| info.topic.clone()).collect::<Vec<_>>();
    if let Some(chosen) = chosen {
        let found = topics.iter().find(|info| info.topic == *chosen).copied();
        return found.map(Some).ok_or_else(|| TemplateError::NoTopic {
            what: format!("{what} '{chosen}'"),
            remedy: format!("it has {}", if topics.is_empty() { "none".to_owned() } else { available().join(", ") }),
        });
    }
    let of_name: Vec<_> =
        topics.iter().copied().filter(|info| info.topic.to_ascii_lowercase().contains(preferred)).collect();
    match (topics.as_slice(), of_name.as_slice()) {
        ([], _) => log.unread_topic_of(kinds).map_or(Ok(None), |unread| {
            let remedy = format!("'{}' is {}; {}", unread.topic, unread.type_in_encoding(), unread.encoding_remedy());
            Err(TemplateError::NoTopic { what: format!("readable {what}"), remedy })
        }),
        ([only], _) | (_, [only]) => Ok(Some(only)),
        _ => Err(TemplateError::SeveralTopics { what: what.to_owned(), option, available: available() }),
    }
}

fn imu(choices: &RigChoices, log: Option<&FlightLog>) -> Result<ImuTemplate, TemplateError> {
    let typical = "usual noise and random walk of an autopilot's MEMS IMU in flight, not measured for this IMU";
    let noise = choices.noise.map_or_else(|| Sourced::assumed(TYPICAL_IMU_NOISE, typical), Sourced::known);
    let Some(log) = log else {
        let topic = choices.imu_topic.clone();
        return Ok(ImuTemplate {
            topic: topic.map_or_else(|| Sourced::assumed("/imu".to_owned(), NO_LOG), Sourced::known),
            accelerometer_topic: None,
            rate_hz: IMU_RATE_HZ,
            axes: imu_axes(choices, None),
            noise,
        });
    };
    let topics = topics_of(log, &[MessageKind::Imu]);
    // RealSense and GoPro: angular velocities and specific forces on separate topics.
    let named = |word: &str| topics.iter().find(|info| info.topic.to_ascii_lowercase().contains(word));
    let exactly = |name: &str| topics.iter().find(|info| info.topic == name).copied();
    let vehicle = camera_imu(log).and_then(|_| VEHICLE_IMUS.into_iter().find_map(exactly)).map(|info| &info.topic);
    let chosen = choices.imu_topic.as_ref().or(vehicle);
    let apart = match (chosen, named("gyro"), named("accel")) {
        (None, Some(gyroscope), Some(accelerometer)) if topics.len() == 2 => Some((*gyroscope, *accelerometer)),
        (Some(chosen), ..) => chosen
            .strip_suffix(GYROSCOPE)
            .and_then(|prefix| Some((exactly(chosen)?, exactly(&format!("{prefix}{ACCELEROMETER}"))?))),
        _ => None,
    };
    let (info, accelerometer) = if let Some((gyroscope, accelerometer)) = apart {
        (gyroscope, Some(accelerometer))
    } else {
        let what = ("IMU topics", "--imu-topic");
        let info = one_topic(log, &[MessageKind::Imu], chosen, "/imu/data", what)?;
        let missing = || TemplateError::NoTopic {
            what: "IMU topic".to_owned(),
            remedy: "record sensor_msgs/msg/Imu, or convert the autopilot's log".to_owned(),
        };
        (info.ok_or_else(missing)?, None)
    };
    let force = mean_force(log, &accelerometer.unwrap_or(info).topic);
    Ok(ImuTemplate {
        topic: Sourced::known(info.topic.clone()),
        accelerometer_topic: accelerometer.map(|info| info.topic.clone()),
        rate_hz: rounded_hz(info.rate_hz, IMU_RATE_HZ),
        axes: imu_axes(choices, force),
        noise,
    })
}

/// Topic of an IMU in the camera of a converted recording that also has the IMU of an autopilot; `None` for other logs.
fn camera_imu(log: &FlightLog) -> Option<String> {
    let topics = topics_of(log, &[MessageKind::Imu]);
    let has = |name: &str| topics.iter().any(|info| info.topic == name);
    let names = CAMERA_IMUS.into_iter().flat_map(|name| [name.to_owned(), format!("{name}{GYROSCOPE}")]);
    names.into_iter().find(|name| has(name)).filter(|_| VEHICLE_IMUS.into_iter().any(has))
}

/// IMU in the camera's housing on this topic.
fn gimbal_imu_of(topic: &str, choices: &RigChoices, log: Option<&FlightLog>) -> Result<ImuTemplate, TemplateError> {
    let of_log = RigChoices { imu_topic: Some(topic.to_owned()), imu_axes: choices.gimbal_imu_axes, ..choices.clone() };
    let (axes, given) = (choices.gimbal_imu_axes.unwrap_or(BodyAxes::Flu), choices.gimbal_imu_axes.is_some());
    let reason = format!(
        "{}IMU assumed at the camera's centre with axes parallel to the camera's: x in viewing direction, y {}, z {}",
        if given { "" } else { "axes unknown; " },
        if axes == BodyAxes::Flu { "left" } else { "right" },
        if axes == BodyAxes::Flu { "up" } else { "down" },
    );
    Ok(ImuTemplate { axes: Sourced::assumed(axes, reason), ..imu(&of_log, log)? })
}

/// Mean of the first specific forces.
fn mean_force(log: &FlightLog, topic: &str) -> Option<Vector3<f64>> {
    let (mut sum, mut count) = (Vector3::zeros(), 0);
    log.for_each_message(topic, |_, data| {
        let force = messages::read_imu(data).map(|imu| imu.specific_force_m_per_s2);
        if let Ok(force) = force
            && force.iter().all(|value| value.is_finite())
        {
            sum += force;
            count += 1;
        }
        count < GRAVITY_SAMPLES
    });
    (count > 0).then(|| sum / count as f64)
}

fn imu_axes(choices: &RigChoices, force: Option<Vector3<f64>>) -> Sourced<BodyAxes> {
    if let Some(axes) = choices.imu_axes {
        return Sourced::known(axes);
    }
    let (flu, frd) = (BodyAxes::Flu, BodyAxes::Frd);
    let vertical = force.map(|force| force.z / force.norm().max(f64::MIN_POSITIVE));
    match vertical {
        Some(ratio) if ratio.abs() > VERTICAL_RATIO => {
            let (axes, word) = if ratio > 0.0 { (flu, "up") } else { (frd, "down") };
            let reason = format!("gravity shows that the IMU's z points {word}; its x is assumed to point forward");
            Sourced::assumed(axes, reason)
        }
        Some(_) => Sourced::assumed(flu, "gravity is not along the IMU's z; assumed axes: x forward, y left, z up"),
        None => Sourced::assumed(flu, "assumed IMU axes: x forward, y left, z up"),
    }
}

const NO_LOG: &str = "usual name, since no log was given";

fn camera(choices: &RigChoices, log: Option<&FlightLog>) -> Result<CameraTemplate, TemplateError> {
    let timeshift_cam_imu_s = Sourced::assumed(0.0, "the time offset between camera and IMU is assumed to be zero");
    let Some(log) = log else {
        let topic = choices.image_topic.clone();
        return Ok(CameraTemplate {
            topic: topic.map_or_else(|| Sourced::assumed("/camera/image_raw".to_owned(), NO_LOG), Sourced::known),
            frame_id: "camera".to_owned(),
            rate_hz: IMAGE_RATE_HZ,
            model: camera_model(choices, None)?,
            timeshift_cam_imu_s,
        });
    };
    let what = ("image topics", "--image-topic");
    let info = one_topic(log, &MessageKind::IMAGES, choices.image_topic.as_ref(), "gimbal", what)?;
    let info = info.ok_or_else(|| TemplateError::NoTopic {
        what: "images".to_owned(),
        remedy: "record sensor_msgs/msg/Image, CompressedImage or foxglove_msgs/msg/CompressedVideo".to_owned(),
    })?;
    Ok(CameraTemplate {
        topic: Sourced::known(info.topic.clone()),
        frame_id: "camera".to_owned(),
        rate_hz: rounded_hz(info.rate_hz, IMAGE_RATE_HZ),
        model: camera_model(choices, Some((log, info)))?,
        timeshift_cam_imu_s,
    })
}

fn camera_model(
    choices: &RigChoices,
    images: Option<(&FlightLog, &TopicInfo)>,
) -> Result<Sourced<CameraModel>, TemplateError> {
    let size = || match (choices.resolution_px, images) {
        (Some(resolution_px), _) => Ok(resolution_px),
        (None, Some((log, info))) => log
            .image_size(&info.topic)
            .ok_or_else(|| TemplateError::NoSize { reason: format!("no image of {} can be decoded", info.topic) }),
        (None, None) => Err(TemplateError::NoSize { reason: "there is no log".to_owned() }),
    };
    let (model, reason) = match &choices.camera {
        CameraChoice::FieldOfView(horizontal_deg) => of_field_of_view(*horizontal_deg, size()?),
        CameraChoice::Published(camera) => of_published(*camera, size()?),
        CameraChoice::CameraInfo(topic) => {
            let missing = |reason: String| TemplateError::NoCameraInfo { reason };
            let (log, info) = images.ok_or_else(|| missing("there is no log".to_owned()))?;
            // `published_camera` searches the parent namespaces of an image topic, so a given `camera_info` topic works as
            // well.
            let beside = topic.as_ref().map_or(info.topic.as_str(), String::as_str);
            let published = log.published_camera(&info.topic, beside).map_err(missing)?;
            return Ok(Sourced::known(published.image));
        }
    };
    Ok(Sourced::assumed(model, reason))
}

fn gimbal(choices: &RigChoices, imu_axes: BodyAxes, log: Option<&FlightLog>) -> Result<GimbalTemplate, TemplateError> {
    let angles = match (&choices.attitude, log) {
        (Some((topic, entries)), log) => AngleTemplate::Attitude(attitude(topic, entries, imu_axes, log)?),
        (None, Some(log)) => joints(choices, log)?,
        (None, None) => AngleTemplate::None,
    };
    let positive = match (&choices.positive, &angles) {
        (Some(positive), _) => Sourced::known(*positive),
        (None, AngleTemplate::Joints { .. }) if choices.described.is_none() => Sourced::assumed(
            BodyAxes::Frd,
            "angles are assumed to be positive to the right (yaw, roll) and upwards (pitch)",
        ),
        (None, _) => Sourced::known(BodyAxes::Frd),
    };
    Ok(GimbalTemplate { axes: choices.mechanism.clone(), positive, angles })
}

/// Attitude on a topic with these entries of `gimbal.source`; the axes of the IMU may be missing.
fn attitude(
    topic: &str,
    entries: &[(String, String)],
    imu_axes: BodyAxes,
    log: Option<&FlightLog>,
) -> Result<AttitudeTemplate, TemplateError> {
    let info = log.map(|log| {
        log.topic(topic).ok_or_else(|| TemplateError::NoTopic {
            what: format!("topic '{topic}'"),
            remedy: "give the topic of the gimbal's attitude".to_owned(),
        })
    });
    let rate_hz = info.transpose()?.map_or(IMAGE_RATE_HZ, |info| rounded_hz(info.rate_hz, IMAGE_RATE_HZ));
    let given = entries.iter().map(|(key, value)| (key.as_str(), value.as_str()));
    let document =
        Located::of_texts([("imu_axes", imu_axes.name())].into_iter().chain(given).chain([("topic", topic)]));
    let source = crate::files::rig::attitude::read(&Field::root(&document, Path::new("")));
    let (_, source) = source.map_err(|error| TemplateError::Attitude {
        problem: match error {
            FileError::Rig { field, problem, .. } => format!("{field}: {problem}"),
            error => error.to_string(),
        },
    })?;
    let reason = "frame, axes, order and unit of the attitude are as given, not confirmed";
    Ok(AttitudeTemplate { topic: topic.to_owned(), rate_hz, source: Sourced::assumed(source, reason) })
}

fn joints(choices: &RigChoices, log: &FlightLog) -> Result<AngleTemplate, TemplateError> {
    let what = ("topics of joint angles", "--joint-topic");
    let info = one_topic(log, &[MessageKind::JointState], choices.joint_topic.as_ref(), "gimbal", what)?;
    let Some(info) = info else { return Ok(AngleTemplate::None) };
    let found = log.find_message(&info.topic, |data| {
        let message = messages::read_joint_state(data).ok()?;
        Some(message.names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>())
    });
    let found = found.unwrap_or_default();
    let names = if let Some(described) = &choices.described {
        let names: Vec<String> = described.joints.iter().map(|joint| joint.name.clone()).collect();
        names.iter().all(|name| found.contains(name)).then_some(names)
    } else if choices.joint_names.is_empty() {
        names_of_axes(&choices.mechanism, &found)
    } else {
        let known = choices.joint_names.iter().all(|name| found.contains(name));
        (known && choices.joint_names.len() == choices.mechanism.0.len()).then(|| choices.joint_names.clone())
    };
    let names = names.ok_or_else(|| TemplateError::Joints {
        topic: info.topic.clone(),
        found,
        mechanism: choices.mechanism_text(),
    })?;
    let topic = Sourced::known(info.topic.clone());
    Ok(AngleTemplate::Joints { topic, rate_hz: rounded_hz(info.rate_hz, IMU_RATE_HZ), names })
}

/// Joint name of each axis: the only one that suggests the axis.
fn names_of_axes(mechanism: &MechanismAxes, found: &[String]) -> Option<Vec<String>> {
    let name = |axis: &GimbalAxis| {
        let mut named = found.iter().filter(|name| GimbalAxis::of_joint(name) == Some(*axis));
        named.next().filter(|_| named.next().is_none()).cloned()
    };
    let names: Vec<String> = mechanism.0.iter().map(name).collect::<Option<_>>()?;
    let twice = names.iter().enumerate().any(|(place, name)| names[..place].contains(name));
    (!twice).then_some(names)
}

fn ground_truth_topic(log: &FlightLog) -> Option<String> {
    let poses = topics_of(log, &[MessageKind::Odometry, MessageKind::PoseStamped, MessageKind::TransformStamped]);
    let named = |info: &&&TopicInfo| {
        let name = info.topic.to_ascii_lowercase();
        GROUND_TRUTH_WORDS.iter().any(|word| name.contains(word))
    };
    poses.iter().find(named).map(|info| info.topic.clone())
}

/// Largest number of joints of a message that is taken for a gimbal's: robots publish the joints of arms and wheels
/// too.
const MOST_JOINTS: usize = 4;

/// Axes in the order of the joints of the first readable `JointState` message; `None` if a name suggests no axis or an
/// axis is repeated.
pub fn suggested_mechanism(log: &FlightLog) -> Option<MechanismAxes> {
    let topic = log.topics_of(&[MessageKind::JointState]).into_iter().next()?;
    let axes = log.find_message(&topic, |data| {
        let message = messages::read_joint_state(data).ok()?;
        let axes: Option<Vec<GimbalAxis>> = message.names.iter().map(|name| GimbalAxis::of_joint(name)).collect();
        axes.filter(|axes| !axes.is_empty() && axes.len() <= MOST_JOINTS)
    })?;
    let repeated = axes.iter().enumerate().any(|(place, axis)| axes[..place].contains(axis));
    (!repeated).then_some(MechanismAxes(axes))
}
