//! Tables of comma-separated values: RFC 4180 with lines that end in `\n` alone.

use crate::geometry::seconds_from_ns;

/// Message of the only possible error of a table in memory: a row with another number of cells than the header, which
/// is a programming error.
const IN_MEMORY: &str = "every row has as many cells as the header";

/// A table of comma-separated values that is built row by row in memory; cells are quoted where necessary.
pub struct CsvWriter(csv::Writer<Vec<u8>>);

impl CsvWriter {
    /// An empty table with the names of its columns.
    pub fn new<S: AsRef<[u8]>>(header: impl IntoIterator<Item = S>) -> Self {
        let mut table = Self(csv::Writer::from_writer(Vec::new()));
        table.row(header);
        table
    }

    /// Appends a row with one cell per column.
    pub fn row<S: AsRef<[u8]>>(&mut self, row: impl IntoIterator<Item = S>) {
        self.0.write_record(row).expect(IN_MEMORY);
    }

    /// The text of the table, with a line break after every row.
    pub fn into_text(self) -> String {
        let bytes = self.0.into_inner().map_err(|error| error.to_string()).expect(IN_MEMORY);
        String::from_utf8(bytes).expect("cells are UTF-8")
    }
}

/// A number with all its digits; empty if it is not finite.
pub fn number_cell(number: f64) -> String {
    if number.is_finite() { number.to_string() } else { String::new() }
}

/// A stamp in seconds with nanosecond resolution.
pub fn seconds_cell(stamp_ns: i64) -> String {
    format!("{:.9}", seconds_from_ns(stamp_ns))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_quoted_where_they_need_it() {
        let mut table = CsvWriter::new(["t_s", "events"]);
        table.row([number_cell(0.5), "a, \"b\"; c".to_owned()]);
        table.row([number_cell(f64::NAN), String::new()]);
        assert_eq!(table.into_text(), "t_s,events\n0.5,\"a, \"\"b\"\"; c\"\n,\n");
    }
}
