//! Statistics of the groups of a study.

use serde::Serialize;

use super::arrange::Arranged;
use super::filter::RowFilter;
use super::metric::Metric;
use super::paired::{GroupDifference, paired_differences};
use super::spread::Spread;
use super::study::Study;
use super::success::{SuccessRate, success_rate};

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
