//! `dcvins calibrate`: the offline calibration of a log or of stills.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Result, bail};
use clap::Args;
use dcvins::calibration::{CalibrationError, CalibrationOptions};
use dcvins::export::{self, PreparedLog};
use dcvins::session::{self, CalibrationRequest, CalibrationRun, CalibrationRunError, FlightPrior};

use crate::cli::exit::ExitOutcome;
use crate::cli::interrupt::Interrupt;
use crate::cli::prepared_log::prepare;
use crate::cli::shared_arguments::{LimitArguments, PriorArguments, seconds};
use crate::cli::stills_arguments::StillsArguments;
use crate::cli::terminal::{Progress, notify, print, print_json};

#[derive(Args, Clone, Debug)]
pub(crate) struct CalibrateArguments {
    /// The logs of one mechanism; the calibration of each is the prior of the next. Their rig names a static camera, a
    /// gimbal camera and encoders.
    #[arg(value_name = "LOG", required_unless_present = "stills", conflicts_with = "stills")]
    pub logs: Vec<PathBuf>,
    /// Folder for rig.yaml, calibration.json and report.txt; with --stills gimbal.rig.yaml, tables and a figure, too.
    #[arg(short = 'o', long, visible_alias = "output", value_name = "DIR")]
    pub out: PathBuf,
    /// Rig file; default: next to the log (LOG with .rig.yaml) or attached to it.
    #[arg(long, value_name = "FILE", conflicts_with = "stills")]
    pub rig: Option<PathBuf>,
    /// Ground-truth rig file; default: next to the log (LOG with .truth.yaml).
    #[arg(long = "truth", value_name = "FILE", conflicts_with = "stills")]
    pub ground_truth: Option<PathBuf>,
    /// Skip this many seconds at the start of each log.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0, value_parser = seconds, conflicts_with = "stills")]
    pub start: f64,
    /// Duration to process from there.
    #[arg(long, value_name = "SECONDS", value_parser = seconds, conflicts_with = "stills")]
    pub duration: Option<f64>,
    /// Also write the estimated trajectory with covariances: trajectory.tum, a reference for runs (--truth-trajectory),
    /// and covariance.csv; in a further file the trajectory from the static camera alone.
    #[arg(long, conflicts_with = "stills")]
    pub trajectory: bool,
    #[command(flatten)]
    pub prior: PriorArguments,
    #[command(flatten)]
    pub stills: StillsArguments,
    /// Overwrite any existing files. Without it, only a calibration of a log or stills of the same name is replaced.
    #[arg(long)]
    pub force: bool,
    /// Print calibration.json instead of the report.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub limits: LimitArguments,
}

pub(crate) fn calibrate(arguments: &CalibrateArguments) -> Result<ExitOutcome> {
    match &arguments.stills.stills {
        Some(_) if arguments.prior.prior.is_some() => bail!("--prior is for logs; --stills starts from its own values"),
        Some(stills) => arguments.stills.calibrate(stills, &arguments.out, [arguments.force, arguments.json]),
        None => calibrate_logs(arguments),
    }
}

/// Calibrates from one log after the other and writes the files of the last calibration, which includes all before it.
fn calibrate_logs(arguments: &CalibrateArguments) -> Result<ExitOutcome> {
    let limits = arguments.limits.limits();
    let prepared =
        arguments.logs.iter().map(|log| prepare(std::slice::from_ref(log), arguments.rig.as_deref(), &limits));
    let prepared = prepared.collect::<Result<Vec<_>>>()?;
    let Some(last) = prepared.last() else { bail!("no log to calibrate from: give LOG, or --stills FILE") };
    export::check_calibration_folder(&arguments.out, &last.log, arguments.force)?;
    let interrupt = Interrupt::watch()?;
    let mut prior = arguments.prior.read()?;
    let mut calibration = None;
    for log in prepared {
        let Some(run) = calibrate_log(arguments, log, prior, &interrupt)? else { return Ok(ExitOutcome::Interrupted) };
        prior = Some(Arc::new(export::prior_of_calibration(&run, arguments.prior.prior_growth)));
        calibration = Some(run);
    }
    let Some(run) = calibration else { return Ok(ExitOutcome::Success) };
    let report = export::report_calibration(&run);
    export::write_calibration(&run, &report, &arguments.out, arguments.trajectory)?;
    if arguments.json {
        print_json(&report)?;
    } else {
        print(&format!("{report}  files        {}\n", arguments.out.display()))?;
    }
    Ok(ExitOutcome::Success)
}

/// Calibration from one log, `None` if it was interrupted.
fn calibrate_log(
    arguments: &CalibrateArguments,
    prepared: PreparedLog,
    prior: Option<Arc<FlightPrior>>,
    interrupt: &Interrupt,
) -> Result<Option<CalibrationRun>> {
    let request = CalibrationRequest {
        prior,
        log_path: prepared.log,
        rig_path: arguments.rig.clone().or(prepared.rig),
        ground_truth_path: arguments.ground_truth.clone().or(prepared.ground_truth),
        start_s: arguments.start,
        duration_s: arguments.duration,
        limits: arguments.limits.limits(),
    };
    let progress = Progress::new();
    let options = CalibrationOptions { pose_covariances: arguments.trajectory, ..CalibrationOptions::default() };
    let run = session::calibrate(&request, &options, &mut |at| {
        progress.show(at.fraction, || at.stage.to_owned());
        interrupt.control_flow()
    });
    drop(progress);
    match run {
        Err(error @ CalibrationRunError::Calibration { reason: CalibrationError::Interrupted { .. }, .. }) => {
            notify(&format!("dcvins: {error}"));
            Ok(None)
        }
        run => Ok(Some(run?)),
    }
}
