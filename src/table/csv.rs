//! Comma-separated values: RFC 4180 with lines that end in `\n` alone.

use std::borrow::Borrow;

use super::column::Column;

/// Message of the only possible error of a table in memory: a row with another number of cells than the header, which
/// is a programming error.
const IN_MEMORY: &str = "every row has as many cells as the header";

/// Rows under the names of the columns, which all have one.
pub fn csv<Row>(columns: &[Column<'_, Row>], rows: impl IntoIterator<Item = impl Borrow<Row>>) -> String {
    let written: Vec<_> = columns.iter().filter(|column| !column.name.is_empty()).collect();
    let rows = rows.into_iter().map(|row| {
        let row: &Row = row.borrow();
        written.iter().map(|column| column.cell(row).to_string()).collect::<Vec<_>>()
    });
    csv_text(written.iter().map(|column| &*column.name), rows)
}

/// Rows of texts under a header; cells are quoted where necessary.
pub fn csv_text<S: AsRef<[u8]>, R: IntoIterator<Item: AsRef<[u8]>>>(
    header: impl IntoIterator<Item = S>,
    rows: impl IntoIterator<Item = R>,
) -> String {
    let mut writer = ::csv::Writer::from_writer(Vec::new());
    writer.write_record(header).expect(IN_MEMORY);
    for row in rows {
        writer.write_record(row).expect(IN_MEMORY);
    }
    let bytes = writer.into_inner().map_err(|error| error.to_string()).expect(IN_MEMORY);
    String::from_utf8(bytes).expect("cells are UTF-8")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::Stamp;

    #[test]
    fn cells_are_quoted_where_they_need_it() {
        type TestColumn = Column<'static, (i64, f64)>;
        let columns = [
            TestColumn::new("t_s", |row| Stamp(row.0)),
            TestColumn::shown(|_| 1.0),
            TestColumn::new("events", |row| format!("a, \"b\"; {}", row.1)),
            TestColumn::new("value", |row| row.1),
        ];
        let text = csv(&columns, [(500_000_000, 0.25), (0, f64::NAN)]);
        let expected =
            "t_s,events,value\n0.500000000,\"a, \"\"b\"\"; 0.25\",0.25\n0.000000000,\"a, \"\"b\"\"; NaN\",\n";
        assert_eq!(text, expected);
    }
}
