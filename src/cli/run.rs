//! `dcvins run`: the estimator on a log without a window.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Result, bail};
use clap::Args;
use dcvins::export::{self, RunFileOptions};
use dcvins::flight_log::live::{LiveReceiver, Received};
use dcvins::geometry::seconds_from_ns;
use dcvins::session::breakpoints::Condition;
use dcvins::session::{BreakpointHit, Recording, RunRecord, RunSummary, SessionPlan, SessionRequest};
use dcvins::text::{counted, log_name};

use crate::cli::compute::{Delay, compute, compute_following, compute_until};
use crate::cli::estimation_arguments::EstimationArguments;
use crate::cli::exit::ExitOutcome;
use crate::cli::follow_arguments::{FollowArguments, FollowedLog};
use crate::cli::interrupt::Interrupt;
use crate::cli::log_checking::beside_check;
use crate::cli::prepared_log::prepared_log;
use crate::cli::result_cache::CacheArguments;
use crate::cli::run_summary::{describe, describe_trajectory};
use crate::cli::terminal::{Progress, notify, print, print_json};

#[derive(Args, Clone, Debug)]
pub(crate) struct RunArguments {
    /// The log, a recording that is converted into the cache folder first, or the address of a Foxglove WebSocket server,
    /// ws://HOST:PORT, whose messages are recorded and followed.
    pub log: PathBuf,
    /// Folder for the files; each run gets a sub-folder with its name.
    #[arg(short = 'o', long, visible_alias = "output", value_name = "DIR")]
    pub out: PathBuf,
    #[command(flatten)]
    pub estimation: EstimationArguments,
    #[command(flatten)]
    pub cache: CacheArguments,
    /// Stop when this condition becomes true in a run, as in "rank < 18 or features < 40", write the files up to that
    /// step and print the values; docs/manual.md lists the quantities.
    #[arg(long = "break", value_name = "CONDITION", value_parser = condition, conflicts_with = "follow")]
    pub break_at: Option<Condition>,
    #[command(flatten)]
    pub follow: FollowArguments,
    /// Omit measured times from frames.csv and summary.json, so that two runs give the same bytes in every file.
    #[arg(long)]
    pub no_timing: bool,
    /// Also write results.mcap for Foxglove and Rerun: poses, frames of the chain, image annotations, landmarks,
    /// calibration and rank over time.
    #[arg(long)]
    pub mcap: bool,
    /// Also write trajectory.euroc.csv, a table like EuRoC's ground truth.
    #[arg(long)]
    pub euroc: bool,
    /// Overwrite any content of the runs' folders. Without it, only a run on a log of the same name is replaced, in a
    /// folder that contains nothing else.
    #[arg(long)]
    pub force: bool,
    /// Do not check the log and its rig meanwhile: the answer of a run then follows from the run alone.
    #[arg(long)]
    pub no_check: bool,
    /// Print the summaries as JSON instead of a table.
    #[arg(long)]
    pub json: bool,
}

fn condition(text: &str) -> Result<Condition, String> {
    text.parse::<Condition>().map_err(|problem| problem.to_string())
}

/// Memory budget if only tables are written: beyond it, steps are kept as summaries.
const SUMMARY_BUDGET_BYTES: usize = 16 << 20;

pub(crate) fn run(arguments: &RunArguments) -> Result<ExitOutcome> {
    let interrupt = Interrupt::watch()?;
    let mut followed = begin_following(arguments, &interrupt)?;
    let (log, estimation) = if let Some(followed) = &followed {
        (followed.log.clone(), arguments.estimation.clone())
    } else {
        prepared_log(std::slice::from_ref(&arguments.log), &arguments.estimation)?
    };
    let arguments = &RunArguments { log, estimation, ..arguments.clone() };
    let request = arguments.estimation.request(arguments.log.clone())?;
    let opened = || Ok(SessionPlan::open(&request)?);
    let plan = followed.as_ref().map_or_else(opened, |followed| followed.plan(&request))?;
    let labels: Vec<&str> = plan.runs.iter().map(|(spec, _)| spec.label.as_str()).collect();
    export::check_run_folders(&arguments.out, &labels, &arguments.log, arguments.force)?;
    // Complete steps are needed for results.mcap and for the conditions of `--break`; all other files need only
    // summaries.
    let needs_whole_steps = arguments.mcap || arguments.break_at.is_some();
    let memory_budget_bytes = if needs_whole_steps { plan.memory_budget_bytes } else { SUMMARY_BUDGET_BYTES };
    let plan = SessionPlan { interrupted: interrupt.flag(), memory_budget_bytes, ..plan.clone() };
    let estimate = || match &arguments.break_at {
        Some(condition) => compute_until(&plan, condition),
        None => Ok((compute(&plan)?.into_recording(), None)),
    };
    let (recording, hit) = if let Some(followed) = &mut followed {
        (follow(arguments, &plan, &request, followed)?, None)
    } else if arguments.no_check {
        estimate()?
    } else {
        let (computed, checked) = beside_check(&plan, &arguments.cache, estimate);
        let (recording, hit) = computed?;
        (Recording { check: Some(Arc::new(checked.findings)), ..recording }, hit)
    };
    let no_steps = recording.runs.iter().all(|run| run.steps.is_empty());
    if interrupt.is_set() && no_steps {
        notify("dcvins: interrupted before the first step; nothing is written");
        return Ok(ExitOutcome::Interrupted);
    }
    let mut summaries = Vec::new();
    for run in &recording.runs {
        let options =
            RunFileOptions { timing: !arguments.no_timing, mcap: arguments.mcap, euroc_trajectory: arguments.euroc };
        let (folder, summary) = export::write_run(&recording, run, &arguments.out, options)?;
        summaries.push((folder, summary));
    }
    if arguments.json {
        let all: Vec<&RunSummary> = summaries.iter().map(|(_, summary)| summary).collect();
        match &arguments.break_at {
            Some(condition) => {
                let hit = break_json(condition, hit.as_ref(), &recording);
                print_json(&serde_json::json!({ "break": hit, "runs": all }))?;
            }
            None => print_json(&all)?,
        }
    } else {
        for (folder, summary) in &summaries {
            print(&describe(folder, summary))?;
        }
        for run in &recording.runs {
            if let Some(flights) = export::SigmaTable::of_run(&recording, run) {
                print(&format!("{}\n{flights}", run.spec.label))?;
            }
        }
        for lane in summaries.first().iter().flat_map(|(_, summary)| &summary.trajectories) {
            print(&describe_trajectory(lane))?;
        }
        if let Some(condition) = &arguments.break_at {
            print(&describe_break(condition, hit.as_ref()))?;
        }
    }
    let others = export::other_runs(&arguments.out, &labels);
    if !others.is_empty() {
        let folder = arguments.out.display();
        notify(&format!("dcvins: {folder} also holds runs of earlier commands: {}", others.join(", ")));
    }
    let failed: Vec<&str> = recording.runs.iter().filter_map(|run| run.error.as_deref()).collect();
    if !failed.is_empty() {
        bail!("{}", failed.join("; "));
    }
    if interrupt.is_set() {
        notify(&interrupted(&recording));
        return Ok(ExitOutcome::Interrupted);
    }
    if no_steps {
        let log = log_name(&arguments.log);
        bail!("no image of '{log}' could be used; reasons: 'dcvins check {}'", arguments.log.display());
    }
    if hit.is_some() {
        return Ok(ExitOutcome::BreakHit);
    }
    let is_required = arguments.estimation.require.is_some();
    Ok(if !recording.runs.iter().all(is_initialized) {
        ExitOutcome::NeverInitialized
    } else if is_required && !summaries.iter().all(|(_, summary)| summary.answer.meets_requirement()) {
        ExitOutcome::RequirementNotMet
    } else {
        ExitOutcome::Success
    })
}

/// Begins to follow the log of the command, a file or the messages of a server; `None` for a complete log.
fn begin_following(arguments: &RunArguments, interrupt: &Interrupt) -> Result<Option<FollowedLog>> {
    if !arguments.follow.applies_to(&arguments.log) {
        return Ok(None);
    }
    let followed =
        arguments.follow.open(&arguments.log, &arguments.estimation, &arguments.out, interrupt.flag(), true)?;
    if followed.receiver.is_some() {
        if arguments.break_at.is_some() {
            bail!("--break needs a complete log: use it on the recording of {}", arguments.log.display());
        }
        if arguments.estimation.rig.is_none() {
            bail!("a server has no rig: name it with --rig FILE ('dcvins rig new' writes one from a recording)");
        }
    }
    Ok(Some(followed))
}

/// Runs on a log while it is being written, then checks the complete log.
fn follow(
    arguments: &RunArguments,
    plan: &SessionPlan,
    request: &SessionRequest,
    followed: &mut FollowedLog,
) -> Result<Recording> {
    let mut delay = Delay::default();
    let computation = compute_following(plan, &mut delay)?;
    if let Some(receiver) = &mut followed.receiver {
        receiver.finish();
        notify(&received(receiver));
        receiver.reception().events().iter().for_each(|event| notify(&format!("dcvins: {event}")));
    }
    if let Some(warning) = plan.log.end_warning() {
        notify(&format!("dcvins: {}", warning.message));
    }
    notify(&format!("dcvins: followed {:.1} s of log, {delay}", seconds_from_ns(plan.log.duration_ns())));
    // The plan has topics, rates and ground truth of the first seconds.
    let complete = SessionPlan::of_log(request, Arc::new(plan.log.reopened()?))?;
    let recording = computation.into_recording().of_complete_log(&complete);
    if arguments.no_check {
        return Ok(recording);
    }
    let _progress = Progress::spinner("checking the log");
    let checked = export::check_log(arguments.cache.cache().as_ref(), &complete.log, &complete.rig);
    Ok(Recording { check: Some(Arc::new(checked.findings)), ..recording })
}

/// Notice about what was received.
fn received(receiver: &LiveReceiver) -> String {
    let Received { messages, bytes, connections } = receiver.reception().received();
    let (address, recording) = (receiver.reception().address(), receiver.recording().display());
    let megabytes = bytes as f64 * 1e-6;
    let connections = counted(connections as usize, "connection");
    format!("dcvins: {messages} messages ({megabytes:.1} MB) of {address} over {connections}, recorded in {recording}")
}

/// Notice about the computed part of an interrupted command.
pub(crate) fn interrupted(recording: &Recording) -> String {
    let (done_s, end_s) = (seconds_from_ns(recording.last_stamp_ns()), seconds_from_ns(recording.duration_ns));
    format!("dcvins: interrupted at {done_s:.2} s of {end_s:.2} s; the results up to this time are written")
}

/// True if a run has estimated a pose.
pub(crate) fn is_initialized(run: &RunRecord) -> bool {
    run.steps.iter().any(|step| step.report.newest().is_some())
}

/// The hit of `--break` as a line of text.
fn describe_break(condition: &Condition, hit: Option<&BreakpointHit>) -> String {
    hit.map_or_else(
        || format!("break: '{condition}' never became true\n"),
        |hit| format!("break: {}\n", hit.description),
    )
}

/// The hit of `--break` as JSON.
fn break_json(condition: &Condition, hit: Option<&BreakpointHit>, recording: &Recording) -> serde_json::Value {
    let Some(found) = hit else { return serde_json::json!({ "condition": condition.text(), "hit": null }) };
    let run = recording.runs.get(found.hit.run);
    let values: serde_json::Map<String, serde_json::Value> =
        found.values.iter().map(|value| (value.name.clone(), value.value.into())).collect();
    serde_json::json!({
        "condition": condition.text(),
        "hit": {
            "run": run.map(|run| run.spec.label.as_str()),
            "time_s": seconds_from_ns(found.hit.stamp_ns),
            "frame": run.and_then(|run| run.steps.get(found.hit.step)).map(|step| step.report.frame_index),
            "values": values,
        },
    })
}
