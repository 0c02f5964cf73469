//! A table that is printed in Markdown and written as CSV, and the statistics that stand in its cells.

use std::fmt;
use std::fs;
use std::path::Path;

use anyhow::Result;

use crate::shared::markdown::write_table;

/// Rows of cells under a header.
pub(crate) struct Table {
    /// Name of its CSV file.
    name: &'static str,
    title: String,
    header: Vec<&'static str>,
    rows: Vec<Vec<String>>,
    /// What is said below.
    pub(crate) notes: Vec<String>,
}

impl Table {
    pub(crate) fn new(name: &'static str, title: impl Into<String>, header: &[&'static str]) -> Self {
        Self { name, title: title.into(), header: header.to_vec(), rows: Vec::new(), notes: Vec::new() }
    }

    pub(crate) fn row(&mut self, cells: impl IntoIterator<Item = impl Into<String>>) {
        self.rows.push(cells.into_iter().map(Into::into).collect());
    }

    /// Writes the table as CSV into a folder.
    pub(crate) fn write(&self, folder: &Path) -> Result<()> {
        let clean = |cell: &str| cell.replace(',', ";").replace('\n', " ");
        let mut text = self.header.join(",");
        text.push('\n');
        for row in &self.rows {
            text.push_str(&row.iter().map(|cell| clean(cell)).collect::<Vec<_>>().join(","));
            text.push('\n');
        }
        fs::write(folder.join(format!("{}.csv", self.name)), text)?;
        Ok(())
    }
}

impl fmt::Display for Table {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write_table(formatter, &self.title, &self.header, &self.rows)?;
        for note in &self.notes {
            writeln!(formatter, "\n{note}")?;
        }
        writeln!(formatter)
    }
}

/// Median of the values, and their smallest and largest.
pub(crate) fn spread(mut values: Vec<f64>) -> Option<[f64; 3]> {
    values.retain(|value| value.is_finite());
    values.sort_by(f64::total_cmp);
    let (first, last) = (*values.first()?, *values.last()?);
    let middle = values.len() / 2;
    let median =
        if values.len().is_multiple_of(2) { 0.5 * (values[middle - 1] + values[middle]) } else { values[middle] };
    Some([median, first, last])
}

pub(crate) fn median(values: Vec<f64>) -> Option<f64> {
    spread(values).map(|[median, ..]| median)
}

/// Median [smallest, largest].
pub(crate) fn written(values: Vec<f64>, digits: usize) -> String {
    spread(values).map_or_else(
        || "none".to_owned(),
        |[median, low, high]| format!("{median:.digits$} [{low:.digits$}, {high:.digits$}]"),
    )
}

/// Geometric mean [smallest, largest] of some ratios, and how many there are.
pub(crate) fn ratios(values: &[f64]) -> String {
    let logs: Vec<f64> = values.iter().filter(|ratio| **ratio > 0.0).map(|ratio| ratio.ln()).collect();
    let count = logs.len() as f64;
    spread(logs.clone()).map_or_else(
        || "none".to_owned(),
        |[_, low, high]| {
            let mean = logs.iter().sum::<f64>() / count;
            format!("{:.2} [{:.2}, {:.2}]", mean.exp(), low.exp(), high.exp())
        },
    )
}

/// A value of a CSV file or a cell, empty when there is none.
pub(crate) fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(String::new, |value| format!("{value:.digits$}"))
}

/// The value that χ² with this many degrees of freedom stays below with the probability of a normal quantile (Wilson and
/// Hilferty 1931).
pub(crate) fn chi2_quantile(degrees: f64, normal_quantile: f64) -> f64 {
    let spread = 2.0 / (9.0 * degrees);
    degrees * (1.0 - spread + normal_quantile * spread.sqrt()).powi(3)
}
