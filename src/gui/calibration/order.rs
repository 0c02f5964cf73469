//! Order of the rows of the calibration table.

use std::cmp::{Ordering, Reverse};

use crate::gui::parameter_names::place_of;
use crate::observability::Determination;
use crate::session::FlightParameter;

/// Column by which the rows are sorted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SortColumn {
    Parameter,
    Value,
    Ratio,
    Verdict,
    Since,
    Reason,
    Remedy,
}

/// Column and direction of the order; at first the worst verdict on top.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Order {
    pub(super) column: SortColumn,
    pub(super) descending: bool,
}

impl Default for Order {
    fn default() -> Self {
        Self { column: SortColumn::Verdict, descending: true }
    }
}

impl Order {
    /// Sorts by a clicked column, or reverses its order.
    pub(super) fn click(&mut self, column: SortColumn) {
        let largest_first = matches!(column, SortColumn::Ratio | SortColumn::Verdict);
        let descending = if self.column == column { !self.descending } else { largest_first };
        *self = Self { column, descending };
    }

    /// Sorts rows; equal ones are in the order of the chain.
    pub(super) fn sort(self, rows: &mut [&FlightParameter]) {
        rows.sort_by(|a, b| {
            let order = self.compare(a, b);
            let order = if self.descending { order.reverse() } else { order };
            order.then_with(|| place_of(a.parameter).cmp(&place_of(b.parameter)))
        });
    }

    fn compare(self, a: &FlightParameter, b: &FlightParameter) -> Ordering {
        let ratio = |row: &FlightParameter| row.ratio.unwrap_or(f64::NEG_INFINITY);
        match self.column {
            SortColumn::Parameter => place_of(a.parameter).cmp(&place_of(b.parameter)),
            SortColumn::Value => a.value.total_cmp(&b.value),
            SortColumn::Ratio => ratio(a).total_cmp(&ratio(b)),
            SortColumn::Verdict => {
                severity(a.verdict).cmp(&severity(b.verdict)).then_with(|| ratio(a).total_cmp(&ratio(b)))
            }
            SortColumn::Since => a.since_ns.cmp(&b.since_ns),
            // Rows without a text are last.
            SortColumn::Reason => {
                (Reverse(!a.reason.is_empty()), &a.reason).cmp(&(Reverse(!b.reason.is_empty()), &b.reason))
            }
            SortColumn::Remedy => {
                (Reverse(!a.remedy.is_empty()), &a.remedy).cmp(&(Reverse(!b.remedy.is_empty()), &b.remedy))
            }
        }
    }
}

/// Severity of a verdict: largest for a parameter that the flight does not determine.
fn severity(verdict: Determination) -> u8 {
    match verdict {
        Determination::NotDetermined => 5,
        Determination::WeaklyDetermined => 4,
        Determination::Redundant => 3,
        Determination::Determined => 2,
        Determination::Fixed => 1,
        Determination::Initializing => 0,
    }
}
