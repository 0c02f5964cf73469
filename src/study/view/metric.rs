//! Numeric columns in the units that are shown.

use super::study::columns;
use crate::study::columns::run_column;
use crate::study::{ColumnType, StudyColumn, StudyTable};

/// A numeric column with the unit that is shown.
#[derive(Clone, Debug, PartialEq)]
pub struct Metric {
    pub column: String,
    /// Shown value per stored value.
    pub factor: f64,
    /// The shown unit, empty for dimensionless numbers.
    pub unit: &'static str,
    pub description: String,
}

impl Metric {
    /// The metric of a column; `None` for text columns.
    pub fn of(column: &StudyColumn) -> Option<Self> {
        if column.values.column_type() == ColumnType::Text {
            return None;
        }
        let fine = run_column(&column.name).is_some_and(|column| column.fine);
        let (factor, unit) = Self::shown_unit(&column.unit, fine);
        Some(Self { column: column.name.clone(), factor, unit, description: column.description.clone() })
    }

    /// Factor and name of the unit shown for a stored unit; `fine` shows lengths in millimetres.
    pub fn shown_unit(stored: &str, fine: bool) -> (f64, &'static str) {
        match stored {
            "rad" => (180.0 / std::f64::consts::PI, "°"),
            "m" if fine => (1e3, "mm"),
            "m" => (1.0, "m"),
            "s" => (1.0, "s"),
            "ms" => (1.0, "ms"),
            "px" => (1.0, "px"),
            "%" => (1.0, "%"),
            "B" => (1.0 / f64::from(1 << 20), "MiB"),
            _ => (1.0, ""),
        }
    }

    /// Name with the shown unit: `ate_rmse_m` gives `ate_rmse [m]`.
    pub fn title(&self) -> String {
        let stored = ["_rad", "_m", "_s", "_ms", "_px", "_percent", "_bytes"];
        let name = stored.iter().find_map(|suffix| self.column.strip_suffix(suffix)).unwrap_or(&self.column);
        if self.unit.is_empty() { self.column.clone() } else { format!("{name} [{}]", self.unit) }
    }

    pub fn value(&self, table: &StudyTable, row: usize) -> Option<f64> {
        table.number(row, &self.column).map(|stored| stored * self.factor)
    }

    /// The shown values of these rows, with the row indices; rows without a value are omitted.
    pub fn values(&self, table: &StudyTable, rows: &[usize]) -> Vec<(usize, f64)> {
        rows.iter().filter_map(|row| Some((*row, self.value(table, *row)?))).collect()
    }
}

/// Numeric columns with at least one value, except the seed, which is an identifier.
pub fn metrics(table: &StudyTable) -> Vec<Metric> {
    let used = |column: &&StudyColumn| {
        matches!(column.values.column_type(), ColumnType::Number | ColumnType::Integer)
            && column.name != columns::SEED
            && (0..table.rows()).any(|row| table.number(row, &column.name).is_some())
    };
    table.columns().iter().filter(used).filter_map(Metric::of).collect()
}
