//! The arguments of the program: its sub-commands and its version.

use std::sync::LazyLock;

use clap::{Parser, Subcommand};

use crate::cli::calibrate::CalibrateArguments;
use crate::cli::check::CheckArguments;
use crate::cli::convert::ConvertArguments;
use crate::cli::degeneracy::DegeneracyArguments;
use crate::cli::diagnose::DiagnoseArguments;
use crate::cli::evaluate::EvaluateArguments;
use crate::cli::excerpt::ExcerptArguments;
use crate::cli::exit;
use crate::cli::export::ExportArguments;
use crate::cli::generate::GenerateArguments;
use crate::cli::history::HistoryArguments;
use crate::cli::noise::NoiseArguments;
use crate::cli::plan::PlanArguments;
use crate::cli::report::ReportArguments;
use crate::cli::rig::RigArguments;
use crate::cli::run::RunArguments;
#[cfg(feature = "gui")]
use crate::cli::screenshot::ScreenshotArguments;
use crate::cli::simulate::SimulateArguments;
use crate::cli::sweep::{SweepArguments, SweepJobArguments};
use crate::cli::view::ViewArguments;

/// Debugger for visual-inertial navigation with a camera on a gimbal.
#[derive(Debug, Parser)]
#[command(version = version(), about, propagate_version = true)]
pub(crate) struct Arguments {
    /// Command; without one the window opens.
    #[command(subcommand)]
    pub command: Option<Command>,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Open the window on a log; without a display, write screenshots instead and print their paths.
    #[command(after_help = exit::PLAIN)]
    View(ViewArguments),
    /// Run the estimator over a log without a window and write its files.
    #[command(after_help = exit::RUN)]
    Run(RunArguments),
    /// Draw one panel at one time into a PNG or an SVG, without a display.
    #[cfg(feature = "gui")]
    #[command(after_help = exit::INTERRUPTIBLE)]
    Screenshot(Box<ScreenshotArguments>),
    /// Write a report on a log: one HTML file with figures and tables, and CSV and JSON files.
    #[command(after_help = exit::REPORT)]
    Report(ReportArguments),
    /// Calibrate static camera and gimbal offline from a flight with both, as the paper's baseline does.
    #[command(after_help = exit::INTERRUPTIBLE)]
    Calibrate(CalibrateArguments),
    /// Compare the calibrations of one vehicle over its flights: which agree, what changed and when, what they know together.
    #[command(after_help = exit::HISTORY)]
    History(HistoryArguments),
    /// Check a log and its rig: content, timing, calibration, noise; each finding with evidence and remedy.
    #[command(after_help = exit::CHECK)]
    Check(CheckArguments),
    /// Find the cause of residuals that disagree with their noise: the run is computed again with one change each.
    #[command(after_help = exit::DIAGNOSE)]
    Diagnose(DiagnoseArguments),
    /// Measure the noise densities of the IMU: Allan deviation of stationary stretches, or fitted to a flight.
    #[command(after_help = exit::INTERRUPTIBLE)]
    Noise(NoiseArguments),
    /// Write a rig for a recording that has none.
    Rig(RigArguments),
    /// Write a synthetic flight: the log, its rig and the ground truth.
    #[command(after_help = exit::INTERRUPTIBLE)]
    Simulate(SimulateArguments),
    /// Run a plan of many runs (logs × runs × rig errors × seeds), here or on a cluster, and write tables of the results.
    #[command(after_help = exit::SWEEP)]
    Sweep(SweepArguments),
    /// Run one job of a study; started by sweep.
    #[command(hide = true)]
    SweepJob(SweepJobArguments),
    /// Compute which calibration parameters are observable with a mechanism, a parameterization and a motion, without a log.
    #[command(after_help = exit::PLAIN)]
    Degeneracy(DegeneracyArguments),
    /// Plan the motion of joints and vehicle that leaves the calibration of a rig with the smallest σ.
    #[command(after_help = exit::INTERRUPTIBLE)]
    Plan(PlanArguments),
    /// Write the stretches of a log that keep its information about the calibration.
    #[command(after_help = exit::INTERRUPTIBLE)]
    Excerpt(ExcerptArguments),
    /// Convert a EuRoC/ASL folder, a ROS bag, an MP4 video or a log of an autopilot into a log.
    #[command(after_help = exit::INTERRUPTIBLE)]
    Convert(ConvertArguments),
    /// Compare a trajectory with a reference: absolute and relative errors, as evo computes them.
    #[command(after_help = exit::PLAIN)]
    Evaluate(EvaluateArguments),
    /// Write a rig as the configuration of Kalibr, VINS-Fusion, OpenVINS, Basalt or ORB-SLAM3.
    #[command(after_help = exit::PLAIN)]
    Export(ExportArguments),
    /// Print shell completions or write manual pages, for packages.
    #[command(hide = true)]
    Generate(GenerateArguments),
}

/// Commit of the build, by the environment variable `DCVINS_COMMIT`; the scripts of the packages set it.
const COMMIT: Option<&str> = option_env!("DCVINS_COMMIT");

static VERSION: LazyLock<String> = LazyLock::new(|| described(COMMIT));

/// Text of `--version` behind the name of the program, such as `0.2.0 (618ee816)`.
pub(crate) fn version() -> &'static str {
    &VERSION
}

fn described(commit: Option<&str>) -> String {
    let number = env!("CARGO_PKG_VERSION");
    match commit.filter(|commit| !commit.is_empty()) {
        Some(commit) => format!("{number} ({commit})"),
        None => number.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::described;

    #[test]
    fn a_build_without_a_commit_has_the_number_alone() {
        assert_eq!(described(None), env!("CARGO_PKG_VERSION"));
        assert_eq!(described(Some("")), env!("CARGO_PKG_VERSION"));
        assert!(described(Some("618ee816")).ends_with(" (618ee816)"));
    }
}
