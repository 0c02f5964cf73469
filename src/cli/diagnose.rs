//! `dcvins diagnose`: the cause of residuals that disagree with their noise.

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::Args;
use dcvins::session::{self, Diagnosis, LogFaults, SessionPlan};

use crate::cli::compute::compute;
use crate::cli::estimation_arguments::EstimationArguments;
use crate::cli::exit::ExitOutcome;
use crate::cli::interrupt::Interrupt;
use crate::cli::prepared_log::prepared_log;
use crate::cli::shared_arguments::seconds;
use crate::cli::terminal::{Progress, notify, print, print_json};

#[derive(Args, Clone, Debug)]
pub(crate) struct DiagnoseArguments {
    pub log: PathBuf,
    #[command(flatten)]
    pub estimation: EstimationArguments,
    /// Processor time in seconds after which the trials end, as estimated for a common machine: the same trials on every one
    #[arg(long, value_name = "SECONDS", default_value_t = session::TRIALS_S, value_parser = seconds)]
    pub budget: f64,
    /// Print the diagnoses as JSON, with all causes that were tried with a gain.
    #[arg(long)]
    pub json: bool,
}

pub(crate) fn diagnose(arguments: &DiagnoseArguments) -> Result<ExitOutcome> {
    let (log, estimation) = prepared_log(std::slice::from_ref(&arguments.log), &arguments.estimation)?;
    let arguments = &DiagnoseArguments { log, estimation, ..arguments.clone() };
    let plan = SessionPlan::open(&arguments.estimation.request(arguments.log.clone())?)?;
    let interrupt = Interrupt::watch()?;
    let plan = SessionPlan { interrupted: interrupt.flag(), ..plan };
    let computation = compute(&plan)?;
    if computation.recording().runs.iter().all(|run| run.steps.is_empty()) && !interrupt.is_set() {
        bail!("no image of the log could be used; reasons: 'dcvins check {}'", arguments.log.display());
    }
    let (mut diagnoses, log_faults): (Vec<Diagnosis>, _) = (Vec::new(), LogFaults::default());
    for run in 0..plan.runs.len() {
        let progress = Progress::new();
        diagnoses.extend(session::diagnose(&computation, run, &log_faults, arguments.budget, &mut |ratio, label| {
            progress.show(ratio, || label.to_owned());
            interrupt.control_flow()
        }));
    }
    if arguments.json {
        print_json(&diagnoses)?;
    } else {
        for diagnosis in &diagnoses {
            print(&diagnosis.to_string())?;
        }
    }
    if interrupt.is_set() {
        notify("dcvins: interrupted; the diagnosis is what was known so far");
        return Ok(ExitOutcome::Interrupted);
    }
    Ok(ExitOutcome::Success)
}
