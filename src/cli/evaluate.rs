//! `dcvins evaluate`: errors of a trajectory against a reference.

use std::path::PathBuf;

use anyhow::Result;
use clap::{Args, ValueEnum};
use dcvins::export::{self, EvaluationOptions};
use dcvins::session::accuracy::{RelativeDelta, TrajectoryAlignment};

use crate::cli::shared_arguments::seconds;
use crate::cli::terminal::print_report;

#[derive(Args, Clone, Debug)]
pub(crate) struct EvaluateArguments {
    /// The estimated trajectory: TUM (t x y z qx qy qz qw) or a table in EuRoC's format.
    pub estimate: PathBuf,
    /// Reference trajectory, in one of the same formats.
    pub reference: PathBuf,
    /// Alignment of the estimate to the reference.
    #[arg(long, value_enum, default_value_t = AlignArgument::Se3)]
    pub align: AlignArgument,
    /// Interval of the relative error: frames (5f) or metres (10m).
    #[arg(long, value_name = "Nf|Xm", default_value = "1f", value_parser = delta)]
    pub delta: RelativeDelta,
    /// Largest time difference of associated poses.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.01, value_parser = seconds)]
    pub max_difference: f64,
    /// Print the result as JSON.
    #[arg(long)]
    pub json: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum AlignArgument {
    /// Compare without an alignment.
    None,
    /// Rotation about the vertical and translation.
    Yaw,
    /// Rotation and translation (evo's --align).
    Se3,
    /// Rotation, translation and scale (evo's `--align --correct_scale`).
    Sim3,
}

impl From<AlignArgument> for TrajectoryAlignment {
    fn from(argument: AlignArgument) -> Self {
        match argument {
            AlignArgument::None => Self::None,
            AlignArgument::Yaw => Self::YawPosition,
            AlignArgument::Se3 => Self::Rigid,
            AlignArgument::Sim3 => Self::Similarity,
        }
    }
}

fn delta(text: &str) -> Result<RelativeDelta, String> {
    let frames = text.strip_suffix('f').and_then(|number| number.parse::<usize>().ok()).filter(|number| *number > 0);
    let metres = text.strip_suffix('m').and_then(|number| number.parse::<f64>().ok()).filter(|number| *number > 0.0);
    frames
        .map(RelativeDelta::Frames)
        .or_else(|| metres.map(RelativeDelta::Metres))
        .ok_or_else(|| "expected frames as in 5f, or metres as in 10m".to_owned())
}

pub(crate) fn evaluate(arguments: &EvaluateArguments) -> Result<()> {
    let options = EvaluationOptions {
        alignment: arguments.align.into(),
        delta: arguments.delta,
        max_difference_s: arguments.max_difference,
    };
    let report = export::evaluate(&arguments.estimate, &arguments.reference, &options)?;
    print_report(&report, arguments.json)
}
