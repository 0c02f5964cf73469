//! Statistics of the groups of a study.

use serde::Serialize;

use super::arrange::Arranged;
use super::filter::RowFilter;
use super::metric::Metric;
use super::paired::{GroupDifference, paired_differences};
use super::spread::Spread;
use super::study::Study;

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GroupSummary {
    pub name: String,
    /// Rate of runs that meet the condition of success.
    pub success: SuccessRate,
    /// Quantiles of the metric in the shown unit.
    pub spread: Option<Spread>,
    /// Number of pairs with the reference group.
    pub pairs: usize,
    /// Mean difference to the reference group on equal inputs with the ends of its 95 % interval: lower end, mean,
    /// upper end, in the shown unit.
    pub difference: Option<[f64; 3]>,
}

/// Statistics of the groups of arranged rows; differences are `None` without a grouping column and for the reference
/// itself.
pub fn summarize_groups(
    study: &Study,
    arranged: &Arranged,
    group: Option<&str>,
    reference: &str,
    metric: Option<&Metric>,
    success: &RowFilter,
) -> Vec<GroupSummary> {
    let table = &study.runs;
    let compare = |(group, metric)| paired_differences(table, &arranged.groups, group, reference, metric);
    let differences: Vec<GroupDifference> = group.zip(metric).map(compare).unwrap_or_default();
    let summary = |of: &super::arrange::RowGroup| {
        let difference = differences.iter().find(|difference| difference.name == of.name);
        let values = metric.map(|metric| metric.values(table, &of.rows)).unwrap_or_default();
        GroupSummary {
            name: of.name.clone(),
            success: success_rate(of.rows.iter().filter(|row| success.passes(table, **row)).count(), of.rows.len()),
            spread: Spread::of(values.into_iter().map(|(_, value)| value)),
            pairs: difference.map_or(0, |difference| difference.pairs.len()),
            difference: difference.and_then(|it| it.mean).map(|mean| [mean.low, mean.mean, mean.high]),
        }
    };
    arranged.groups.iter().map(summary).collect()
}

/// Success rate of a number of runs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SuccessRate {
    pub successes: usize,
    pub runs: usize,
    /// Rate in 0 to 1, 0 without runs.
    pub rate: f64,
    /// Lower end of the 95 % interval.
    pub low: f64,
    /// Upper end of the 95 % interval.
    pub high: f64,
}

/// Two-sided 95 % quantile of the normal distribution.
const Z: f64 = 1.959_963_984_540_054;

/// The rate with Wilson's score interval (Wilson 1927), which stays within 0 and 1 and is valid for few runs and for
/// rates near 0 or 1.
pub fn success_rate(successes: usize, runs: usize) -> SuccessRate {
    if runs == 0 {
        return SuccessRate { successes, runs, rate: 0.0, low: 0.0, high: 1.0 };
    }
    let (count, rate) = (runs as f64, successes as f64 / runs as f64);
    let scale = 1.0 / (1.0 + Z * Z / count);
    let center = scale * (rate + Z * Z / (2.0 * count));
    let half = scale * Z * (rate * (1.0 - rate) / count + Z * Z / (4.0 * count * count)).sqrt();
    // The ends are set exactly where rounding would miss 0 or 1.
    let low = if successes == 0 { 0.0 } else { (center - half).max(0.0) };
    let high = if successes == runs { 1.0 } else { (center + half).min(1.0) };
    SuccessRate { successes, runs, rate, low, high }
}
