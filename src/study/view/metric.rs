//! Numeric columns in the units that are shown, and axes over their values.

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

/// An axis over values: linear, or logarithmic over positive values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValueAxis {
    pub logarithmic: bool,
    /// Value at the lower end.
    pub low: f64,
    /// Value at the upper end, larger than `low`.
    pub high: f64,
}

/// Ratio of the largest to the median value above which an axis is logarithmic.
const LOGARITHMIC_FROM: f64 = 20.0;
/// Margin beyond the extreme values, as a ratio of the range.
const MARGIN: f64 = 0.03;

impl ValueAxis {
    /// A linear axis from `low` to `high` with a margin on both sides; an empty range is extended.
    pub fn linear(low: f64, high: f64) -> Self {
        let margin = MARGIN * (high - low);
        let margin = match low.abs().max(high.abs()) {
            0.0 => 1.0,
            size if margin > 1e-12 * size => margin,
            size => 0.5 * size,
        };
        Self { logarithmic: false, low: low - margin, high: high + margin }
    }

    /// A logarithmic axis over positive values.
    pub fn logarithmic(low: f64, high: f64) -> Self {
        let ratio = (high / low).max(2.0).powf(MARGIN);
        Self { logarithmic: true, low: low / ratio, high: (high * ratio).max(low * 1.5) }
    }

    /// The axis over finite values: logarithmic if all are positive and the largest is far beyond their median.
    pub fn over(values: impl Iterator<Item = f64>) -> Self {
        let mut values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
        values.sort_by(f64::total_cmp);
        let (Some(low), Some(high)) = (values.first().copied(), values.last().copied()) else {
            return Self::linear(0.0, 1.0);
        };
        if low > 0.0 && high > LOGARITHMIC_FROM * values[values.len() / 2] {
            return Self::logarithmic(low, high);
        }
        // Zero is included if it is near, so that lengths can be compared.
        let low = if low > 0.0 && low < 0.5 * high { 0.0 } else { low };
        let axis = Self::linear(low, high);
        if low == 0.0 { Self { low: 0.0, ..axis } } else { axis }
    }

    /// An axis with zero in its middle part, for differences.
    pub fn around_zero(values: impl Iterator<Item = f64>) -> Self {
        let (low, high) = values.fold((0.0_f64, 0.0_f64), |(low, high), value| (low.min(value), high.max(value)));
        Self::linear(low, high)
    }

    /// Position of a value, 0 at `low` and 1 at `high`; values outside the axis are clamped to the nearer end.
    pub fn position(&self, value: f64) -> f64 {
        let map = |value: f64| if self.logarithmic { value.max(f64::MIN_POSITIVE).ln() } else { value };
        ((map(value) - map(self.low)) / (map(self.high) - map(self.low))).clamp(-0.02, 1.02)
    }

    /// Round values inside the axis, at most about `count`.
    pub fn marks(&self, count: usize) -> Vec<f64> {
        if self.logarithmic {
            let decades = (self.low.log10().floor() as i32)..=(self.high.log10().ceil() as i32);
            let digits: &[f64] =
                if (self.high / self.low).log10() * 3.0 <= count as f64 { &[1.0, 2.0, 5.0] } else { &[1.0] };
            let marks = decades.flat_map(|decade| digits.iter().map(move |digit| digit * 10_f64.powi(decade)));
            let inside: Vec<f64> = marks.filter(|mark| (self.low..=self.high).contains(mark)).collect();
            let every = inside.len().div_ceil(count.max(1)).max(1);
            return inside.into_iter().step_by(every).collect();
        }
        let span = self.high - self.low;
        if !(span.is_finite() && span > 0.0) || count == 0 {
            return Vec::new();
        }
        let rough = span / count as f64;
        let power = 10_f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0].into_iter().map(|digit| digit * power).find(|step| *step >= rough);
        let step = step.unwrap_or(10.0 * power);
        let (first, last) = ((self.low / step).ceil() as i64, (self.high / step).floor() as i64);
        (first..=last).take(2 * count + 2).map(|number| number as f64 * step).collect()
    }
}
