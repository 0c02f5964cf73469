//! The command line: one spelling and one set of defaults for all sub-commands.

use std::ops::RangeInclusive;
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use dcvins::session::accuracy::{Alignment, RelativeDelta};
use dcvins::session::breakpoints::Condition;
use dcvins::session::{RunSpec, SessionRequest};

use crate::cli::degeneracy::DegeneracyArguments;

/// Debugger for visual-inertial navigation with a camera on a gimbal.
#[derive(Debug, Parser)]
#[command(version, about, propagate_version = true)]
pub(crate) struct Arguments {
    /// What to do; without a command the window opens.
    #[command(subcommand)]
    pub command: Option<Command>,
}

/// The sub-commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Open the window on a log; without a display, write the pictures instead and say where.
    View(ViewArguments),
    /// Run the estimator over a log without a window and write its files.
    Run(RunArguments),
    /// Draw one panel at one instant into a PNG, without a display.
    #[cfg(feature = "gui")]
    Screenshot(ScreenshotArguments),
    /// Write a report on a log: one HTML file with pictures and tables, with CSV and JSON beside it.
    Report(ReportArguments),
    /// Calibrate static camera and gimbal offline from a flight with both, as the paper's baseline does.
    Calibrate(CalibrateArguments),
    /// Say what is in a log and what is wrong with it, before anyone trusts a result.
    Check(CheckArguments),
    /// Write a synthetic flight with known truth: the log, its rig and its truth.
    Simulate(SimulateArguments),
    /// Tell which calibration parameters a mechanism, its parameterization and a motion can identify, without a log.
    Degeneracy(DegeneracyArguments),
    /// Turn a EuRoC/ASL folder, a ROS 1 bag or a ROS 2 bag into a log.
    Convert(ConvertArguments),
    /// Compare a trajectory with a reference: absolute and relative errors, as evo computes them.
    Evaluate(EvaluateArguments),
}

/// The runs and the stretch of the log, shared by everything that estimates.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct EstimationArguments {
    /// A run over the log: NAME[:key=value,…], NAME one of auto, minimal, minimal-swapped, classical, poe, static,
    /// cluster; keys encoder=on|off, calibrate=on|off, timeshift=on|off, first-estimates=on|off, window=N,
    /// camera=KEY, name=LABEL. Up to four.
    #[arg(long = "run", value_name = "SPEC")]
    pub runs: Vec<RunSpec>,
    /// The rig, when it is not beside the log (LOG with .rig.yaml) or attached to it.
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    /// The rig's true values, when they are not beside the log (LOG with .truth.yaml).
    #[arg(long, value_name = "FILE")]
    pub truth: Option<PathBuf>,
    /// Leave out this many seconds at the begin of the log.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0, value_parser = seconds)]
    pub start: f64,
    /// Read this many seconds from there.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub duration: Option<f64>,
}

impl EstimationArguments {
    /// The session that these arguments ask for.
    pub(crate) fn request(&self, log_path: PathBuf) -> SessionRequest {
        SessionRequest {
            log_path,
            rig_path: self.rig.clone(),
            truth_path: self.truth.clone(),
            specs: self.runs.clone(),
            start_s: self.start,
            duration_s: self.duration,
        }
    }
}

/// `dcvins view`.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct ViewArguments {
    /// The log; without one the window welcomes with the sample logs and the recent files.
    pub log: Option<PathBuf>,
    /// Where the pictures go when there is no display [default: dcvins-output/NAME].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub estimation: EstimationArguments,
}

/// `dcvins run`.
#[derive(Args, Clone, Debug)]
pub(crate) struct RunArguments {
    /// The log.
    pub log: PathBuf,
    /// Folder for the files; each run gets a folder of its name in it.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    #[command(flatten)]
    pub estimation: EstimationArguments,
    /// Stop where this comes true in a run, as in "rank < 18 or features < 40", write what there is up to there and tell
    /// the values; README.md lists what can be asked for.
    #[arg(long = "break", value_name = "CONDITION", value_parser = condition)]
    pub break_at: Option<Condition>,
    /// Leave the measured times out of frames.csv and summary.json, so that two runs give the same bytes in every file.
    #[arg(long)]
    pub no_timing: bool,
    /// Also write results.mcap for Foxglove and Rerun: poses, frames of the chain, image annotations, landmarks,
    /// calibration and rank over time.
    #[arg(long)]
    pub mcap: bool,
    /// Also write trajectory.euroc.csv, a table like EuRoC's ground truth.
    #[arg(long)]
    pub euroc: bool,
    /// Print the summaries as JSON instead of a table.
    #[arg(long)]
    pub json: bool,
}

/// `dcvins screenshot`.
#[cfg(feature = "gui")]
#[derive(Args, Clone, Debug)]
pub(crate) struct ScreenshotArguments {
    /// The log, or a saved session (LOG.session.json) with its forks and breakpoints.
    pub log: PathBuf,
    /// Seconds since the first message of the log; may be given several times. Several pictures get their time into their
    /// names.
    #[arg(long, value_name = "SECONDS", value_parser = seconds, required_unless_present = "every")]
    pub at: Vec<f64>,
    /// A picture every so many seconds from the begin to the end (or from --start, for --duration).
    #[arg(long, value_name = "SECONDS", value_parser = period)]
    pub every: Option<f64>,
    /// Which panel; `all` is the whole window.
    #[arg(long, value_name = "NAME", default_value = "all")]
    pub panel: String,
    /// Layout of the whole window, as its keys 1 to 5: overview, calibration, front end, scene, comparison.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=5))]
    pub layout: u8,
    /// The picture to write: a PNG, or with .svg a drawing of lines and texts.
    #[arg(short, long, value_name = "FILE.png")]
    pub output: PathBuf,
    /// What is written, when the file's name does not say it.
    #[arg(long, value_enum)]
    pub format: Option<FormatArgument>,
    /// Also write what the panel shows as a table of comma-separated values, beside the picture.
    #[arg(long)]
    pub csv: bool,
    /// Size of the picture in pixels.
    #[arg(long, value_name = "WxH", default_value = "1920x1080", value_parser = size)]
    pub size: [usize; 2],
    /// Pixels per point: 2 draws everything twice as large.
    #[arg(long, value_name = "N", default_value_t = 1.0, value_parser = scale)]
    pub scale: f32,
    /// Colours.
    #[arg(long, value_enum, default_value_t = ThemeArgument::Light)]
    pub theme: ThemeArgument,
    /// Who draws: cpu needs no driver and gives the same bytes everywhere, wgpu uses a graphics adapter.
    #[arg(long, value_enum, default_value_t = RendererArgument::Cpu)]
    pub renderer: RendererArgument,
    /// Move the first run's chain along a direction: its number in the rank panel (1 is the weakest), a known one
    /// (base-d, end-theta, …) or a parameter by name, and how far in units of 10° and 3 cm. Scene and image show what
    /// comes of it.
    #[arg(long, value_name = "DIRECTION=VALUE")]
    pub slide: Option<dcvins::observability::SlideRequest>,
    #[command(flatten)]
    pub estimation: EstimationArguments,
}

/// What `--format` may say.
#[cfg(feature = "gui")]
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FormatArgument {
    /// Pixels.
    Png,
    /// Lines and texts.
    Svg,
}

/// Names of the renderers.
#[cfg(feature = "gui")]
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum RendererArgument {
    /// The program itself.
    Cpu,
    /// A graphics adapter.
    Wgpu,
}

/// Names of the themes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ThemeArgument {
    /// Dark on light.
    Light,
    /// Light on dark.
    Dark,
    /// For paper.
    Print,
}

/// `dcvins report`.
#[derive(Args, Clone, Debug)]
pub(crate) struct ReportArguments {
    /// The log.
    pub log: PathBuf,
    /// Folder for report.html, report.json and the files of each run.
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// An instant to be pictured, in seconds since the first message of the log; may be given several times [default: the
    /// end].
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub at: Vec<f64>,
    #[command(flatten)]
    pub estimation: EstimationArguments,
}

/// `dcvins calibrate`.
#[derive(Args, Clone, Debug)]
pub(crate) struct CalibrateArguments {
    /// The log; its rig names a static camera, a gimbal camera and encoders.
    pub log: PathBuf,
    /// Folder for rig.yaml, calibration.json and report.txt.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// The rig, when it is not beside the log (LOG with .rig.yaml) or attached to it.
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    /// The rig's true values, when they are not beside the log (LOG with .truth.yaml).
    #[arg(long, value_name = "FILE")]
    pub truth: Option<PathBuf>,
    /// Leave out this many seconds at the begin of the log.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0, value_parser = seconds)]
    pub start: f64,
    /// Read this many seconds from there.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub duration: Option<f64>,
    /// Print calibration.json instead of the report.
    #[arg(long)]
    pub json: bool,
}

/// `dcvins check`.
#[derive(Args, Clone, Debug)]
pub(crate) struct CheckArguments {
    /// The log.
    pub log: PathBuf,
    /// The rig, when it is not beside the log or attached to it.
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    /// Print the findings as JSON.
    #[arg(long)]
    pub json: bool,
}

/// `dcvins simulate`.
#[derive(Args, Clone, Debug)]
pub(crate) struct SimulateArguments {
    /// The paper's experiment: T1, T2, T3 or T4.
    #[arg(value_name = "EXPERIMENT", ignore_case = true)]
    pub experiment: ExperimentArgument,
    /// The log to write; its rig and truth get the same name with .rig.yaml and .truth.yaml.
    #[arg(short, long, value_name = "LOG.mcap")]
    pub output: PathBuf,
    /// Seed of every random number.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Length of the flight [default: the experiment's].
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub duration: Option<f64>,
    /// Standard deviation of the encoders in degrees, or none [default: the experiment's].
    #[arg(long, value_name = "D|none", value_parser = encoder_sigma)]
    pub encoder_sigma_deg: Option<EncoderArgument>,
    /// Size of the images in pixels; the field of view stays the same.
    #[arg(long, value_name = "WxH", default_value = "640x480", value_parser = image_size)]
    pub size: [usize; 2],
    /// Images per second.
    #[arg(long, value_name = "HZ", default_value_t = 20.0)]
    pub rate: f64,
    /// Record the camera on the gimbal alone: half the work and half the bytes of a long flight.
    #[arg(long)]
    pub no_static_camera: bool,
    /// Something that goes wrong, in seconds and SI units; may be given several times: camera-offset=S, joint-lag=S,
    /// joint-start=S, image-gap=START,LENGTH, exposure=S, gyroscope-range=RAD/S, accelerometer-range=M/S²,
    /// light=START,FACTOR, blank=START,LENGTH, slew=START,LENGTH, spin=START,LENGTH,RAD/S, hold-joint=NUMBER,START,LENGTH,
    /// hover=START,LENGTH, stabilize=START,LENGTH.
    #[arg(long, value_name = "KEY=VALUE[,VALUE…]")]
    pub disturb: Vec<String>,
}

/// Names of the experiments.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ExperimentArgument {
    /// The paper's T1.
    T1,
    /// The paper's T2.
    T2,
    /// The paper's T3.
    T3,
    /// The paper's T4.
    T4,
}

/// What `--encoder-sigma-deg` may say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum EncoderArgument {
    /// No encoders in the log.
    None,
    /// White noise of this standard deviation, in degrees.
    Sigma(f64),
}

/// `dcvins convert`.
#[derive(Args, Clone, Debug)]
pub(crate) struct ConvertArguments {
    /// A EuRoC/ASL folder (with mav0), a ROS 1 bag, or a ROS 2 bag: its folder, one .db3 or one .mcap.
    pub source: PathBuf,
    /// The log to write; the rig, where the source describes one, gets the same name with .rig.yaml.
    #[arg(short, long, value_name = "LOG.mcap")]
    pub output: PathBuf,
    /// Print what was taken and what was left as JSON.
    #[arg(long)]
    pub json: bool,
}

/// `dcvins evaluate`.
#[derive(Args, Clone, Debug)]
pub(crate) struct EvaluateArguments {
    /// The trajectory to judge: t x y z qx qy qz qw.
    pub estimate: PathBuf,
    /// The trajectory to judge it by.
    pub reference: PathBuf,
    /// How the estimate is laid on the reference.
    #[arg(long, value_enum, default_value_t = AlignArgument::Se3)]
    pub align: AlignArgument,
    /// Length of the stretches of the relative error: frames (5f) or metres (10m).
    #[arg(long, value_name = "Nf|Xm", default_value = "1f", value_parser = delta)]
    pub delta: RelativeDelta,
    /// Largest difference of two stamps that count as the same instant.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.01, value_parser = seconds)]
    pub max_difference: f64,
    /// Print the result as JSON.
    #[arg(long)]
    pub json: bool,
}

/// Names of the alignments.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum AlignArgument {
    /// Leave the estimate where it is.
    None,
    /// Rotation about the vertical and a shift.
    Yaw,
    /// Rotation and a shift (evo's --align).
    Se3,
    /// Rotation, shift and scale (evo's `--align --correct_scale`).
    Sim3,
}

impl From<AlignArgument> for Alignment {
    fn from(argument: AlignArgument) -> Self {
        match argument {
            AlignArgument::None => Self::None,
            AlignArgument::Yaw => Self::YawPosition,
            AlignArgument::Se3 => Self::Rigid,
            AlignArgument::Sim3 => Self::Similarity,
        }
    }
}

fn condition(text: &str) -> Result<Condition, String> {
    text.parse::<Condition>().map_err(|problem| problem.to_string())
}

fn seconds(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|value| value.is_finite() && *value >= 0.0);
    value.ok_or_else(|| "expected seconds, a number from 0 up".to_owned())
}

#[cfg(feature = "gui")]
fn period(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|value| value.is_finite() && *value >= 1e-3);
    value.ok_or_else(|| "expected seconds, a number from 0.001 up".to_owned())
}

#[cfg(feature = "gui")]
fn scale(text: &str) -> Result<f32, String> {
    let value = text.parse::<f32>().ok().filter(|value| (0.25..=8.0).contains(value));
    value.ok_or_else(|| "expected a number from 0.25 to 8".to_owned())
}

#[cfg(feature = "gui")]
fn size(text: &str) -> Result<[usize; 2], String> {
    sides(text, 64..=8192).ok_or_else(|| "expected WIDTHxHEIGHT, each from 64 to 8192, as in 1920x1080".to_owned())
}

fn image_size(text: &str) -> Result<[usize; 2], String> {
    sides(text, 32..=4096).ok_or_else(|| "expected WIDTHxHEIGHT, each from 32 to 4096, as in 640x480".to_owned())
}

fn sides(text: &str, range: RangeInclusive<usize>) -> Option<[usize; 2]> {
    let parse = |side: &str| side.parse::<usize>().ok().filter(|side| range.contains(side));
    text.split_once('x').and_then(|(width, height)| Some([parse(width)?, parse(height)?]))
}

fn encoder_sigma(text: &str) -> Result<EncoderArgument, String> {
    if text == "none" {
        return Ok(EncoderArgument::None);
    }
    let value = text.parse::<f64>().ok().filter(|value| value.is_finite() && *value > 0.0);
    value.map(EncoderArgument::Sigma).ok_or_else(|| "expected degrees, a number above 0, or none".to_owned())
}

fn delta(text: &str) -> Result<RelativeDelta, String> {
    let frames = text.strip_suffix('f').and_then(|number| number.parse::<usize>().ok()).filter(|number| *number > 0);
    let metres = text.strip_suffix('m').and_then(|number| number.parse::<f64>().ok()).filter(|number| *number > 0.0);
    frames
        .map(RelativeDelta::Frames)
        .or_else(|| metres.map(RelativeDelta::Metres))
        .ok_or_else(|| "expected frames as in 5f, or metres as in 10m".to_owned())
}
