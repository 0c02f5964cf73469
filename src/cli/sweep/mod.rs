//! `dcvins sweep`: the runs of a plan, on this machine or on a cluster, and the tables of their results.

mod estimate;
mod job;
mod pool;
mod slurm;
mod tolerance;

use std::path::PathBuf;

use anyhow::{Context as _, Result, bail};
use clap::Args;
use dcvins::export;
use dcvins::export::study::{StudyFolder, find_logs, program_identity, read_parquet, read_plan, write_parquet};
use dcvins::study::{self, KeyedJob, StudyPlan, StudyTable};
use serde::Serialize;

use crate::cli::exit::Outcome;
use crate::cli::interrupt::Interrupt;
use crate::cli::terminal::{Progress, notify, print, print_json};

pub(crate) use job::{SweepJobArguments, sweep_job};
use pool::{Pool, PoolLimits, PoolOutcome};
use tolerance::Tolerance;

/// Fraction of the available memory that jobs may use by default.
const MEMORY_PART: f64 = 0.8;

#[derive(Args, Clone, Debug)]
pub(crate) struct SweepArguments {
    /// The plan: logs, runs, perturbations, disturbances and seeds; docs/commands.md describes it.
    #[arg(value_name = "PLAN.toml")]
    pub plan: PathBuf,
    /// Folder of the study; an existing study is resumed.
    #[arg(short = 'o', long, visible_alias = "output", value_name = "DIR")]
    pub out: PathBuf,
    /// List the jobs and estimate time and memory, from jobs that are done or from the first one.
    #[arg(long)]
    pub dry_run: bool,
    /// Number of jobs at a time [default: the processors of this machine].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub jobs: Option<u16>,
    /// Memory in GiB for all jobs together [default: 80 % of the available memory].
    #[arg(long, value_name = "GIB", value_parser = positive)]
    pub memory: Option<f64>,
    /// Run jobs again that failed in an earlier sweep.
    #[arg(long)]
    pub retry_failed: bool,
    /// Run only part I of N (1 to N) of the jobs and write no tables, for other engines.
    #[arg(long, value_name = "I/N", value_parser = shard, conflicts_with_all = ["dry_run", "collect", "slurm", "baseline"])]
    pub shard: Option<(usize, usize)>,
    /// Run no jobs; write the tables of the jobs that are done.
    #[arg(long, conflicts_with_all = ["dry_run", "slurm"])]
    pub collect: bool,
    /// Run the jobs as an array of the cluster manager Slurm, wait for it and write the tables.
    #[arg(long, conflicts_with = "dry_run")]
    pub slurm: bool,
    /// Compare with the results.parquet of an earlier study; exit code 1 if a metric got worse.
    #[arg(long, value_name = "OLD.parquet", conflicts_with = "dry_run")]
    pub baseline: Option<PathBuf>,
    /// Allowed relative change of a column of the table of runs, or of "success"; may be given several times
    /// [default: the plan's, else 10 % of the ATE].
    #[arg(long, value_name = "KEY=RATIO", requires = "baseline")]
    pub tolerance: Vec<Tolerance>,
    /// Write the table of runs without paths, program, times and memory, as a baseline of later sweeps.
    #[arg(long, value_name = "NEW.parquet", conflicts_with_all = ["dry_run", "shard"])]
    pub write_baseline: Option<PathBuf>,
    /// Write the comparison as Markdown into this file instead of standard output.
    #[arg(long, value_name = "FILE.md", requires = "baseline")]
    pub summary: Option<PathBuf>,
    /// Print the result as JSON.
    #[arg(long)]
    pub json: bool,
}

fn positive(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|value| value.is_finite() && *value > 0.0);
    value.ok_or_else(|| "expected a number above 0".to_owned())
}

fn shard(text: &str) -> Result<(usize, usize), String> {
    let parts = text.split_once('/').and_then(|(index, count)| Some((index.parse().ok()?, count.parse().ok()?)));
    let inside = parts.filter(|(index, count)| (1..=*count).contains(index));
    inside.ok_or_else(|| "expected I/N with I from 1 to N, as in 3/8".to_owned())
}

/// A plan with its folder and its jobs.
struct Sweep {
    plan: StudyPlan,
    folder: StudyFolder,
    program: String,
    jobs: Vec<KeyedJob>,
}

/// Result of a sweep, for `--json`.
#[derive(Debug, Serialize)]
struct SweepReport {
    study: String,
    folder: PathBuf,
    jobs: usize,
    /// Number of jobs done before this sweep.
    skipped: usize,
    /// Number of jobs done by this sweep.
    done: usize,
    /// Number of rows without a result.
    failed: usize,
    /// Number of jobs that have not run yet.
    missing: usize,
    files: Vec<PathBuf>,
    #[serde(skip_serializing_if = "Option::is_none")]
    comparison: Option<study::StudyComparison>,
}

pub(crate) fn sweep(arguments: &SweepArguments) -> Result<Outcome> {
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
            return Ok(Outcome::Interrupted);
        }
        if arguments.shard.is_some() {
            report.failed = outcome.failed;
            print_sweep(&report, arguments.json)?;
            return Ok(if outcome.failed > 0 { Outcome::JobsFailed } else { Outcome::Success });
        }
    }
    finish(&sweep, arguments, baseline.as_ref(), report)
}

/// Reads the plan, finds its logs and lists its jobs.
fn open(arguments: &SweepArguments) -> Result<Sweep> {
    let plan = read_plan(&arguments.plan)?;
    let folder = StudyFolder::create(&arguments.out, &plan, &arguments.plan)?;
    let program = program_identity()?;
    let progress = Progress::spinner("reading the logs");
    let logs = find_logs(&plan, &arguments.plan, &folder.hash_cache())?;
    drop(progress);
    let jobs = study::expand(&plan, &logs, &program);
    Ok(Sweep { plan, folder, program, jobs })
}

fn forget_failed(sweep: &Sweep) -> Result<()> {
    for job in &sweep.jobs {
        let row = sweep.folder.run_of(&job.key)?;
        if row.is_some_and(|row| !matches!(row.text(0, "status"), Some("ok" | "not-initialized"))) {
            sweep.folder.forget(&job.key)?;
        }
    }
    Ok(())
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
) -> Result<Outcome> {
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
        let tolerances = tolerance::tolerances(&sweep.plan, &arguments.tolerance);
        report.comparison = Some(study::compare(baseline, &tables.runs, &tolerances)?);
    }
    print_sweep(&report, arguments.json)?;
    if !sweep.plan.tables.is_empty() && !arguments.json {
        print(&format!("\n{}", sweep.plan.tables_text(&tables.runs)))?;
    }
    if let Some(comparison) = &report.comparison {
        match &arguments.summary {
            Some(path) => export::study::write_text(path, &comparison.to_string())?,
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
    Ok(if report.failed > 0 { Outcome::JobsFailed } else { Outcome::Success })
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_are_counted_from_one() {
        assert_eq!(shard("3/8"), Ok((3, 8)));
        for wrong in ["0/8", "9/8", "3", "a/8", "3/0", "-1/2"] {
            assert!(shard(wrong).is_err(), "{wrong}");
        }
    }
}
