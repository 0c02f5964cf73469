//! `dcvins convert`: conversion of datasets and bags into logs.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use dcvins::export;
use dcvins::flight_log::{self, convert::ConvertError};

use crate::cli::exit::Outcome;
use crate::cli::interrupt::Interrupt;
use crate::cli::limit_arguments::LimitArguments;
use crate::cli::terminal::{Progress, notify, print_report};

/// `dcvins convert`.
#[derive(Args, Clone, Debug)]
pub(crate) struct ConvertArguments {
    /// A EuRoC/ASL folder (with mav0), a ROS 1 bag, or a ROS 2 bag: its folder, one .db3 or one .mcap.
    pub source: PathBuf,
    /// The log to write; the rig, where the source describes one, gets the same name with .rig.yaml.
    #[arg(short, long, visible_alias = "out", value_name = "LOG.mcap")]
    pub output: PathBuf,
    /// Overwrite whatever has the name of the log. Without it only a log is replaced that this command wrote; a rig beside the
    /// log that was edited is always kept.
    #[arg(long)]
    pub force: bool,
    /// Print the converted and skipped topics as JSON.
    #[arg(long)]
    pub json: bool,
    /// Limits on the source.
    #[command(flatten)]
    pub limits: LimitArguments,
}

/// Runs `dcvins convert`.
pub(crate) fn convert(arguments: &ConvertArguments) -> Result<Outcome> {
    let interrupt = Interrupt::watch()?;
    export::check_converted_log(&arguments.output, arguments.force)?;
    let progress = Progress::new();
    let limits = arguments.limits.limits();
    let converted = flight_log::convert::convert_with(&arguments.source, &arguments.output, &limits, &mut |ratio| {
        progress.show(ratio, String::new);
        interrupt.control_flow()
    });
    drop(progress);
    match converted {
        Ok(report) => print_report(&report, arguments.json).map(|()| Outcome::Success),
        Err(error @ ConvertError::Interrupted { .. }) => {
            notify(&format!("dcvins: {error}"));
            Ok(Outcome::Interrupted)
        }
        Err(error) => Err(error.into()),
    }
}
