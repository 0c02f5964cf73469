//! Arguments of `dcvins sweep`.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;

use super::tolerance::Tolerance;

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
