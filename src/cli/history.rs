//! `dcvins history`: the calibration of one vehicle over its flights.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use dcvins::export;

use crate::cli::exit::ExitOutcome;
use crate::cli::terminal::print_report;

#[derive(Args, Clone, Debug)]
pub(crate) struct HistoryArguments {
    /// Folders with results of 'dcvins run' or 'dcvins calibrate' on flights of one vehicle; folders below them are searched.
    #[arg(value_name = "FOLDER", required = true)]
    pub folders: Vec<PathBuf>,
    /// Name of the runs to compare [default: the one that most logs have].
    #[arg(long, value_name = "NAME")]
    pub run: Option<String>,
    /// Folder for history.txt, history.json and values.csv.
    #[arg(short = 'o', long, visible_alias = "output", value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print history.json instead of the report.
    #[arg(long)]
    pub json: bool,
}

pub(crate) fn history(arguments: &HistoryArguments) -> Result<ExitOutcome> {
    let report = export::calibration_history(&arguments.folders, arguments.run.as_deref())?;
    if let Some(folder) = &arguments.out {
        export::write_history(&report, folder)?;
    }
    print_report(&report, arguments.json)?;
    Ok(if report.agrees() { ExitOutcome::Success } else { ExitOutcome::ErrorsFound })
}
