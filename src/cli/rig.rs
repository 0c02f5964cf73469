//! `dcvins rig`: rigs for recordings without one.

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::{Args, Subcommand};
use dcvins::export;
use dcvins::files::urdf::{DescribedChain, RobotModel};
use dcvins::flight_log::FlightLog;
use dcvins::flight_log::rig_template::{CameraChoice, MechanismAxes, PublishedCamera, RigChoices, RigTemplate};
use dcvins::sensors::BodyAxes;
use dcvins::text::{Entry, Named as _};

use crate::cli::exit::{self, ExitOutcome};
use crate::cli::shared_arguments::{LimitArguments, RobotLinkArguments, sides};
use crate::cli::terminal::print;

#[derive(Args, Clone, Debug)]
pub(crate) struct RigArguments {
    #[command(subcommand)]
    pub command: RigCommand,
}

#[derive(Clone, Debug, Subcommand)]
pub(crate) enum RigCommand {
    /// Write a commented rig for a recording without one, and list the values that are only assumed.
    #[command(after_help = exit::PLAIN)]
    New(Box<NewArguments>),
}

#[derive(Args, Clone, Debug)]
pub(crate) struct NewArguments {
    /// The log; its topics, joint names, rates, image size and the direction of gravity are used.
    pub log: Option<PathBuf>,
    /// Axes of the gimbal from the vehicle to the camera, as in yaw-roll-pitch, yaw-pitch or pitch; rigid for a camera without
    /// a gimbal.
    #[arg(long, value_name = "AXES", value_parser = parsed::<MechanismAxes>, required_unless_present_any = ["list", "urdf"])]
    pub mechanism: Option<MechanismAxes>,
    /// The chain of a robot description in place of --mechanism and --at: a URDF file, or `topic:NAME` for the topic of a
    /// log, as in `topic:/robot_description`. Rotating, mimicking and fixed joints between the links are taken, with their limits.
    #[arg(long, value_name = "FILE", requires = "imu_link", requires = "camera_link", conflicts_with_all = ["mechanism", "at", "positive", "joints"])]
    pub urdf: Option<PathBuf>,
    #[command(flatten)]
    pub links: RobotLinkArguments,
    /// The camera: fov:DEG (horizontal field of view), a model with published intrinsics (--list prints all), or
    /// info[:TOPIC] for the log's `CameraInfo`.
    #[arg(long, value_name = "CAMERA", value_parser = parsed::<CameraChoice>, required_unless_present = "list")]
    pub camera: Option<CameraChoice>,
    /// The rig to write [default: the name of the log with .rig.yaml].
    #[arg(short, long, visible_alias = "out", value_name = "FILE", required_unless_present_any = ["log", "list"])]
    pub output: Option<PathBuf>,
    /// Size of the images, if it cannot be read from the log.
    #[arg(long, value_name = "WxH", value_parser = image_size)]
    pub size: Option<[usize; 2]>,
    /// Position of the gimbal, or of a rigid camera: metres forward, left and up of the IMU. A ruler is accurate
    /// enough.
    #[arg(long, value_name = "X,Y,Z", value_parser = position, allow_hyphen_values = true)]
    pub at: Option<[f64; 3]>,
    /// Sign of the joint angles: frd (positive yaw to the right, pitch up, as of autopilots and DJI) or flu (positive
    /// yaw to the left, pitch down, as in ROS) [default: frd].
    #[arg(long, value_name = "frd|flu", value_parser = body_axes)]
    pub positive: Option<BodyAxes>,
    /// Axes of the IMU: flu or frd [default: from gravity in the log].
    #[arg(long, value_name = "frd|flu", value_parser = body_axes)]
    pub imu_axes: Option<BodyAxes>,
    /// Topic of the IMU, if the log has several.
    #[arg(long, value_name = "TOPIC")]
    pub imu_topic: Option<String>,
    /// Topic of an IMU in the housing of the gimbal's camera, which becomes imu1.
    #[arg(long, value_name = "TOPIC")]
    pub gimbal_imu_topic: Option<String>,
    /// Axes of that IMU in the camera, x being the viewing direction: flu or frd [default: flu, as assumption].
    #[arg(long, value_name = "frd|flu", value_parser = body_axes, requires = "gimbal_imu_topic")]
    pub gimbal_imu_axes: Option<BodyAxes>,
    /// Topic of the images, if the log has several.
    #[arg(long, value_name = "TOPIC")]
    pub image_topic: Option<String>,
    /// Topic of the joint angles, if the log has several.
    #[arg(long, value_name = "TOPIC", conflicts_with = "attitude")]
    pub joint_topic: Option<String>,
    /// Names of the joints in the order of the mechanism, if they do not contain yaw, roll or pitch.
    #[arg(long, value_name = "NAME,…", value_delimiter = ',')]
    pub joints: Vec<String>,
    /// Attitude topic from which the joint angles are computed, with entries of gimbal.source, as in
    /// /gimbal/attitude,type=quaternion,frame=body,axes=frd.
    #[arg(long, value_name = "TOPIC[,KEY=VALUE…]", value_parser = attitude)]
    pub attitude: Option<Attitude>,
    /// Overwrite an existing file.
    #[arg(long)]
    pub force: bool,
    /// Print the names of the cameras.
    #[arg(long)]
    pub list: bool,
    #[command(flatten)]
    pub limits: LimitArguments,
}

#[derive(Clone, Debug)]
pub(crate) struct Attitude {
    topic: String,
    entries: Vec<(String, String)>,
}

fn parsed<T: std::str::FromStr<Err: std::fmt::Display>>(text: &str) -> Result<T, String> {
    text.parse().map_err(|error: T::Err| error.to_string())
}

fn body_axes(text: &str) -> Result<BodyAxes, String> {
    let axes = BodyAxes::all().find(|axes| axes.name().eq_ignore_ascii_case(text));
    axes.ok_or_else(|| "expected flu (forward, left, up) or frd (forward, right, down)".to_owned())
}

fn image_size(text: &str) -> Result<[usize; 2], String> {
    sides(text, 16..=65_535).ok_or_else(|| "expected WIDTHxHEIGHT in pixels, as in 1920x1080".to_owned())
}

fn position(text: &str) -> Result<[f64; 3], String> {
    let numbers: Option<Vec<f64>> =
        text.split(',').map(|number| number.trim().parse().ok().filter(|value: &f64| value.abs() < 100.0)).collect();
    let numbers = numbers.and_then(|numbers| <[f64; 3]>::try_from(numbers).ok());
    numbers.ok_or_else(|| "expected metres forward, left and up, as in 0.1,0,-0.05".to_owned())
}

fn attitude(text: &str) -> Result<Attitude, String> {
    const KEYS: [&str; 11] = [
        "type",
        "frame",
        "axes",
        "order",
        "unit",
        "vehicle",
        "parent",
        "child",
        "gimbal_axes",
        "imu_axes",
        "vehicle_axes",
    ];
    let mut parts = text.split(',');
    let topic = parts.next().unwrap_or_default().to_owned();
    let entry = |part: &str| {
        let Entry { key, value } = Entry::parse(part)?;
        let plain =
            !value.is_empty() && value.chars().all(|letter| letter.is_ascii_alphanumeric() || "/_-= ".contains(letter));
        (plain && KEYS.contains(&key)).then(|| (key.to_owned(), value.to_owned()))
    };
    let entries: Option<Vec<_>> = parts.map(entry).collect();
    let entries = entries.filter(|_| !topic.is_empty());
    entries
        .map(|entries| Attitude { topic, entries })
        .ok_or_else(|| format!("expected a topic and entries {}=VALUE between commas", KEYS.join("=VALUE, ")))
}

/// Chain that the robot description of `--urdf` defines; `None` without one.
fn described_chain(arguments: &NewArguments, log: Option<&FlightLog>) -> Result<Option<DescribedChain>> {
    let (Some(urdf), Some((imu, camera, axes))) = (&arguments.urdf, arguments.links.given()) else {
        return Ok(None);
    };
    let model = match (urdf.to_str().and_then(|text| text.strip_prefix("topic:")), log) {
        (Some(topic), Some(log)) => RobotModel::of_topic(log, topic)?,
        (Some(topic), None) => bail!("--urdf topic:{topic} needs a log"),
        (None, _) => RobotModel::read(urdf)?,
    };
    let path = model.path(imu, camera, axes)?;
    Ok(Some(path.described(arguments.links.camera_axes.is_some())))
}

pub(crate) fn rig(arguments: &RigArguments) -> Result<ExitOutcome> {
    let RigCommand::New(arguments) = &arguments.command;
    if arguments.list {
        let names: Vec<&str> = PublishedCamera::ALL.iter().map(|camera| camera.name()).collect();
        return print(&format!("{}\n", names.join("\n"))).map(|()| ExitOutcome::Success);
    }
    let (Some(camera), true) = (&arguments.camera, arguments.mechanism.is_some() || arguments.urdf.is_some()) else {
        bail!("--mechanism and --camera are missing");
    };
    let log = arguments.log.as_ref().map(|log| FlightLog::open_with(log, &arguments.limits.limits())).transpose()?;
    let described = described_chain(arguments, log.as_ref())?;
    let beside = arguments.log.as_ref().map(|log| log.with_extension("rig.yaml"));
    let Some(output) = arguments.output.clone().or(beside) else { bail!("-o FILE is missing") };
    let stem = output.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let choices = RigChoices {
        name: stem.split('.').next().unwrap_or_default().to_owned(),
        camera: camera.clone(),
        resolution_px: arguments.size,
        mechanism: arguments.mechanism.clone().unwrap_or(MechanismAxes(Vec::new())),
        described,
        positive: arguments.positive,
        imu_axes: arguments.imu_axes,
        position_m: arguments.at.map(Into::into),
        imu_topic: arguments.imu_topic.clone(),
        gimbal_imu_topic: arguments.gimbal_imu_topic.clone(),
        gimbal_imu_axes: arguments.gimbal_imu_axes,
        image_topic: arguments.image_topic.clone(),
        joint_topic: arguments.joint_topic.clone(),
        joint_names: arguments.joints.clone(),
        attitude: arguments.attitude.clone().map(|attitude| (attitude.topic, attitude.entries)),
        noise: None,
    };
    let template = RigTemplate::new(&choices, log.as_ref())?;
    export::write_new_rig(&output, &template.to_yaml(), arguments.force)?;
    let fields = template.assumed_fields();
    let assumed: Vec<String> =
        fields.iter().map(|assumed| format!("  {:<34}{}\n", assumed.field, assumed.reason)).collect();
    print(&format!("{}\nassumed, to be measured or confirmed:\n{}", output.display(), assumed.concat()))?;
    Ok(ExitOutcome::Success)
}
