//! The sub-commands, and the arguments and value parsers that several of them share.

use std::ops::RangeInclusive;
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};
use dcvins::session::{RunSpec, SessionRequest};

use crate::cli::calibrate::CalibrateArguments;
use crate::cli::check::CheckArguments;
use crate::cli::convert::ConvertArguments;
use crate::cli::degeneracy::DegeneracyArguments;
use crate::cli::evaluate::EvaluateArguments;
use crate::cli::report::ReportArguments;
use crate::cli::run::RunArguments;
#[cfg(feature = "gui")]
use crate::cli::screenshot::ScreenshotArguments;
use crate::cli::simulate::SimulateArguments;
use crate::cli::view::ViewArguments;

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
    /// Open the window on a log; without a display, write screenshots instead and print their paths.
    View(ViewArguments),
    /// Run the estimator over a log without a window and write its files.
    Run(RunArguments),
    /// Draw one panel at one instant into a PNG, without a display.
    #[cfg(feature = "gui")]
    Screenshot(ScreenshotArguments),
    /// Write a report on a log: one HTML file with figures and tables, with CSV and JSON beside it.
    Report(ReportArguments),
    /// Calibrate static camera and gimbal offline from a flight with both, as the paper's baseline does.
    Calibrate(CalibrateArguments),
    /// Check a log and its rig: content, timing, calibration, noise, each finding with evidence and remedy.
    Check(CheckArguments),
    /// Write a synthetic flight: the log, its rig and the ground truth.
    Simulate(SimulateArguments),
    /// Compute which calibration parameters are observable with a mechanism, a parameterization and a motion, without a log.
    Degeneracy(DegeneracyArguments),
    /// Convert a EuRoC/ASL folder, a ROS 1 bag or a ROS 2 bag into a log.
    Convert(ConvertArguments),
    /// Compare a trajectory with a reference: absolute and relative errors, as evo computes them.
    Evaluate(EvaluateArguments),
}

/// Runs, rig, ground truth and time range, shared by the sub-commands that run the estimator.
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
    /// The ground truth of the rig, when it is not beside the log (LOG with .truth.yaml).
    #[arg(long = "truth", value_name = "FILE")]
    pub ground_truth: Option<PathBuf>,
    /// Skip this many seconds at the start of the log.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0, value_parser = seconds)]
    pub start: f64,
    /// Duration to process from there.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub duration: Option<f64>,
}

impl EstimationArguments {
    /// The session that these arguments ask for.
    pub(crate) fn request(&self, log_path: PathBuf) -> SessionRequest {
        SessionRequest {
            log_path,
            rig_path: self.rig.clone(),
            ground_truth_path: self.ground_truth.clone(),
            specs: self.runs.clone(),
            start_s: self.start,
            duration_s: self.duration,
        }
    }
}

/// Parses a time or a duration in seconds, 0 or more.
pub(crate) fn seconds(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|value| value.is_finite() && *value >= 0.0);
    value.ok_or_else(|| "expected seconds, a number from 0 up".to_owned())
}

/// Parses `WIDTHxHEIGHT`, both within `range`, in pixels.
pub(crate) fn sides(text: &str, range: RangeInclusive<usize>) -> Option<[usize; 2]> {
    let parse = |side: &str| side.parse::<usize>().ok().filter(|side| range.contains(side));
    text.split_once('x').and_then(|(width, height)| Some([parse(width)?, parse(height)?]))
}
