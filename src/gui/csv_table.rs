//! The values of a panel as a table of comma-separated values.

use std::fmt::Write as _;

use crate::geometry::seconds_from_ns;

/// A CSV table that is built row by row.
pub(super) struct Table {
    /// RFC 4180, with lines that end in `\n` alone.
    text: String,
}

impl Table {
    /// A table with a header line.
    pub(super) fn new(columns: impl IntoIterator<Item = impl Into<String>>) -> Self {
        let mut table = Self { text: String::new() };
        table.row(columns.into_iter().map(Into::into));
        table
    }

    /// Appends a row; cells with commas, quotes or line breaks are quoted.
    pub(super) fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        for (number, cell) in cells.into_iter().enumerate() {
            if number > 0 {
                self.text.push(',');
            }
            if cell.contains([',', '"', '\n', '\r']) {
                write!(self.text, "\"{}\"", cell.replace('"', "\"\"")).expect("writing into a string cannot fail");
            } else {
                self.text.push_str(&cell);
            }
        }
        self.text.push('\n');
    }

    /// The text of the table.
    pub(super) fn into_text(self) -> String {
        self.text
    }
}

/// A number with all its digits, empty if it is not finite.
pub(super) fn number(value: f64) -> String {
    if value.is_finite() { value.to_string() } else { String::new() }
}

/// A stamp in seconds with nanosecond resolution.
pub(super) fn seconds(stamp_ns: i64) -> String {
    format!("{:.9}", seconds_from_ns(stamp_ns))
}
