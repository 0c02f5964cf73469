//! `dcvins excerpt`: the stretches of a log that keep its information about the calibration.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Result, anyhow, bail};
use clap::Args;
use dcvins::export::{self, ExcerptSummary};
use dcvins::session::{FlightPrior, Recording, RunSpec, SessionPlan, SessionRequest};

use crate::cli::compute::compute;
use crate::cli::exit::ExitOutcome;
use crate::cli::interrupt::Interrupt;
use crate::cli::prepared_log::prepare;
use crate::cli::shared_arguments::{LimitArguments, seconds};
use crate::cli::terminal::{notify, print_report};

#[derive(Args, Clone, Debug)]
pub(crate) struct ExcerptArguments {
    /// The log, or a recording that is converted into the cache folder first.
    pub log: PathBuf,
    /// Folder for excerpt.json and one log with its rig per stretch: NAME-1.mcap, NAME-2.mcap, ….
    #[arg(short = 'o', long, visible_alias = "output", value_name = "DIR")]
    pub out: PathBuf,
    /// Duration of all stretches together.
    #[arg(long, value_name = "SECONDS", default_value_t = 20.0, value_parser = seconds)]
    pub seconds: f64,
    /// The run whose calibration counts, as for `dcvins run`: NAME[:key=value,…].
    #[arg(long, value_name = "SPEC", default_value = "minimal")]
    pub run: RunSpec,
    /// Rig file; default: next to the log (LOG with .rig.yaml) or attached to it.
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    /// Ground-truth rig file; default: next to the log (LOG with .truth.yaml).
    #[arg(long = "truth", value_name = "FILE")]
    pub ground_truth: Option<PathBuf>,
    /// Overwrite files that exist already.
    #[arg(long)]
    pub force: bool,
    /// Print excerpt.json instead of the table.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub limits: LimitArguments,
}

pub(crate) fn excerpt(arguments: &ExcerptArguments) -> Result<ExitOutcome> {
    let limits = arguments.limits.limits();
    let prepared = prepare(std::slice::from_ref(&arguments.log), arguments.rig.as_deref(), &limits)?;
    let interrupt = Interrupt::watch()?;
    let request = SessionRequest {
        log_path: prepared.log,
        rig_path: arguments.rig.clone().or(prepared.rig),
        ground_truth_path: arguments.ground_truth.clone().or(prepared.ground_truth),
        specs: vec![arguments.run.clone()],
        limits,
        ..SessionRequest::default()
    };
    // Every excerpt has at least one stretch: known before the run, the others after it.
    export::check_excerpt_folder(&arguments.out, &request.log_path, 1, arguments.force)?;
    let Some((recording, whole, plan)) = computed(&request, &interrupt)? else { return Ok(ExitOutcome::Interrupted) };
    let Some(run) = recording.runs.first() else { bail!("there is no run") };
    let collected = run.collected_information(&plan.rig).map_err(|problem| anyhow!("no excerpt: {problem}"))?;
    let useful = collected.track.useful_stretches(arguments.seconds).ok_or_else(|| {
        anyhow!("no excerpt of {} s: shorter than the initialization and two more seconds", arguments.seconds)
    })?;
    let label = &run.spec.label;
    let mut summary =
        ExcerptSummary::new(&request.log_path, label, arguments.seconds, &plan.rig, (&collected, &useful));
    export::check_excerpt_folder(&arguments.out, &request.log_path, summary.stretches.len(), arguments.force)?;
    let rigs = (&*plan.rig, plan.ground_truth_rig.as_deref());
    export::write_stretches(&mut summary, &plan.log, rigs, &arguments.out)?;
    let mut prior: Option<Arc<FlightPrior>> = None;
    for stretch in &summary.stretches {
        let request = SessionRequest {
            log_path: arguments.out.join(&stretch.log),
            rig_path: None,
            ground_truth_path: None,
            prior: prior.clone(),
            ..request.clone()
        };
        let Some((_, after, _)) = computed(&request, &interrupt)? else { return Ok(ExitOutcome::Interrupted) };
        if after.is_none() {
            notify(&format!("dcvins: the run over {} ended without a calibration", stretch.log.display()));
        }
        prior = after.map(Arc::new).or(prior);
    }
    let last = |prior: &FlightPrior| prior.history.last().cloned();
    if let (Some(whole), Some(stretches)) = (whole.as_ref().and_then(last), prior.as_deref().and_then(last)) {
        summary.set_achieved(&whole, &stretches);
    }
    export::write_excerpt_index(&summary, &arguments.out)?;
    print_report(&summary, arguments.json)?;
    Ok(ExitOutcome::Success)
}

/// A run over a log with its calibration at the end; `None` after Ctrl+C.
fn computed(
    request: &SessionRequest,
    interrupt: &Interrupt,
) -> Result<Option<(Recording, Option<FlightPrior>, SessionPlan)>> {
    let plan = SessionPlan { interrupted: interrupt.flag(), ..SessionPlan::open(request)? };
    let recording = compute(&plan)?.into_recording();
    if interrupt.is_set() {
        notify("dcvins: interrupted");
        return Ok(None);
    }
    if let Some(error) = recording.runs.iter().find_map(|run| run.error.clone()) {
        bail!("{error}");
    }
    let posterior = recording.runs.first().and_then(|run| export::prior_of_run(&recording, run, 1.0));
    Ok(Some((recording, posterior, plan)))
}
