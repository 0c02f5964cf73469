//! `dcvins export`: a rig as the configuration of another program, or as a robot description.

use dcvins::files::RigFile as _;
use dcvins::flight_log::RigOfLog as _;
use std::path::PathBuf;
use std::sync::Arc;

use anyhow::Result;
use clap::{Args, ValueEnum};
use dcvins::files::urdf::RobotModel;
use dcvins::flight_log::FlightLog;
use dcvins::interop::{
    Configuration, FixedJointAngles, OtherEstimator, calibrated_description, configure, robot_description,
    write_configuration,
};
use dcvins::sensors::{CameraMount, Rig};
use dcvins::text::{Entry, FINITE, Named as _, log_name};
use serde::Serialize;

use crate::cli::shared_arguments::{LimitArguments, RobotLinkArguments, seconds};
use crate::cli::terminal::{print, print_json};

#[derive(Args, Clone, Debug)]
pub(crate) struct ExportArguments {
    /// The rig, or a log (.mcap) with its rig next to it or attached to it.
    pub rig: PathBuf,
    /// Program or format to write for.
    #[arg(long = "to", value_enum, value_name = "PROGRAM")]
    pub program: ProgramArgument,
    /// Folder for the files.
    #[arg(short = 'o', long, visible_alias = "output", value_name = "DIR")]
    pub out: PathBuf,
    /// A camera of the rig, in the order of the program's cameras [default: all; the first for vins-fusion and orb-slam3].
    #[arg(long = "camera", value_name = "KEY")]
    pub cameras: Vec<String>,
    /// Fixed angles of the gimbal in degrees, as in yaw=10,pitch=-30; other joints stay neutral, at 0 or at the limit
    /// nearest to it.
    #[arg(long, value_name = "NAME=DEG,…", value_delimiter = ',', value_parser = joint_angle, conflicts_with = "at")]
    pub joints: Vec<(String, f64)>,
    /// Use the joint angles measured in the log at this time.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub at: Option<f64>,
    /// The log for --at, and for intrinsics and rates that are missing in the rig.
    #[arg(long, value_name = "LOG")]
    pub log: Option<PathBuf>,
    /// With --to urdf: write the calibrated chain into this robot description. Only the origins of its joints change.
    #[arg(long, value_name = "FILE", requires = "imu_link", requires = "camera_link")]
    pub urdf: Option<PathBuf>,
    #[command(flatten)]
    pub links: RobotLinkArguments,
    /// Overwrite files that were not written by this command.
    #[arg(long)]
    pub force: bool,
    /// Print paths and notes as JSON.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub limits: LimitArguments,
}

/// Program or format that `--to` names.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ProgramArgument {
    /// Camera chain and IMU.
    Kalibr,
    /// Configuration with one camera, or with two as a stereo pair.
    VinsFusion,
    /// Estimator, camera chain and IMU.
    #[value(name = "openvins")]
    OpenVins,
    /// Calibration of cameras and IMU.
    Basalt,
    /// Settings for one camera and the IMU.
    #[value(name = "orb-slam3")]
    OrbSlam3,
    /// Robot description with the joints of the gimbal.
    Urdf,
}

impl ProgramArgument {
    /// Estimator whose configuration is written; `None` for a robot description.
    fn estimator(self) -> Option<OtherEstimator> {
        Some(match self {
            Self::Kalibr => OtherEstimator::Kalibr,
            Self::VinsFusion => OtherEstimator::VinsFusion,
            Self::OpenVins => OtherEstimator::OpenVins,
            Self::Basalt => OtherEstimator::Basalt,
            Self::OrbSlam3 => OtherEstimator::OrbSlam3,
            Self::Urdf => return None,
        })
    }
}

fn joint_angle(text: &str) -> Result<(String, f64), String> {
    let entry = Entry::parse(text).map(Entry::trimmed).filter(|entry| !entry.key.is_empty());
    entry
        .and_then(|entry| Some((entry.key.to_owned(), entry.number(&FINITE)?)))
        .ok_or_else(|| "expected a joint and its angle in degrees, as in pitch=-30".to_owned())
}

/// Output of the command with `--json`.
#[derive(Serialize)]
struct Written<'a> {
    program: &'static str,
    joint_angles_rad: &'a [f64],
    files: Vec<String>,
    notes: &'a [String],
}

pub(crate) fn export(arguments: &ExportArguments) -> Result<()> {
    let is_log = arguments.rig.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("mcap"));
    let log_path = arguments.log.as_ref().or_else(|| is_log.then_some(&arguments.rig));
    let limits = arguments.limits.limits();
    let log = log_path.map(|path| FlightLog::open_with(path, &limits)).transpose()?.map(Arc::new);
    let rig_path = Some(arguments.rig.as_path()).filter(|_| !is_log);
    let rig = match (&log, rig_path) {
        (Some(log), rig_path) => Rig::for_log(log, rig_path)?,
        (None, _) => Rig::from_file(&arguments.rig)?,
    };
    let Some(program) = arguments.program.estimator() else {
        return written(arguments, "URDF", &[], &description(arguments, &rig)?);
    };
    if arguments.urdf.is_some() {
        anyhow::bail!("--urdf is for --to urdf");
    }
    let angles = match (arguments.at, &log) {
        (Some(time_s), Some(log)) => FixedJointAngles::measured(log, &rig, time_s)?,
        (Some(_), None) => anyhow::bail!("--at needs a log: give it with --log LOG"),
        (None, _) if arguments.joints.is_empty() => FixedJointAngles::neutral(&rig),
        (None, _) => FixedJointAngles::given(&rig, &arguments.joints)?,
    };
    let configuration = configure(&rig, program, &arguments.cameras, &angles)?;
    written(arguments, program.name(), &angles.angles_rad, &configuration)
}

/// Robot description of the rig, or the given one with the calibrated chain.
fn description(arguments: &ExportArguments, rig: &Rig) -> Result<Configuration> {
    if arguments.at.is_some() || !arguments.joints.is_empty() {
        anyhow::bail!("a robot description has the joints themselves: leave --joints and --at out");
    }
    let (Some(file), Some((imu, link, axes))) = (&arguments.urdf, arguments.links.given()) else {
        return Ok(robot_description(rig, &arguments.cameras)?);
    };
    let camera = match arguments.cameras.as_slice() {
        [] => rig.cameras.iter().find(|camera| camera.mount == CameraMount::Gimbal).or_else(|| rig.cameras.first()),
        [key] => Some(rig.camera(key)?),
        _ => anyhow::bail!("--camera: one camera belongs to --camera-link"),
    };
    let camera = camera.ok_or_else(|| anyhow::anyhow!("the rig has no camera"))?;
    let model = RobotModel::read(file)?;
    let path = model.path(imu, link, axes)?;
    Ok(calibrated_description(rig, camera, &path, &log_name(file))?)
}

/// Writes the files and prints their paths and notes.
fn written(
    arguments: &ExportArguments,
    program: &'static str,
    joint_angles_rad: &[f64],
    configuration: &Configuration,
) -> Result<()> {
    let paths = write_configuration(configuration, &arguments.out, arguments.force)?;
    let files: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
    if arguments.json {
        return print_json(&Written { program, joint_angles_rad, files, notes: &configuration.notes });
    }
    let files = files.iter().map(|file| format!("{file}\n")).collect::<Vec<_>>().concat();
    let notes = configuration.notes.iter().map(|note| format!("  {note}\n")).collect::<Vec<_>>().concat();
    let head = if arguments.urdf.is_some() { "notes:" } else { "notes, also at the head of the files:" };
    print(&format!("{files}{head}\n{notes}"))
}
