//! `--dry-run`: the jobs of a plan, and their expected time and memory.

use std::collections::BTreeMap;

use anyhow::{Result, bail};
use dcvins::study::{JobLog, KeyedJob};
use serde::Serialize;

use super::arguments::Sweep;
use super::pool::{Pool, PoolLimits, duration_text};
use crate::cli::exit::ExitOutcome;
use crate::cli::interrupt::Interrupt;
use crate::cli::terminal::{notify, print, print_json};

/// Number of characters of a key in a list.
const SHOWN_KEY: usize = 12;

#[derive(Debug, Serialize)]
struct ListedJob {
    key: String,
    job: String,
    done: bool,
}

/// Expected cost of the jobs.
#[derive(Debug, Serialize)]
struct SweepEstimate {
    /// Number of jobs that are not done.
    jobs: usize,
    /// Number of flights that are not rendered.
    flights: usize,
    /// Number of jobs that run at the same time.
    at_once: usize,
    /// Wall time in seconds.
    wall_s: f64,
    /// Largest measured memory of a job, in bytes.
    memory_per_job_bytes: u64,
    /// Number of jobs on which the estimate is based.
    measured_jobs: usize,
}

#[derive(Debug, Serialize)]
struct DryRun {
    jobs: Vec<ListedJob>,
    estimate: SweepEstimate,
}

/// Measured cost of the jobs that are done.
#[derive(Clone, Copy, Debug, Default)]
struct Measured {
    jobs: usize,
    wall_s: f64,
    /// Seconds of log of jobs whose length is known.
    log_s: f64,
    memory_bytes: u64,
    rendering_s: f64,
    rendered: usize,
    rendered_log_s: f64,
}

/// Lists the jobs with an estimate of their cost; if none is done yet, the first one is run for the estimate.
pub(super) fn dry_run(sweep: &Sweep, limits: &PoolLimits, interrupt: &Interrupt, json: bool) -> Result<ExitOutcome> {
    let mut measured = measure(sweep)?;
    if measured.jobs == 0 {
        let Some(first) = sweep.jobs.first() else { bail!("the plan has no jobs") };
        notify(&format!("dcvins: running the first job to estimate the others: {}", first.job.describe()));
        let one = PoolLimits { jobs: 1, processors: (limits.processors / limits.jobs).max(1), ..*limits };
        let first = std::slice::from_ref(first);
        let outcome = Pool::new(&sweep.folder, &sweep.plan, &sweep.program, first, one).run(interrupt)?;
        if outcome.interrupted {
            return Ok(ExitOutcome::Interrupted);
        }
        measured = measure(sweep)?;
    }
    let listed = |job: &KeyedJob| ListedJob {
        key: job.key.clone(),
        job: job.job.describe(),
        done: sweep.folder.is_done(&job.key, &sweep.plan),
    };
    let jobs: Vec<ListedJob> = sweep.jobs.iter().map(listed).collect();
    let estimate = estimate(sweep, limits, &measured);
    if json {
        print_json(&DryRun { jobs, estimate })?;
        return Ok(ExitOutcome::Success);
    }
    let mut text = String::new();
    for ListedJob { key, job, done } in &jobs {
        let mark = if *done { "done" } else { "    " };
        text.push_str(&[&key[..SHOWN_KEY], mark, job].join("  "));
        text.push('\n');
    }
    let flights =
        if estimate.flights > 0 { format!(" and {} flights to render", estimate.flights) } else { String::new() };
    let time = if estimate.measured_jobs > 0 {
        format!(
            "about {} with {} at a time, up to {:.2} GiB for a job (from {} measured)",
            duration_text(estimate.wall_s),
            estimate.at_once,
            estimate.memory_per_job_bytes as f64 / f64::from(1 << 30),
            estimate.measured_jobs
        )
    } else {
        "no estimate, because the first job has no result".to_owned()
    };
    print(&format!("{text}{} jobs, {} to do{flights}: {time}\n", jobs.len(), estimate.jobs))?;
    Ok(ExitOutcome::Success)
}

/// Reads the measured cost of the jobs.
fn measure(sweep: &Sweep) -> Result<Measured> {
    let mut measured = Measured::default();
    let mut flights = BTreeMap::new();
    for job in &sweep.jobs {
        if let JobLog::Simulated(flight) = &job.job.log {
            flights.insert(flight.id(), flight);
        }
        if !job.job.subject.computes() {
            continue;
        }
        let Some(row) = sweep.folder.run_of(&job.key)? else { continue };
        let ran = matches!(row.text(0, "status"), Some("ok" | "not-initialized"));
        let Some(wall_s) = row.number(0, "wall_s").filter(|_| ran) else { continue };
        measured.jobs += 1;
        measured.wall_s += wall_s;
        measured.log_s += log_s(sweep, job);
        let memory_bytes = row.integer(0, "peak_memory_bytes").and_then(|bytes| u64::try_from(bytes).ok());
        measured.memory_bytes = measured.memory_bytes.max(memory_bytes.unwrap_or(0));
    }
    for rendered in flights.values().filter_map(|flight| sweep.folder.rendered(flight)) {
        measured.rendered += 1;
        measured.rendering_s += rendered.rendered_in_s;
        measured.rendered_log_s += rendered.duration_s;
    }
    Ok(measured)
}

/// Seconds of log of a job; 0 while they are unknown.
fn log_s(sweep: &Sweep, job: &KeyedJob) -> f64 {
    let of_flight = || match &job.job.log {
        JobLog::Simulated(flight) => sweep.folder.rendered(flight).map(|rendered| rendered.duration_s),
        JobLog::Recorded(_) => None,
    };
    job.job.log.duration_s().or_else(of_flight).unwrap_or(0.0)
}

/// Time by the seconds of log where they are known, else by the number of jobs.
fn estimate(sweep: &Sweep, limits: &PoolLimits, measured: &Measured) -> SweepEstimate {
    let left: Vec<&KeyedJob> = sweep.jobs.iter().filter(|job| !sweep.folder.is_done(&job.key, &sweep.plan)).collect();
    let mut flights = BTreeMap::new();
    for job in &left {
        if let JobLog::Simulated(flight) = &job.job.log
            && sweep.folder.rendered(flight).is_none()
        {
            flights.insert(flight.id(), flight.recipe.duration_s);
        }
    }
    let per = |total: f64, count: f64| if count > 0.0 { total / count } else { 0.0 };
    let mean_s = per(measured.wall_s, measured.jobs as f64);
    let per_log_s = per(measured.wall_s, measured.log_s);
    let job_s = |job: &&KeyedJob| match log_s(sweep, job) {
        _ if !job.job.subject.computes() => 0.0,
        known_s if known_s > 0.0 && per_log_s > 0.0 => known_s * per_log_s,
        _ => mean_s,
    };
    let render_mean_s = per(measured.rendering_s, measured.rendered as f64);
    let render_per_s = per(measured.rendering_s, measured.rendered_log_s);
    let render_s: f64 =
        flights.values().map(|duration_s| duration_s.map_or(render_mean_s, |seconds| seconds * render_per_s)).sum();
    let by_memory = limits.memory_bytes.checked_div(measured.memory_bytes).unwrap_or(u64::MAX);
    let at_once = limits.jobs.min(usize::try_from(by_memory).unwrap_or(usize::MAX)).clamp(1, left.len().max(1));
    SweepEstimate {
        jobs: left.len(),
        flights: flights.len(),
        at_once,
        wall_s: (left.iter().map(job_s).sum::<f64>() + render_s) / at_once as f64,
        memory_per_job_bytes: measured.memory_bytes,
        measured_jobs: measured.jobs,
    }
}
