//! Differences of a metric between groups, on equal inputs.

use std::collections::{BTreeMap, BTreeSet};

use super::arrange::RowGroup;
use super::metric::Metric;
use super::spread::Spread;
use crate::study::{Cell, MeanInterval, PAIRING_COLUMNS, StudyTable};

/// Difference between a row of a group and the reference's row on the same inputs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairedDifference {
    pub row: usize,
    /// Value of the row in the shown unit.
    pub value: f64,
    /// Value of the reference in the shown unit.
    pub reference: f64,
}

impl PairedDifference {
    /// Value minus the reference's value.
    pub fn difference(&self) -> f64 {
        self.value - self.reference
    }
}

/// Comparison of a group with the reference.
#[derive(Clone, Debug, PartialEq)]
pub struct GroupDifference {
    pub name: String,
    /// The pairs in the order of the group's rows.
    pub pairs: Vec<PairedDifference>,
    /// Number of rows of the group without a partner, or without a value on one of the sides.
    pub unpaired: usize,
    /// Quantiles of the differences.
    pub spread: Option<Spread>,
    /// Mean difference with its 95 % interval (Student's t), `None` with fewer than two pairs.
    pub mean: Option<MeanInterval>,
    /// Number of pairs in which the value is below the reference's value.
    pub below: usize,
}

/// Columns in which the two rows of a pair agree: those that identify a run, without the grouping column and without
/// columns that determine the group (the specification of a run when runs are grouped by one of its keys).
fn shared_columns(table: &StudyTable, group: &str) -> Vec<&'static str> {
    let decides = |column: &str| {
        let mut group_of: BTreeMap<String, Cell> = BTreeMap::new();
        let mut several = BTreeSet::new();
        for row in 0..table.rows() {
            let value = table.cell(row, group);
            several.insert(value.to_string());
            if *group_of.entry(table.cell(row, column).to_string()).or_insert_with(|| value.clone()) != value {
                return false;
            }
        }
        several.len() > 1
    };
    PAIRING_COLUMNS
        .into_iter()
        .filter(|column| *column != group && table.place(column).is_some() && !decides(column))
        .collect()
}

/// Differences of `metric` between each group and the group named `reference`, on rows that agree in all other columns
/// that identify a run. If several rows of the reference agree, their mean is the reference value.
///
/// The column `group` defines the groups; the reference itself is omitted. Empty without such a group.
pub fn paired_differences(
    table: &StudyTable,
    groups: &[RowGroup],
    group: &str,
    reference: &str,
    metric: &Metric,
) -> Vec<GroupDifference> {
    let Some(base) = groups.iter().find(|known| known.name == reference) else { return Vec::new() };
    let shared = shared_columns(table, group);
    let key = |row: usize| -> Vec<String> { shared.iter().map(|column| table.cell(row, column).to_string()).collect() };
    let mut of_key: BTreeMap<Vec<String>, (f64, usize)> = BTreeMap::new();
    for (row, value) in metric.values(table, &base.rows) {
        let (sum, count) = of_key.entry(key(row)).or_default();
        (*sum, *count) = (*sum + value, *count + 1);
    }
    let differences = |of: &RowGroup| {
        let values = metric.values(table, &of.rows);
        let pair = |(row, value): (usize, f64)| {
            let (sum, count) = of_key.get(&key(row))?;
            Some(PairedDifference { row, value, reference: sum / *count as f64 })
        };
        let pairs: Vec<PairedDifference> = values.into_iter().filter_map(pair).collect();
        let values: Vec<f64> = pairs.iter().map(PairedDifference::difference).collect();
        GroupDifference {
            name: of.name.clone(),
            unpaired: of.rows.len() - pairs.len(),
            spread: Spread::of(values.iter().copied()),
            mean: MeanInterval::of(&values),
            below: values.iter().filter(|difference| **difference < 0.0).count(),
            pairs,
        }
    };
    groups.iter().filter(|of| of.name != reference).map(differences).collect()
}
