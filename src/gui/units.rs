//! Display of numbers: degrees and millimetres on the screen, radians and metres in the data.

pub(crate) use crate::table::{Shown, fixed, significant};
pub(crate) use crate::text::counted;

/// Seconds since the log began with three decimals.
pub(crate) fn seconds(stamp_ns: i64) -> String {
    fixed(crate::geometry::seconds_from_ns(stamp_ns), 3)
}

/// A text that begins with a capital letter.
pub(crate) fn capitalized(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// An amount of memory in binary units.
pub(crate) fn bytes(count: u64) -> String {
    let mebibytes = count as f64 / (1 << 20) as f64;
    if mebibytes < 1024.0 { format!("{mebibytes:.0} MiB") } else { format!("{:.2} GiB", mebibytes / 1024.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_and_amounts_have_units() {
        assert_eq!(seconds(12_350_400_000), "12.350");
        assert_eq!(bytes(300 << 20), "300 MiB");
        assert_eq!(bytes(3 << 29), "1.50 GiB");
    }
}
