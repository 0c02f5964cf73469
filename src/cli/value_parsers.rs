//! Parsers of argument values.

use std::ops::RangeInclusive;

/// Parses a time or a duration in seconds, 0 or more.
pub(crate) fn seconds(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|value| value.is_finite() && *value >= 0.0);
    value.ok_or_else(|| "expected seconds, a number from 0 up".to_owned())
}

/// Parses a number within `range`, in a unit.
pub(crate) fn within(text: &str, range: RangeInclusive<f64>, unit: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|value| range.contains(value));
    value.ok_or_else(|| format!("expected {unit} from {} to {}", range.start(), range.end()))
}

/// Parses `WIDTHxHEIGHT`, both within `range`, in pixels.
pub(crate) fn sides(text: &str, range: RangeInclusive<usize>) -> Option<[usize; 2]> {
    let parse = |side: &str| side.parse::<usize>().ok().filter(|side| range.contains(side));
    text.split_once('x').and_then(|(width, height)| Some([parse(width)?, parse(height)?]))
}
