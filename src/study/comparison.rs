//! Comparison of two studies: a metric is worse if it changed beyond its tolerance and beyond its noise.
//!
//! Runs are paired by log, disturbance, perturbation, seed and settings, see [`super::pairing`]. The difference of a
//! pair is the logarithm of the ratio of its two values, so that easy and difficult flights have equal weight. The mean
//! over all pairs and its 95 % interval (Student's t) are computed. A metric is worse when its mean ratio is beyond the
//! tolerance and the interval excludes 1.
//! A baseline is the table of runs reduced to what is kept for such comparisons.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;
use thiserror::Error;

use super::columns::{PAIRING_COLUMNS, run_column};
use super::pairing::{RunPair, pair_runs};
use super::statistics::MeanInterval;
use super::table::{StudyTable, TableError};
use crate::table::Direction;

/// Metric that compares the numbers of runs with a result.
pub const SUCCESS: &str = "success";
/// Minimum number of pairs for a verdict on a metric.
const LEAST_PAIRS: usize = 3;

/// Direction of change that is worse for a column of the table of runs; of an unknown one, larger is worse.
fn worse_direction(column: &str) -> Direction {
    run_column(column).map_or(Direction::Larger, |column| column.worse)
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PairedVerdict {
    /// Within the tolerance, or not distinguishable from noise.
    Unchanged,
    /// Better beyond the tolerance and the noise.
    Better,
    /// Worse beyond the tolerance and the noise.
    Worse,
    TooFewPairs,
}

impl PairedVerdict {
    pub fn name(self) -> &'static str {
        match self {
            Self::Unchanged => "unchanged",
            Self::Better => "better",
            Self::Worse => "worse",
            Self::TooFewPairs => "too few pairs",
        }
    }
}

/// Comparison of one metric over all pairs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MetricComparison {
    /// Column of the table of runs, or [`SUCCESS`].
    pub metric: String,
    /// Direction of change that is worse.
    pub direction: Direction,
    /// Relative change that still counts as equal.
    pub tolerance: f64,
    /// Number of pairs with a positive value in both studies.
    pub pairs: usize,
    /// Geometric mean of new over old.
    pub ratio: Option<f64>,
    /// 95 % interval of `ratio`.
    pub interval: Option<[f64; 2]>,
    /// Pair whose ratio is farthest in the worse direction, as a starting point for an investigation.
    pub worst_pair: Option<WorstPair>,
    pub verdict: PairedVerdict,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WorstPair {
    /// Log, levels, seed and specification.
    pub run: String,
    /// Value in the baseline.
    pub old: f64,
    pub new: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StudyComparison {
    /// Number of runs of the baseline.
    pub old_runs: usize,
    pub new_runs: usize,
    /// Number of runs in both studies.
    pub pairs: usize,
    /// Pairs of which only the baseline has a result.
    pub newly_failed: Vec<String>,
    /// Pairs of which only the new study has a result.
    pub newly_succeeded: Vec<String>,
    /// Number of pairs on logs of different content.
    pub other_logs: usize,
    /// Number of pairs of runs with the same name and different settings.
    pub other_settings: usize,
    /// Metrics in the order of their names, [`SUCCESS`] last.
    pub metrics: Vec<MetricComparison>,
}

/// Reason why two studies cannot be compared.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum ComparisonError {
    #[error("tolerance '{name}': the table of runs has no column of numbers of that name; it has {}", known.join(", "))]
    UnknownMetric {
        name: String,
        /// Numeric columns of the table of runs.
        known: Vec<String>,
    },
    #[error("the {which} has no column '{column}': not a table of runs of a study (results.parquet)")]
    MissingColumn {
        /// The baseline or the new study.
        which: &'static str,
        column: &'static str,
    },
    #[error(
        "no run of the study is in the baseline: they are paired by log, disturbance, perturbation, seed and the settings or \
         the name of the run"
    )]
    Unpaired,
}

/// Compares a study with a baseline; `tolerances` are relative changes by column. [`SUCCESS`] is always compared, and
/// duplicate rows of a table count once.
///
/// # Errors
/// For a tolerance of an unknown column, and if no runs can be paired.
pub fn compare(
    old: &StudyTable,
    new: &StudyTable,
    tolerances: &BTreeMap<String, f64>,
) -> Result<StudyComparison, ComparisonError> {
    for (which, table) in [("baseline", old), ("study", new)] {
        if let Some(column) = PAIRING_COLUMNS.into_iter().find(|column| table.place(column).is_none()) {
            return Err(ComparisonError::MissingColumn { which, column });
        }
    }
    let metrics = tolerances.iter().filter(|(name, _)| *name != SUCCESS);
    for (name, _) in metrics.clone() {
        check_metric(new, name)?;
    }
    let pairs = pair_runs(old, new);
    if pairs.is_empty() {
        return Err(ComparisonError::Unpaired);
    }
    let ok = |table: &StudyTable, row: usize| table.text(row, "status") == Some("ok");
    let changed = |was: bool| -> Vec<String> {
        let of = pairs.iter().filter(|pair| ok(old, pair.old) == was && ok(new, pair.new) != was);
        of.map(|pair| pair.name.clone()).collect()
    };
    let (newly_failed, newly_succeeded) = (changed(true), changed(false));
    let other_log = |pair: &&RunPair| old.text(pair.old, "log_sha256") != new.text(pair.new, "log_sha256");
    let other_logs = pairs.iter().filter(other_log).count();
    let other_settings = pairs.iter().filter(|pair| !pair.same_settings).count();
    let mut compared: Vec<MetricComparison> = metrics
        .map(|(name, tolerance)| {
            let values = pairs.iter().filter(|pair| ok(old, pair.old) && ok(new, pair.new));
            let values = values.filter_map(|pair| {
                Some((pair.name.as_str(), old.number(pair.old, name)?, new.number(pair.new, name)?))
            });
            compare_metric(name, *tolerance, &values.collect::<Vec<_>>())
        })
        .collect();
    let tolerance = tolerances.get(SUCCESS).copied().unwrap_or(0.0);
    compared.push(compare_success(tolerance, pairs.len(), newly_failed.len(), newly_succeeded.len()));
    Ok(StudyComparison {
        old_runs: old.rows(),
        new_runs: new.rows(),
        pairs: pairs.len(),
        newly_failed,
        newly_succeeded,
        other_logs,
        other_settings,
        metrics: compared,
    })
}

fn check_metric(table: &StudyTable, name: &str) -> Result<(), ComparisonError> {
    use crate::table::ColumnType::{Integer, Number};
    let numeric = |column: &&super::table::StudyColumn| {
        matches!(column.values.column_type(), Number | Integer) && !PAIRING_COLUMNS.contains(&column.name.as_str())
    };
    if table.column(name).as_ref().is_some_and(numeric) {
        return Ok(());
    }
    let known = table.columns().iter().filter(numeric).map(|column| column.name.clone());
    Err(ComparisonError::UnknownMetric { name: name.to_owned(), known: known.chain([SUCCESS.to_owned()]).collect() })
}

/// Compares one metric; `values` are the run, the old and the new value of each pair.
fn compare_metric(name: &str, tolerance: f64, values: &[(&str, f64, f64)]) -> MetricComparison {
    let direction = worse_direction(name);
    // The logarithm of the ratio needs positive values.
    let positive: Vec<_> = values.iter().filter(|(_, old, new)| *old > 0.0 && *new > 0.0).collect();
    let ratios: Vec<f64> = positive.iter().map(|(_, old, new)| (new / old).ln()).collect();
    let badness = |ratio: f64| match direction {
        Direction::Larger => ratio,
        Direction::Smaller => -ratio,
        Direction::Either => ratio.abs(),
    };
    let worst = positive.iter().zip(&ratios).max_by(|a, b| badness(*a.1).total_cmp(&badness(*b.1)));
    let worst_pair = worst.map(|((run, old, new), _)| WorstPair { run: (*run).to_owned(), old: *old, new: *new });
    let interval = MeanInterval::of(&ratios).filter(|interval| interval.pairs >= LEAST_PAIRS);
    let verdict = interval.map_or(PairedVerdict::TooFewPairs, |interval| judge(&interval, direction, tolerance));
    MetricComparison {
        metric: name.to_owned(),
        direction,
        tolerance,
        pairs: ratios.len(),
        ratio: interval.map(|interval| interval.mean.exp()),
        interval: interval.map(|interval| [interval.low.exp(), interval.high.exp()]),
        worst_pair,
        verdict,
    }
}

/// Verdict on an interval of log-ratios.
fn judge(interval: &MeanInterval, direction: Direction, tolerance: f64) -> PairedVerdict {
    let limit = tolerance.ln_1p();
    let rises = interval.mean > limit && interval.low > 0.0;
    let falls = interval.mean < -limit && interval.high < 0.0;
    match (direction, rises, falls) {
        (_, false, false) => PairedVerdict::Unchanged,
        (Direction::Either, ..) | (Direction::Larger, true, _) | (Direction::Smaller, _, true) => PairedVerdict::Worse,
        (Direction::Larger | Direction::Smaller, ..) => PairedVerdict::Better,
    }
}

/// Compares the numbers of runs with a result: newly failed minus newly succeeded pairs, relative to all pairs.
fn compare_success(tolerance: f64, pairs: usize, failed: usize, succeeded: usize) -> MetricComparison {
    let allowed = tolerance * pairs as f64;
    let change = failed as f64 - succeeded as f64;
    let verdict = match change {
        change if change > allowed => PairedVerdict::Worse,
        change if change < -allowed => PairedVerdict::Better,
        _ => PairedVerdict::Unchanged,
    };
    MetricComparison {
        metric: SUCCESS.to_owned(),
        direction: Direction::Smaller,
        tolerance,
        pairs,
        ratio: None,
        interval: None,
        worst_pair: None,
        verdict,
    }
}

impl StudyComparison {
    /// True if a metric got worse or there are too few pairs for a verdict.
    pub fn fails(&self) -> bool {
        self.metrics.iter().any(|metric| matches!(metric.verdict, PairedVerdict::Worse | PairedVerdict::TooFewPairs))
    }
}

/// Markdown for the summary of a CI job.
impl fmt::Display for StudyComparison {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let verdict = if self.fails() { "**worse than the baseline**" } else { "not worse than the baseline" };
        writeln!(out, "Study: {verdict}\n")?;
        writeln!(
            out,
            "{} of {} runs paired with {} runs of the baseline.\n",
            self.pairs, self.new_runs, self.old_runs
        )?;
        writeln!(
            out,
            "| metric | worse when | tolerance | pairs | new / old | 95 % interval | verdict | worst pair |"
        )?;
        writeln!(out, "| --- | --- | --- | --- | --- | --- | --- | --- |")?;
        for metric in &self.metrics {
            let worse = match metric.direction {
                Direction::Larger => "larger",
                Direction::Smaller => "smaller",
                Direction::Either => "changed",
            };
            let (ratio, interval) = if metric.metric == SUCCESS {
                (format!("−{} +{}", self.newly_failed.len(), self.newly_succeeded.len()), String::new())
            } else {
                let ratio = metric.ratio.map_or_else(String::new, |ratio| format!("{ratio:.3}"));
                (ratio, metric.interval.map_or_else(String::new, |[low, high]| format!("{low:.3} to {high:.3}")))
            };
            let pair = metric.worst_pair.as_ref().map_or_else(String::new, |WorstPair { run, old, new }| {
                format!("{}: {old:.4} → {new:.4}", run.replace('|', "/"))
            });
            writeln!(
                out,
                "| `{}` | {worse} | {:.0} % | {} | {ratio} | {interval} | {} | {pair} |",
                metric.metric,
                100.0 * metric.tolerance,
                metric.pairs,
                metric.verdict.name()
            )?;
        }
        for (title, runs) in
            [("Without a result now", &self.newly_failed), ("With a result now", &self.newly_succeeded)]
        {
            if !runs.is_empty() {
                writeln!(out, "\n{title}: {}", runs.join("; "))?;
            }
        }
        if self.other_logs > 0 {
            writeln!(out, "\n{} pairs are on logs of different content (`log_sha256`).", self.other_logs)?;
        }
        if self.other_settings > 0 {
            let count = self.other_settings;
            writeln!(out, "\n{count} pairs are of runs with one name and different settings (`run`, `label`).")?;
        }
        writeln!(
            out,
            "\nnew / old: geometric mean over the pairs, with Student's t interval of the mean log-ratio. Worse: beyond \
             the tolerance, and the interval excludes 1."
        )
    }
}

/// The table of runs without what differs between two machines: paths, the program, times and memory.
///
/// Equal results give equal tables on every machine, so a baseline can be committed.
///
/// # Errors
/// Never for a table, whose columns have one length and different names.
pub fn baseline_table(runs: &StudyTable) -> Result<StudyTable, TableError> {
    let kept = |name: &str| !run_column(name).is_some_and(|column| column.local);
    StudyTable::new(runs.columns().iter().filter(|column| kept(&column.name)).cloned().collect())
}
