//! `dcvins noise`: noise densities of an IMU from stationary stretches, or from a flight.

use dcvins::flight_log::RigOfLog as _;
use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use dcvins::calibration::ImuNoiseError;
use dcvins::export::{self, FlightNoiseReport};
use dcvins::flight_log::FlightLog;
use dcvins::log_check::{self, AllanReport};
use dcvins::sensors::Rig;
use dcvins::session::{self, FlightNoiseError};

use crate::cli::exit::ExitOutcome;
use crate::cli::interrupt::Interrupt;
use crate::cli::prepared_log::prepare;
use crate::cli::shared_arguments::{LimitArguments, seconds};
use crate::cli::terminal::{Progress, notify, print, print_json};

#[derive(Args, Clone, Debug)]
pub(crate) struct NoiseArguments {
    pub log: PathBuf,
    /// Folder for noise.json, the lines of the rig (imu0.yaml) and, from stationary stretches, allan.csv, allan.png,
    /// allan.svg.
    #[arg(short = 'o', long, visible_alias = "output", value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Rig file; default: next to the log or attached to it.
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    /// Skip this many seconds at the start of the log.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0, value_parser = seconds)]
    pub start: f64,
    /// Duration to use from there.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub duration: Option<f64>,
    /// Source of the noise densities.
    #[arg(long, value_enum, default_value_t = Method::Auto)]
    pub method: Method,
    /// Print the result as JSON.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub limits: LimitArguments,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Method {
    /// The Allan deviation if at least 10 s are stationary, else the flight.
    Auto,
    /// The Allan deviation of stationary stretches.
    Allan,
    /// Residuals of the estimator in flight, with χ² equal to their degrees of freedom.
    Flight,
}

pub(crate) fn noise(arguments: &NoiseArguments) -> Result<ExitOutcome> {
    let limits = arguments.limits.limits();
    let prepared = prepare(std::slice::from_ref(&arguments.log), arguments.rig.as_deref(), &limits)?;
    let arguments =
        &NoiseArguments { log: prepared.log, rig: arguments.rig.clone().or(prepared.rig), ..arguments.clone() };
    let progress = Progress::spinner("reading the log");
    let log = Arc::new(FlightLog::open_with(&arguments.log, &limits)?);
    let rig = Rig::for_log(&log, arguments.rig.as_deref());
    if let (Err(error), true) = (&rig, arguments.rig.is_some()) {
        bail!("{error}");
    }
    let end_s = arguments.duration.map_or_else(|| f64::from(u32::MAX), |duration_s| arguments.start + duration_s);
    let stationary = match arguments.method {
        Method::Flight => None,
        Method::Auto | Method::Allan => log_check::measure_noise(&log, rig.as_ref().ok(), (arguments.start, end_s)),
    };
    log.require_unshortened()?;
    drop(progress);
    match stationary {
        Some(report) if report.is_measured() => write_stationary(arguments, &report),
        Some(report) if arguments.method == Method::Allan => bail!(too_short(&report)),
        None if arguments.method == Method::Allan => bail!("the log has no IMU: {}", arguments.log.display()),
        short => {
            if let Some(report) = &short {
                notify(&format!("dcvins: {}; the densities are fitted to the flight", too_short(report)));
            }
            fit_flight(arguments, &log, &rig?)
        }
    }
}

fn too_short(report: &AllanReport) -> String {
    // Adding zero converts −0 to 0.
    format!(
        "{:.1} s of stationary stretches in the log, at least 10 s of stretches of 3 s are needed for an Allan deviation",
        report.stationary_s + 0.0
    )
}

fn write_stationary(arguments: &NoiseArguments, report: &AllanReport) -> Result<ExitOutcome> {
    let written = match &arguments.out {
        Some(folder) => export::write_allan(report, &serde_json::to_string_pretty(report)?, folder)?,
        None => Vec::new(),
    };
    if arguments.json {
        print_json(report)?;
    } else {
        print(&format!("{report}\n{}", report.rig_lines()))?;
    }
    announce(&written);
    Ok(ExitOutcome::Success)
}

fn fit_flight(arguments: &NoiseArguments, log: &Arc<FlightLog>, rig: &Rig) -> Result<ExitOutcome> {
    let interrupt = Interrupt::watch()?;
    let progress = Progress::new();
    let fitted = session::fit_flight_noise(log, rig, (arguments.start, arguments.duration), &mut |ratio| {
        progress.show(ratio, || "fitting the noise densities".to_owned());
        interrupt.control_flow()
    });
    drop(progress);
    let (noise, camera) = match fitted {
        Err(FlightNoiseError::Fit(ImuNoiseError::Interrupted)) => {
            notify("dcvins: interrupted; nothing is written");
            return Ok(ExitOutcome::Interrupted);
        }
        fitted => fitted?,
    };
    let names = [arguments.log.display().to_string(), rig.name.clone(), camera];
    let report = FlightNoiseReport::new(&noise, names);
    let written = match &arguments.out {
        Some(folder) => export::write_flight_noise(&report, &serde_json::to_string_pretty(&report)?, folder)?,
        None => Vec::new(),
    };
    if arguments.json {
        print_json(&report)?;
    } else {
        print(&format!("{report}\n{}", report.rig_lines()))?;
    }
    announce(&written);
    Ok(ExitOutcome::Success)
}

fn announce(written: &[PathBuf]) {
    for path in written {
        notify(&path.display().to_string());
    }
}
