//! Arguments of `dcvins sweep`, and the plan that they name with its folder and its jobs.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::str::FromStr;

use anyhow::Result;
use clap::Args;
use dcvins::study::{self, KeyedJob, StudyPlan};
use dcvins::sweep::{StudyFolder, find_logs, program_identity, read_plan};
use dcvins::text::Entry;

use crate::cli::terminal::Progress;

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
pub(super) struct Sweep {
    pub(super) plan: StudyPlan,
    pub(super) folder: StudyFolder,
    pub(super) program: String,
    pub(super) jobs: Vec<KeyedJob>,
}

/// Reads the plan, finds its logs and lists its jobs.
pub(super) fn open(arguments: &SweepArguments) -> Result<Sweep> {
    let plan = read_plan(&arguments.plan)?;
    let folder = StudyFolder::create(&arguments.out, &plan, &arguments.plan)?;
    let program = program_identity()?;
    let progress = Progress::spinner("reading the logs");
    let logs = find_logs(&plan, &arguments.plan, &folder.hash_cache())?;
    drop(progress);
    let jobs = study::expand(&plan, &logs, &program);
    Ok(Sweep { plan, folder, program, jobs })
}

/// Removes the rows of jobs that have no result.
pub(super) fn forget_failed(sweep: &Sweep) -> Result<()> {
    for job in &sweep.jobs {
        let row = sweep.folder.run_of(&job.key)?;
        if row.is_some_and(|row| !matches!(row.text(0, "status"), Some("ok" | "not-initialized"))) {
            sweep.folder.forget(&job.key)?;
        }
    }
    Ok(())
}

/// Metrics that are compared if neither the plan nor the command line names one.
const STANDARD: [(&str, f64); 1] = [("ate_rmse_m", 0.1)];

/// Allowed relative change of a metric.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tolerance {
    metric: String,
    ratio: f64,
}

impl FromStr for Tolerance {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let entry = Entry::parse(text).filter(|entry| !entry.key.is_empty());
        entry
            .and_then(|entry| Some(Self { metric: entry.key.to_owned(), ratio: entry.number(&(0.0..=f64::MAX))? }))
            .ok_or_else(|| "expected COLUMN=RATIO with a ratio from 0 up, as in ate_rmse_m=0.1".to_owned())
    }
}

/// Tolerances of the command line, else of the plan, else the defaults.
pub(super) fn tolerances(plan: &StudyPlan, given: &[Tolerance]) -> BTreeMap<String, f64> {
    let standard = || STANDARD.map(|(metric, ratio)| (metric.to_owned(), ratio)).into();
    match (given, plan.tolerances.is_empty()) {
        ([], true) => standard(),
        ([], false) => plan.tolerances.clone(),
        _ => given.iter().map(|tolerance| (tolerance.metric.clone(), tolerance.ratio)).collect(),
    }
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

    #[test]
    fn a_tolerance_is_a_column_and_a_ratio() {
        let tolerance: Tolerance = "ate_rmse_m=0.1".parse().unwrap();
        assert_eq!((tolerance.metric.as_str(), tolerance.ratio), ("ate_rmse_m", 0.1));
        for wrong in ["ate_rmse_m", "=0.1", "ate_rmse_m=-0.1", "ate_rmse_m=a", "ate_rmse_m=inf"] {
            assert!(wrong.parse::<Tolerance>().is_err(), "{wrong}");
        }
    }
}
