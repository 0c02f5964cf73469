//! Tables as text in a terminal.

use std::fmt::{self, Display, Formatter, Write as _};

/// Column of a text table.
pub struct TextColumn {
    heading: String,
    /// Smallest width in characters; 0: as wide as its widest text, with two spaces before the next column.
    width: usize,
    is_right: bool,
}

/// Column of texts, which begin at the left edge.
pub fn left(heading: impl Into<String>, width: usize) -> TextColumn {
    TextColumn { heading: heading.into(), width, is_right: false }
}

/// Column of numbers, which end at the right edge.
pub fn right(heading: impl Into<String>, width: usize) -> TextColumn {
    TextColumn { is_right: true, ..left(heading, width) }
}

/// Rows of texts under headings, aligned by spaces; without a heading line if all headings are empty.
pub struct TextTable {
    columns: Vec<TextColumn>,
    /// Texts of the cells by row, the headings first.
    rows: Vec<Vec<String>>,
    indent: usize,
}

impl TextTable {
    /// Table that is indented by two spaces; a row may end before the last column.
    pub fn new<Row: IntoIterator<Item: Into<String>>>(
        columns: impl IntoIterator<Item = TextColumn>,
        rows: impl IntoIterator<Item = Row>,
    ) -> Self {
        let columns: Vec<TextColumn> = columns.into_iter().collect();
        let headings: Vec<String> = columns.iter().map(|column| column.heading.clone()).collect();
        let headings = headings.iter().any(|heading| !heading.is_empty()).then_some(headings);
        let rows = rows.into_iter().map(|row| row.into_iter().map(Into::into).collect());
        Self { rows: headings.into_iter().chain(rows).collect(), columns, indent: 2 }
    }

    #[must_use]
    pub fn not_indented(self) -> Self {
        Self { indent: 0, ..self }
    }
}

impl Display for TextTable {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        let width = |(index, column): (usize, &TextColumn)| match column.width {
            0 => self.rows.iter().filter_map(|row| row.get(index)).map(|cell| cell.chars().count()).max().unwrap_or(0),
            width => width,
        };
        let widths: Vec<usize> = self.columns.iter().enumerate().map(width).collect();
        for row in &self.rows {
            let mut line = " ".repeat(self.indent);
            for ((cell, column), width) in row.iter().zip(&self.columns).zip(&widths) {
                if column.is_right {
                    write!(line, "{cell:>width$}")?;
                } else {
                    write!(line, "{cell:<width$}")?;
                }
                line += if column.width == 0 { "  " } else { "" };
            }
            writeln!(out, "{}", line.trim_end())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_aligned_and_lines_end_with_their_last_text() {
        let columns = [left("", 6), right("σ", 5), left(" unit", 0)];
        let table = TextTable::new(columns, [vec!["α", "1.5", " °"], vec!["length"]]);
        assert_eq!(table.to_string(), "            σ unit\n  α       1.5 °\n  length\n");
        let columns = [left("", 0), right("σ", 0), left("unit", 0)];
        let fitted = TextTable::new(columns, [["α", "12.25", ""]]).not_indented();
        assert_eq!(fitted.to_string(), "       σ  unit\nα  12.25\n");
    }

    #[test]
    fn a_table_without_headings_has_no_heading_line() {
        let table = TextTable::new([left("", 3), left("", 0)], [["a", "b"]]);
        assert_eq!(table.to_string(), "  a  b\n");
    }
}
