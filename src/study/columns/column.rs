//! Definition of a column: name, unit, meaning and value of a row.

use serde::Serialize;

use crate::study::table::{ColumnValues, StudyColumn, StudyTable};

/// Direction of change of a metric that is worse.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    Larger,
    Smaller,
    /// Any change: a consistent estimator has an expected value, and deviations in both directions are worse.
    Either,
}

/// Columns by which runs of two studies are paired.
pub const PAIRING_COLUMNS: [&str; 5] = ["log", "disturbance", "perturbation", "seed", "run"];

/// Definition of a column of a table with rows of type `Row`.
pub(in crate::study) struct Column<Row> {
    /// Name, unique in its table: lower case, with the unit at its end where there is one (`ate_rmse_m`).
    pub(super) name: &'static str,
    /// Unit, empty for numbers without one and for text.
    unit: &'static str,
    /// Content of a cell in one line.
    meaning: &'static str,
    value: Value<Row>,
    /// Which change is worse in a comparison.
    pub(in crate::study) worse: Direction,
    /// True if equal results have different values on two machines: paths, the program, times and memory.
    pub(in crate::study) local: bool,
    /// True if lengths are shown in millimetres.
    pub(in crate::study) fine: bool,
}

/// Value of a row by the type of the column; `None` is an empty cell, and so is a number that is not finite.
enum Value<Row> {
    Number(fn(&Row) -> Option<f64>),
    Integer(fn(&Row) -> Option<usize>),
    Text(fn(&Row) -> Option<String>),
    Bool(fn(&Row) -> Option<bool>),
}

impl<Row> Column<Row> {
    const fn new(name: &'static str, unit: &'static str, meaning: &'static str, value: Value<Row>) -> Self {
        Self { name, unit, meaning, value, worse: Direction::Larger, local: false, fine: false }
    }

    pub(super) const fn number(
        name: &'static str,
        unit: &'static str,
        meaning: &'static str,
        value: fn(&Row) -> Option<f64>,
    ) -> Self {
        Self::new(name, unit, meaning, Value::Number(value))
    }

    pub(super) const fn count(name: &'static str, meaning: &'static str, value: fn(&Row) -> Option<usize>) -> Self {
        Self::new(name, "", meaning, Value::Integer(value))
    }

    pub(super) const fn bytes(name: &'static str, meaning: &'static str, value: fn(&Row) -> Option<usize>) -> Self {
        Self::new(name, "B", meaning, Value::Integer(value))
    }

    pub(super) const fn text(name: &'static str, meaning: &'static str, value: fn(&Row) -> Option<String>) -> Self {
        Self::new(name, "", meaning, Value::Text(value))
    }

    pub(super) const fn flag(name: &'static str, meaning: &'static str, value: fn(&Row) -> Option<bool>) -> Self {
        Self::new(name, "", meaning, Value::Bool(value))
    }

    pub(super) const fn worse(mut self, worse: Direction) -> Self {
        self.worse = worse;
        self
    }

    pub(super) const fn local(mut self) -> Self {
        self.local = true;
        self
    }

    pub(super) const fn fine(mut self) -> Self {
        self.fine = true;
        self
    }

    fn filled(&self, rows: &[Row]) -> StudyColumn {
        let values = match self.value {
            Value::Number(value) => {
                ColumnValues::Number(rows.iter().map(|row| value(row).filter(|number| number.is_finite())).collect())
            }
            Value::Integer(value) => {
                ColumnValues::Integer(rows.iter().map(|row| i64::try_from(value(row)?).ok()).collect())
            }
            Value::Text(value) => ColumnValues::Text(rows.iter().map(value).collect()),
            Value::Bool(value) => ColumnValues::Bool(rows.iter().map(value).collect()),
        };
        StudyColumn {
            name: self.name.to_owned(),
            unit: self.unit.to_owned(),
            description: self.meaning.to_owned(),
            values,
        }
    }
}

pub(super) fn table<Row>(columns: &[Column<Row>], rows: &[Row]) -> StudyTable {
    let columns = columns.iter().map(|column| column.filled(rows)).collect();
    StudyTable::new(columns).expect("columns have one length and different names")
}
