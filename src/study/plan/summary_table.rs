//! Markdown tables of a study: runs in groups, statistics of their columns, and reference values from other sources.

use std::collections::BTreeMap;

use crate::geometry::median;
use crate::study::columns::{PAIRING_COLUMNS, runs_table};
use crate::study::table::StudyTable;
use crate::table::ColumnType::{Integer, Number};
use crate::text::Named;

/// Statistic that reduces the values of a group to one cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Statistic {
    /// Median (the upper one of an even count), with the lowest and the highest value.
    #[default]
    Median,
    /// Arithmetic mean, with the lowest and the highest value.
    Mean,
    Sum,
    /// Geometric mean of the ratios to the runs selected by [`SummaryTable::against`], with the lowest and the highest
    /// one.
    Ratio,
}

impl Named for Statistic {
    const NAMES: &'static [(Self, &'static str)] =
        &[(Self::Median, "median"), (Self::Mean, "mean"), (Self::Sum, "sum"), (Self::Ratio, "ratio")];
}

#[derive(Clone, Debug, PartialEq)]
pub struct SummaryColumn {
    /// Numeric column of the table of runs.
    pub column: String,
    /// Heading of the column.
    pub title: String,
    pub statistic: Statistic,
    /// Factor applied to the values, to convert their unit.
    pub factor: f64,
    /// Digits after the decimal point.
    pub digits: usize,
}

/// A value from another source, such as a publication, for one group.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReferenceValue {
    /// Heading of its column.
    pub title: String,
    /// Group to which it belongs: the values of [`SummaryTable::rows`].
    pub row: Vec<String>,
    pub value: String,
}

/// A table with one row for each group of runs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SummaryTable {
    pub title: String,
    /// Columns of the table of runs by which runs are grouped.
    pub rows: Vec<String>,
    /// Values of columns that a run must have to be included.
    pub only: BTreeMap<String, Vec<String>>,
    /// Column values that define the reference of each run, for [`Statistic::Ratio`]: the run with these values and
    /// otherwise the same inputs.
    pub against: BTreeMap<String, String>,
    pub columns: Vec<SummaryColumn>,
    /// Reference values from other sources.
    pub references: Vec<ReferenceValue>,
}

/// The runs of a table, indexed for ratios.
struct Runs<'a> {
    table: &'a StudyTable,
    /// Row of each run with a result, by the columns that distinguish runs.
    places: BTreeMap<Vec<String>, usize>,
}

/// Columns that identify a run: names instead of specifications, because plans refer to runs by name.
fn identity_columns() -> impl Iterator<Item = &'static str> {
    PAIRING_COLUMNS.into_iter().map(|column| if column == "run" { "label" } else { column })
}

impl<'a> Runs<'a> {
    fn of(table: &'a StudyTable) -> Self {
        let identity =
            |row: usize| identity_columns().map(|column| table.cell(row, column).to_string()).collect::<Vec<_>>();
        let done = (0..table.rows()).filter(|row| table.text(*row, "status") == Some("ok"));
        Self { table, places: done.map(|row| (identity(row), row)).collect() }
    }

    /// Row of the run that differs from this one only in the columns of `against`.
    fn reference(&self, row: usize, against: &BTreeMap<String, String>) -> Option<usize> {
        let cell =
            |column: &str| against.get(column).cloned().unwrap_or_else(|| self.table.cell(row, column).to_string());
        self.places.get(&identity_columns().map(cell).collect::<Vec<_>>()).copied()
    }
}

impl SummaryTable {
    /// The table as Markdown. Groups are in the order of their first run; runs without a result are counted but
    /// excluded from the statistics.
    pub fn markdown(&self, runs: &StudyTable) -> String {
        let (groups, known) = (self.groups(runs), Runs::of(runs));
        let mut titles: Vec<&str> = Vec::new();
        for reference in &self.references {
            if !titles.contains(&reference.title.as_str()) {
                titles.push(&reference.title);
            }
        }
        let head = self.rows.iter().map(String::as_str).chain(["runs", "without a result"]);
        let head = head.chain(titles.iter().copied()).chain(self.columns.iter().map(|column| column.title.as_str()));
        let head: Vec<String> = head.map(plain).collect();
        let mut lines = vec![format!("{}\n", self.title), line(&head), line(&vec!["---".to_owned(); head.len()])];
        for (group, rows) in &groups {
            let done: Vec<usize> = rows.iter().copied().filter(|row| runs.text(*row, "status") == Some("ok")).collect();
            let mut cells: Vec<String> = group.iter().map(|name| plain(name)).collect();
            cells.extend([rows.len().to_string(), (rows.len() - done.len()).to_string()]);
            cells.extend(titles.iter().map(|title| {
                let found = self.references.iter().find(|value| value.title == *title && value.row == *group);
                found.map_or_else(String::new, |value| plain(&value.value))
            }));
            cells.extend(self.columns.iter().map(|column| self.cell(column, &done, &known)));
            lines.push(line(&cells));
        }
        let mut text = lines.join("\n");
        text.push('\n');
        text
    }

    /// The runs of each group, in the order of the first run.
    fn groups(&self, runs: &StudyTable) -> Vec<(Vec<String>, Vec<usize>)> {
        let mut groups: Vec<(Vec<String>, Vec<usize>)> = Vec::new();
        let counted = |row: &usize| {
            self.only.iter().all(|(column, values)| values.contains(&runs.cell(*row, column).to_string()))
        };
        for row in (0..runs.rows()).filter(counted) {
            let name: Vec<String> = self.rows.iter().map(|column| runs.cell(row, column).to_string()).collect();
            match groups.iter_mut().find(|(known, _)| *known == name) {
                Some((_, rows)) => rows.push(row),
                None => groups.push((name, vec![row])),
            }
        }
        groups
    }

    fn cell(&self, column: &SummaryColumn, rows: &[usize], known: &Runs<'_>) -> String {
        let value = |row: usize| known.table.number(row, &column.column).map(|value| value * column.factor);
        let mut values: Vec<f64> = rows.iter().filter_map(|row| value(*row)).collect();
        if column.statistic == Statistic::Ratio {
            let ratio = |row: &usize| {
                let (new, old) = (value(*row)?, value(known.reference(*row, &self.against)?)?);
                (new > 0.0 && old > 0.0).then_some(new / old)
            };
            values = rows.iter().filter_map(ratio).collect();
        }
        if values.is_empty() {
            return "–".to_owned();
        }
        let count = values.len() as f64;
        let of_all = match column.statistic {
            Statistic::Median => median(values.iter().copied()).unwrap_or_default(),
            Statistic::Mean => values.iter().sum::<f64>() / count,
            Statistic::Sum => values.iter().sum(),
            Statistic::Ratio => (values.iter().map(|ratio| ratio.ln()).sum::<f64>() / count).exp(),
        };
        let digits = column.digits;
        if column.statistic == Statistic::Sum || values.len() == 1 {
            return format!("{of_all:.digits$}");
        }
        let lowest = values.iter().copied().fold(f64::INFINITY, f64::min);
        let highest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        format!("{of_all:.digits$} [{lowest:.digits$}, {highest:.digits$}]")
    }
}

/// Formats a row of a Markdown table.
fn line(cells: &[String]) -> String {
    format!("| {} |", cells.join(" | "))
}

/// Replaces characters that would end a cell of a Markdown table.
fn plain(text: &str) -> String {
    text.replace('|', "/").replace(['\n', '\r'], " ")
}

/// True if `name` is a column of the table of runs (with `numeric`: a numeric one).
pub(super) fn is_run_column(name: &str, numeric: bool) -> bool {
    let table = runs_table();
    table.column(name).is_some_and(|column| !numeric || matches!(column.values.column_type(), Number | Integer))
}
