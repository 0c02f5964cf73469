//! Numbers and units as the tables and sentences of a report show them.

use crate::geometry::Dimension;

pub(super) const MS_PER_S: f64 = 1e3;

/// A number with this number of decimals and a true minus sign; a negative zero is 0.
pub(super) fn number(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(digits) if digits.chars().all(|digit| digit == '0' || digit == '.') => digits.to_owned(),
        Some(digits) => format!("−{digits}"),
        None => text,
    }
}

/// Shown unit of a dimension, number of shown units per stored unit, and decimals in tables.
pub(super) fn shown_unit(dimension: Dimension) -> (&'static str, f64, usize) {
    let decimals = match dimension {
        Dimension::Length => 2,
        Dimension::Angle | Dimension::Time | Dimension::Pixel => 3,
        Dimension::Ratio => 6,
    };
    let (factor, unit) = dimension.shown_unit();
    (unit, factor, decimals)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_a_minus_sign_and_no_negative_zero() {
        assert_eq!(number(-1.25, 1), "−1.2");
        assert_eq!(number(-0.001, 2), "0.00");
        assert_eq!(number(3.0, 0), "3");
    }
}
