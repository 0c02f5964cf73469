//! `dcvins convert`: conversion of datasets and bags into logs.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use dcvins::flight_log;

use crate::cli::limit_arguments::LimitArguments;
use crate::cli::terminal::{Progress, print_report};

/// `dcvins convert`.
#[derive(Args, Clone, Debug)]
pub(crate) struct ConvertArguments {
    /// A EuRoC/ASL folder (with mav0), a ROS 1 bag, or a ROS 2 bag: its folder, one .db3 or one .mcap.
    pub source: PathBuf,
    /// The log to write; the rig, where the source describes one, gets the same name with .rig.yaml.
    #[arg(short, long, value_name = "LOG.mcap")]
    pub output: PathBuf,
    /// Print the converted and skipped topics as JSON.
    #[arg(long)]
    pub json: bool,
    /// Limits on the source.
    #[command(flatten)]
    pub limits: LimitArguments,
}

/// Runs `dcvins convert`.
pub(crate) fn convert(arguments: &ConvertArguments) -> Result<()> {
    let progress = Progress::new();
    let limits = arguments.limits.limits();
    let report = flight_log::convert::convert_with(&arguments.source, &arguments.output, &limits, &mut |ratio| {
        progress.show(ratio, String::new);
    })?;
    drop(progress);
    print_report(&report, arguments.json)
}
