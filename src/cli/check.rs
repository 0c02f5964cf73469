//! `dcvins check`: findings about a log and its rig.

use dcvins::flight_log::RigOfLog as _;
use std::path::PathBuf;
use std::sync::Arc;

use anyhow::Result;
use clap::Args;
use dcvins::export;
use dcvins::flight_log::FlightLog;
use dcvins::log_check::{self, Severity};
use dcvins::sensors::Rig;

use crate::cli::exit::ExitOutcome;
use crate::cli::prepared_log::prepare;
use crate::cli::result_cache::CacheArguments;
use crate::cli::shared_arguments::LimitArguments;
use crate::cli::terminal::{Progress, notify, print_report};

#[derive(Args, Clone, Debug)]
pub(crate) struct CheckArguments {
    /// The log, or a recording that is converted into the cache folder first.
    pub log: PathBuf,
    /// Rig file; default: next to the log or attached to it.
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    /// Folder for proposed masks, CAMERA.mask.png, of each camera with an image region that never moves.
    #[arg(long, value_name = "FOLDER")]
    pub write_masks: Option<PathBuf>,
    /// Overwrite masks that exist already.
    #[arg(long, requires = "write_masks")]
    pub force: bool,
    /// Print the findings as JSON.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub limits: LimitArguments,
    #[command(flatten)]
    pub cache: CacheArguments,
}

pub(crate) fn check(arguments: &CheckArguments) -> Result<ExitOutcome> {
    let limits = arguments.limits.limits();
    let prepared = prepare(std::slice::from_ref(&arguments.log), arguments.rig.as_deref(), &limits)?;
    let rig_path = arguments.rig.clone().or(prepared.rig);
    let progress = Progress::spinner("reading the log");
    let log = Arc::new(FlightLog::open_with(&prepared.log, &limits)?);
    let (rig, unused_keys) = match Rig::for_log_with_unused_keys(&log, rig_path.as_deref()) {
        Ok((rig, unused_keys)) => (Ok(rig), unused_keys),
        Err(error) => (Err(error), Vec::new()),
    };
    let mut report = match &rig {
        Ok(rig) => export::check_log(arguments.cache.cache().as_ref(), &log, rig),
        Err(error) => log_check::check(&log, Err(error), &[]),
    };
    report.add_unused_rig_keys(&unused_keys);
    log.require_unshortened()?;
    drop(progress);
    print_report(&report, arguments.json)?;
    if let Some(folder) = &arguments.write_masks {
        let written = export::write_masks(&report.proposed_masks, folder, arguments.force)?;
        let mut names = written.iter().map(|path| path.display().to_string());
        notify(&names.next().map_or_else(
            || "no camera needs a new mask".to_owned(),
            |first| names.fold(first, |all, name| format!("{all}\n{name}")),
        ));
    }
    Ok(if report.worst() == Severity::Error { ExitOutcome::ErrorsFound } else { ExitOutcome::Success })
}
