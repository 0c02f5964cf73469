//! `dcvins sweep`: the runs of a plan, on this machine or on a cluster, and the tables of their results.

mod arguments;
mod estimate;
mod job;
mod pool;
mod slurm;

use std::path::PathBuf;

use anyhow::{Context as _, Result, bail};
use dcvins::study::{self, StudyTable};
use dcvins::sweep::{read_parquet, write_parquet, write_text};
use serde::Serialize;

use crate::cli::exit::ExitOutcome;
use crate::cli::interrupt::Interrupt;
use crate::cli::terminal::{notify, print, print_json};

pub(crate) use arguments::SweepArguments;
use arguments::{Sweep, forget_failed, open, tolerances};
pub(crate) use job::{SweepJobArguments, sweep_job};
use pool::{Pool, PoolLimits, PoolOutcome};

/// Fraction of the available memory that jobs may use by default.
const MEMORY_PART: f64 = 0.8;

/// Result of a sweep, for `--json`.
#[derive(Debug, Serialize)]
struct SweepReport {
    study: String,
    folder: PathBuf,
    jobs: usize,
    /// Number of jobs done before this sweep.
    skipped: usize,
    done: usize,
    /// Number of rows without a result.
    failed: usize,
    /// Number of jobs that have not run yet.
    missing: usize,
    files: Vec<PathBuf>,
    #[serde(skip_serializing_if = "Option::is_none")]
    comparison: Option<study::StudyComparison>,
}

pub(crate) fn sweep(arguments: &SweepArguments) -> Result<ExitOutcome> {
    let interrupt = Interrupt::watch()?;
    let baseline = arguments.baseline.as_deref().map(read_parquet).transpose()?;
    let sweep = open(arguments)?;
    if arguments.dry_run {
        return estimate::dry_run(&sweep, &limits(arguments), &interrupt, arguments.json);
    }
    if arguments.retry_failed {
        forget_failed(&sweep)?;
    }
    let mut report = SweepReport {
        study: sweep.plan.name.clone(),
        folder: sweep.folder.root().to_owned(),
        jobs: sweep.jobs.len(),
        skipped: 0,
        done: 0,
        failed: 0,
        missing: 0,
        files: Vec::new(),
        comparison: None,
    };
    if !arguments.collect {
        let outcome = run_jobs(&sweep, arguments, &interrupt, &mut report)?;
        if outcome.interrupted {
            let command = format!("dcvins sweep {} -o {}", arguments.plan.display(), arguments.out.display());
            notify(&format!("dcvins: interrupted; finished jobs are kept, resume with '{command}'"));
            return Ok(ExitOutcome::Interrupted);
        }
        if arguments.shard.is_some() {
            report.failed = outcome.failed;
            print_sweep(&report, arguments.json)?;
            return Ok(if outcome.failed > 0 { ExitOutcome::JobsFailed } else { ExitOutcome::Success });
        }
    }
    finish(&sweep, arguments, baseline.as_ref(), report)
}

/// Runs the jobs that are not done, here or on the cluster.
fn run_jobs(
    sweep: &Sweep,
    arguments: &SweepArguments,
    interrupt: &Interrupt,
    report: &mut SweepReport,
) -> Result<PoolOutcome> {
    let mut jobs = sweep.jobs.clone();
    if let Some((index, count)) = arguments.shard {
        jobs = study::shard(jobs, index, count);
    }
    report.jobs = jobs.len();
    jobs.retain(|job| !sweep.folder.is_done(&job.key, &sweep.plan));
    report.skipped = report.jobs - jobs.len();
    if jobs.is_empty() {
        return Ok(PoolOutcome::default());
    }
    let outcome = if arguments.slurm {
        slurm::run(sweep, arguments, &jobs, interrupt)?
    } else {
        Pool::new(&sweep.folder, &sweep.plan, &sweep.program, &jobs, limits(arguments)).run(interrupt)?
    };
    report.done = outcome.done;
    Ok(outcome)
}

/// Limits of the pool on this machine.
fn limits(arguments: &SweepArguments) -> PoolLimits {
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    let memory_bytes = arguments.memory.map_or_else(available_memory, |gib| (gib * f64::from(1 << 30)) as u64);
    PoolLimits { jobs: arguments.jobs.map_or(processors, usize::from), processors, memory_bytes }
}

/// Fraction [`MEMORY_PART`] of the system's available memory in bytes, unlimited if it is unknown.
fn available_memory() -> u64 {
    let available = || -> Option<u64> {
        let text = std::fs::read_to_string("/proc/meminfo").ok()?;
        let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
        let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
        Some((MEMORY_PART * kibibytes as f64 * 1024.0) as u64)
    };
    available().unwrap_or(u64::MAX)
}

/// Writes the tables, compares them with the baseline and prints the result.
fn finish(
    sweep: &Sweep,
    arguments: &SweepArguments,
    baseline: Option<&StudyTable>,
    mut report: SweepReport,
) -> Result<ExitOutcome> {
    let (tables, missing) = sweep.folder.collect(&sweep.jobs, &sweep.plan)?;
    report.jobs = sweep.jobs.len();
    report.missing = missing;
    report.failed = failed_rows(&tables.runs);
    report.files = sweep.folder.write_tables(&tables, &sweep.plan)?;
    if let Some(path) = arguments.write_baseline.as_ref().filter(|_| missing == 0) {
        write_parquet(&study::baseline_table(&tables.runs)?, path)?;
        report.files.push(path.clone());
    }
    if let Some(baseline) = baseline {
        let tolerances = tolerances(&sweep.plan, &arguments.tolerance);
        report.comparison = Some(study::compare(baseline, &tables.runs, &tolerances)?);
    }
    print_sweep(&report, arguments.json)?;
    if !sweep.plan.tables.is_empty() && !arguments.json {
        print(&format!("\n{}", sweep.plan.tables_text(&tables.runs)))?;
    }
    if let Some(comparison) = &report.comparison {
        match &arguments.summary {
            Some(path) => write_text(path, &comparison.to_string())?,
            None if !arguments.json => print(&format!("\n{comparison}"))?,
            None => {}
        }
        if comparison.fails() {
            bail!("the study is worse than the baseline '{}'", baseline_name(arguments));
        }
    }
    if missing > 0 {
        bail!("{missing} of {} jobs are not done; the tables contain the others", sweep.jobs.len());
    }
    Ok(if report.failed > 0 { ExitOutcome::JobsFailed } else { ExitOutcome::Success })
}

fn baseline_name(arguments: &SweepArguments) -> String {
    arguments.baseline.as_deref().map_or_else(String::new, |path| path.display().to_string())
}

/// Number of jobs without a result.
fn failed_rows(runs: &StudyTable) -> usize {
    let failed = |row: &usize| !matches!(runs.text(*row, "status"), Some("ok" | "not-initialized"));
    (0..runs.rows()).filter(failed).count()
}

fn print_sweep(report: &SweepReport, json: bool) -> Result<()> {
    if json {
        return print_json(report);
    }
    let SweepReport { study, jobs, skipped, done, failed, missing, files, .. } = report;
    let mut text = format!("{study}: {jobs} jobs, {done} done now, {skipped} done before, {failed} without a result");
    if *missing > 0 {
        text.push_str(", ");
        text.push_str(&missing.to_string());
        text.push_str(" not run");
    }
    text.push('\n');
    for file in files {
        text.push_str("  ");
        text.push_str(&file.display().to_string());
        text.push('\n');
    }
    print(&text).context("cannot print the result")
}
