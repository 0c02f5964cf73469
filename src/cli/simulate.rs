//! `dcvins simulate`: a synthetic flight with ground truth.

use dcvins::files::RigFile as _;
use std::path::PathBuf;

use anyhow::Result;
use clap::{Args, ValueEnum};
use dcvins::export;
use dcvins::sensors::Rig;
use dcvins::simulated_log::{self, Disturbances, SimulationError, SimulationOptions};
use dcvins::simulation::{Experiment, WorldKind};
use dcvins::text::key_list;

use crate::cli::exit::ExitOutcome;
use crate::cli::interrupt::Interrupt;
use crate::cli::shared_arguments::{seconds, sides};
use crate::cli::terminal::{Progress, notify, print};

#[derive(Args, Clone, Debug)]
pub(crate) struct SimulateArguments {
    /// The paper's experiment: T1, T2, T3 or T4.
    #[arg(value_name = "EXPERIMENT", ignore_case = true)]
    pub experiment: ExperimentArgument,
    /// The log to write; its rig and the ground truth of the rig get the same name with .rig.yaml and .truth.yaml.
    #[arg(short, long, visible_alias = "out", value_name = "LOG.mcap")]
    pub output: PathBuf,
    /// Surfaces that have a texture.
    #[arg(long, value_enum, value_name = "KIND", default_value = "textured")]
    pub world: WorldArgument,
    /// Swing the vehicle's heading by up to this angle in degrees to both sides of what there is to see, every 8 s, while
    /// the gimbal keeps pointing at it: the house in T1 and T2, the street ahead in T3 and T4 [default: the
    /// experiment's heading and gimbal].
    #[arg(long, value_name = "DEG", value_parser = swing, conflicts_with = "motion")]
    pub swing: Option<f64>,
    /// Mirror the path, so that T1 circles to the right instead of to the left.
    #[arg(long)]
    pub mirror: bool,
    /// Seed of the random numbers.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Duration of the flight [default: the experiment's].
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub duration: Option<f64>,
    /// Standard deviation of the encoders in degrees, or none [default: the experiment's].
    #[arg(long, value_name = "D|none", value_parser = encoder_sigma)]
    pub encoder_sigma_deg: Option<EncoderArgument>,
    /// Size of the images in pixels; the field of view stays the same.
    #[arg(long, value_name = "WxH", default_value = "640x480", value_parser = image_size)]
    pub size: [usize; 2],
    /// Frame rate of the cameras in Hz.
    #[arg(long, value_name = "HZ", default_value_t = 20.0)]
    pub rate: f64,
    /// Frame rate of the static camera in Hz [default: the rate of --rate].
    #[arg(long, value_name = "HZ", conflicts_with = "no_static_camera")]
    pub camera_rate: Option<f64>,
    /// Time in milliseconds by which the static camera exposes its images later than the gimbal camera: cameras that are
    /// not triggered together.
    #[arg(long, value_name = "MS", default_value_t = 0.0, conflicts_with = "no_static_camera")]
    pub camera_phase: f64,
    /// Add a second static camera this many metres to the right of the static one: a stereo pair.
    #[arg(long, value_name = "BASELINE", conflicts_with_all = ["no_static_camera", "rig"])]
    pub stereo: Option<f64>,
    /// Add a second camera on the gimbal, with a longer focal length.
    #[arg(long, value_enum, value_name = "KIND", conflicts_with = "rig")]
    pub gimbal_camera: Option<GimbalCameraArgument>,
    /// Omit the static camera: half the computing time and half the file size.
    #[arg(long)]
    pub no_static_camera: bool,
    /// Add an IMU on the gimbal, which the rig has as imu1; the factor multiplies the noise and biases of the vehicle's
    /// IMU.
    #[arg(long, value_name = "FACTOR", num_args = 0..=1, require_equals = true, default_missing_value = "1")]
    pub gimbal_imu: Option<f64>,
    /// Overwrite any existing log, rig or ground truth of that name. Without it, only a simulated log with its
    /// unmodified rigs is replaced.
    #[arg(long)]
    pub force: bool,
    /// Fly the motion of this table instead, from the start of the experiment's route: `t_s`, `NAME_rad` of each joint,
    /// `x_m` (forward), `y_m` (left), `z_m` (up), `heading_rad`; `dcvins plan` writes one.
    #[arg(long, value_name = "FILE.csv", conflicts_with = "mirror")]
    pub motion: Option<PathBuf>,
    /// Fly a motion with the mechanism, cameras and noise of this rig. Its chain is the ground truth; the chain of the
    /// written rig has random errors within its prior.
    #[arg(long, value_name = "FILE", requires = "motion", conflicts_with_all = ["size", "rate", "camera_rate", "gimbal_imu"])]
    pub rig: Option<PathBuf>,
    #[arg(long, value_name = "KEY=VALUE[,VALUE…]", help = disturb_help())]
    pub disturb: Vec<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ExperimentArgument {
    /// The paper's experiment T1.
    T1,
    /// The paper's experiment T2.
    T2,
    /// The paper's experiment T3.
    T3,
    /// The paper's experiment T4.
    T4,
}

/// Cameras that `--gimbal-camera` adds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum GimbalCameraArgument {
    /// Below the other one, with a field of view of 62° instead of 83°.
    Thermal,
}

/// Surfaces with texture, as `--world` names them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum WorldArgument {
    /// Texture in every direction.
    Textured,
    /// T1 and T2: a house on even ground with nothing else to see.
    Plain,
    /// T3 and T4: texture on buildings alone.
    Facades,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum EncoderArgument {
    /// No encoders in the log.
    None,
    /// White noise of this standard deviation, in degrees.
    Sigma(f64),
}

fn disturb_help() -> String {
    let keys = key_list(Disturbances::KEYS);
    format!("A disturbance, in seconds and SI units; may be given several times: {keys}")
}

fn swing(text: &str) -> Result<f64, String> {
    let swing_deg = text.parse::<f64>().ok().filter(|swing_deg| (0.0..=90.0).contains(swing_deg));
    swing_deg.ok_or_else(|| "expected degrees from 0 to 90".to_owned())
}

fn image_size(text: &str) -> Result<[usize; 2], String> {
    sides(text, 32..=4096).ok_or_else(|| "expected WIDTHxHEIGHT, each from 32 to 4096, as in 640x480".to_owned())
}

fn encoder_sigma(text: &str) -> Result<EncoderArgument, String> {
    if text == "none" {
        return Ok(EncoderArgument::None);
    }
    let value = text.parse::<f64>().ok().filter(|value| value.is_finite() && *value > 0.0);
    value.map(EncoderArgument::Sigma).ok_or_else(|| "expected degrees, a number above 0, or none".to_owned())
}

pub(crate) fn simulate(arguments: &SimulateArguments) -> Result<ExitOutcome> {
    let experiment = match arguments.experiment {
        ExperimentArgument::T1 => Experiment::T1,
        ExperimentArgument::T2 => Experiment::T2,
        ExperimentArgument::T3 => Experiment::T3,
        ExperimentArgument::T4 => Experiment::T4,
    };
    let mut options = SimulationOptions::new(experiment);
    if let Some(path) = &arguments.rig {
        options = options.with_rig(Rig::from_file(path)?);
    }
    options.world = match arguments.world {
        WorldArgument::Textured => WorldKind::Textured,
        WorldArgument::Plain => WorldKind::Plain,
        WorldArgument::Facades => WorldKind::Facades,
    };
    options.swing_rad = arguments.swing.map(f64::to_radians);
    options.mirrored = arguments.mirror;
    options.seed = arguments.seed;
    options.duration_s = arguments.duration;
    options.resolution_px = arguments.size;
    options.camera_rate_hz = arguments.rate;
    options.static_camera_rate_hz = arguments.camera_rate;
    options.static_camera_phase_s = 1e-3 * arguments.camera_phase;
    options.static_camera = !arguments.no_static_camera;
    options.stereo_baseline_m = arguments.stereo;
    options.second_gimbal_camera = arguments.gimbal_camera.is_some();
    options.gimbal_imu_noise_scale = arguments.gimbal_imu;
    match arguments.encoder_sigma_deg {
        Some(EncoderArgument::None) => options.encoder_sigma_rad = None,
        Some(EncoderArgument::Sigma(sigma_deg)) => options.encoder_sigma_rad = Some(sigma_deg.to_radians()),
        None => {}
    }
    for disturbance in &arguments.disturb {
        options.disturbances.set(disturbance)?;
    }
    options.motion = arguments.motion.as_deref().map(export::read_motion).transpose()?;
    let interrupt = Interrupt::watch()?;
    export::check_simulated_log(&arguments.output, arguments.force)?;
    let progress = Progress::new();
    let simulated = simulated_log::simulate_interruptible(&options, &arguments.output, &mut |at| {
        let ratio = at.images_done as f64 / at.images_total.max(1) as f64;
        progress.show(ratio, || format!("{} of {} images", at.images_done, at.images_total));
        interrupt.control_flow()
    });
    drop(progress);
    let summary = match simulated {
        Err(error @ SimulationError::Interrupted { .. }) => {
            notify(&format!("dcvins: {error}"));
            return Ok(ExitOutcome::Interrupted);
        }
        simulated => simulated?,
    };
    let (translation_m, rotation_rad) = summary.given_chain_error;
    print(&format!(
        "{}: {:.1} s, {:.1} m, {} images; extrinsics error of the given chain: {:.1} mm, {:.2}°\n{}\n{}\n",
        summary.log.display(),
        summary.duration_s,
        summary.path_length_m,
        summary.images,
        translation_m * 1e3,
        rotation_rad.to_degrees(),
        summary.rig.display(),
        summary.ground_truth.display(),
    ))?;
    Ok(ExitOutcome::Success)
}
