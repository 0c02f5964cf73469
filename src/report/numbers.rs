//! Numbers as the tables and sentences of a report show them.

use crate::table::Medium;

pub(super) const MS_PER_S: f64 = 1e3;

/// A number with this number of decimals and a true minus sign; a negative zero is 0.
pub(super) fn number(value: f64, decimals: usize) -> String {
    Medium::Page.fixed(value, decimals)
}
