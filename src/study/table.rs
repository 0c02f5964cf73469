//! A table of a study: named columns of one type each, with unit and description, and rows of equal length.
//!
//! Every cell may be empty, so that a run that crashed is an ordinary row. Numbers are finite or empty.

use std::collections::BTreeMap;

use thiserror::Error;

use crate::table::{Cell, ColumnType, csv_text};

/// The cells of one column, one per row: each is empty or of its type.
#[derive(Clone, Debug, PartialEq)]
pub struct ColumnValues {
    column_type: ColumnType,
    cells: Vec<Cell>,
}

impl ColumnValues {
    pub fn new(column_type: ColumnType) -> Self {
        Self { column_type, cells: Vec::new() }
    }

    pub fn column_type(&self) -> ColumnType {
        self.column_type
    }

    pub fn cells(&self) -> &[Cell] {
        &self.cells
    }

    /// The cell of a row; empty beyond the end.
    pub fn cell(&self, row: usize) -> Cell {
        self.cells.get(row).cloned().unwrap_or(Cell::Empty)
    }

    /// Appends a cell; returns `false` and leaves the column unchanged if the type differs.
    pub fn push(&mut self, cell: Cell) -> bool {
        // Some programs write 1 for 1.0.
        let is_number = self.column_type == ColumnType::Number && !matches!(cell, Cell::Text(_) | Cell::Bool(_));
        let cell = if is_number { cell.number().into() } else { cell };
        let fits = cell.column_type().is_none_or(|found| found == self.column_type);
        if fits {
            self.cells.push(cell);
        }
        fits
    }
}

/// A column: name, unit, description and values.
#[derive(Clone, Debug, PartialEq)]
pub struct StudyColumn {
    /// Name, unique in its table: lower case, ending with the unit if there is one (`ate_rmse_m`).
    pub name: String,
    /// Unit, empty for numbers without one and for text.
    pub unit: String,
    /// Meaning of a cell in one line.
    pub description: String,
    pub values: ColumnValues,
}

impl StudyColumn {
    pub fn new(name: &str, column_type: ColumnType, unit: &str, description: &str) -> Self {
        Self {
            name: name.to_owned(),
            unit: unit.to_owned(),
            description: description.to_owned(),
            values: ColumnValues::new(column_type),
        }
    }
}

/// Reason why rows or columns do not fit into a table.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum TableError {
    #[error("two columns are named '{name}'")]
    TwoColumns { name: String },
    #[error("column '{name}' has {found} rows, the first column {expected}")]
    UnequalLength {
        name: String,
        /// Number of rows of this column.
        found: usize,
        /// Number of rows of the first column.
        expected: usize,
    },
    #[error("there is no column '{name}'")]
    NoColumn { name: String },
    #[error("column '{name}' holds {expected}, not {found}")]
    WrongType { name: String, expected: &'static str, found: &'static str },
}

/// A table of a study: columns in order, all with the same number of rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StudyTable {
    columns: Vec<StudyColumn>,
    /// Index of each column by its name.
    places: BTreeMap<String, usize>,
    rows: usize,
}

impl StudyTable {
    /// A table from columns of equal length.
    ///
    /// # Errors
    /// If two columns have the same name, or columns have different lengths.
    pub fn new(columns: Vec<StudyColumn>) -> Result<Self, TableError> {
        let rows = columns.first().map_or(0, |column| column.values.cells.len());
        let mut places = BTreeMap::new();
        for (place, column) in columns.iter().enumerate() {
            let (name, found) = (column.name.clone(), column.values.cells.len());
            if found != rows {
                return Err(TableError::UnequalLength { name, found, expected: rows });
            }
            if places.insert(name.clone(), place).is_some() {
                return Err(TableError::TwoColumns { name });
            }
        }
        Ok(Self { columns, places, rows })
    }

    pub fn columns(&self) -> &[StudyColumn] {
        &self.columns
    }

    pub fn rows(&self) -> usize {
        self.rows
    }

    pub fn is_empty(&self) -> bool {
        self.rows == 0
    }

    /// Index of a column in [`Self::columns`].
    pub fn place(&self, name: &str) -> Option<usize> {
        self.places.get(name).copied()
    }

    pub fn column(&self, name: &str) -> Option<&StudyColumn> {
        self.columns.get(self.place(name)?)
    }

    /// A cell; empty if there is no such row or column.
    pub fn cell(&self, row: usize, column: &str) -> Cell {
        self.column(column).map_or(Cell::Empty, |column| column.values.cell(row))
    }

    /// The cell of a row, `None` if there is no such row or column.
    fn known(&self, row: usize, column: &str) -> Option<&Cell> {
        self.column(column)?.values.cells.get(row)
    }

    /// A cell as a number, as in [`Cell::number`].
    pub fn number(&self, row: usize, column: &str) -> Option<f64> {
        self.known(row, column)?.number()
    }

    /// A cell of a text column, `None` if it is empty or the column has another type.
    pub fn text(&self, row: usize, column: &str) -> Option<&str> {
        if let Cell::Text(text) = self.known(row, column)? { Some(text) } else { None }
    }

    /// A cell of an integer column, `None` if it is empty or the column has another type.
    pub fn integer(&self, row: usize, column: &str) -> Option<i64> {
        if let Cell::Integer(integer) = self.known(row, column)? { Some(*integer) } else { None }
    }

    /// A cell of a Boolean column, `None` if it is empty or the column has another type.
    pub fn boolean(&self, row: usize, column: &str) -> Option<bool> {
        if let Cell::Bool(yes) = self.known(row, column)? { Some(*yes) } else { None }
    }

    /// The cells of a row in the order of the columns.
    pub fn row(&self, row: usize) -> impl Iterator<Item = Cell> + '_ {
        self.columns.iter().map(move |column| column.values.cell(row))
    }

    /// Rows of these numbers as comma-separated values under the names of the columns.
    pub fn csv(&self, rows: impl IntoIterator<Item = usize>) -> String {
        let cells = |row: usize| self.row(row).map(|cell| cell.to_string());
        csv_text(self.columns.iter().map(|column| &column.name), rows.into_iter().map(cells))
    }

    /// Appends a row of named cells; columns that are not named get an empty cell.
    ///
    /// # Errors
    /// For an unknown column, or a value of another type than its column; the table is then unchanged.
    pub fn push<'a>(&mut self, cells: impl IntoIterator<Item = (&'a str, Cell)>) -> Result<(), TableError> {
        let mut row: BTreeMap<usize, Cell> = BTreeMap::new();
        for (name, cell) in cells {
            let place = self.place(name).ok_or_else(|| TableError::NoColumn { name: name.to_owned() })?;
            let expected = self.columns[place].values.column_type();
            let fits = |found: ColumnType| {
                found == expected || (found == ColumnType::Integer && expected == ColumnType::Number)
            };
            if let Some(found) = cell.column_type().filter(|found| !fits(*found)) {
                let (expected, found) = (expected.name(), found.name());
                return Err(TableError::WrongType { name: name.to_owned(), expected, found });
            }
            row.insert(place, cell);
        }
        for (place, column) in self.columns.iter_mut().enumerate() {
            let pushed = column.values.push(row.remove(&place).unwrap_or(Cell::Empty));
            debug_assert!(pushed, "types are checked above");
        }
        self.rows += 1;
        Ok(())
    }

    /// Appends the rows of another table. Columns are matched by name; a column missing in one of the tables is empty
    /// there.
    ///
    /// # Errors
    /// If a column has another type in the other table; this table is then unchanged.
    pub fn append(&mut self, other: &Self) -> Result<(), TableError> {
        for column in &other.columns {
            let (found, expected) = (column.values.column_type(), self.column(&column.name));
            if let Some(expected) = expected.map(|own| own.values.column_type()).filter(|own| *own != found) {
                let (expected, found) = (expected.name(), found.name());
                return Err(TableError::WrongType { name: column.name.clone(), expected, found });
            }
        }
        for column in &other.columns {
            if self.place(&column.name).is_none() {
                let mut values = ColumnValues::new(column.values.column_type());
                for _ in 0..self.rows {
                    values.push(Cell::Empty);
                }
                self.places.insert(column.name.clone(), self.columns.len());
                self.columns.push(StudyColumn { values, ..column.clone() });
            }
        }
        for column in &mut self.columns {
            let from = other.column(&column.name);
            for row in 0..other.rows {
                column.values.push(from.map_or(Cell::Empty, |from| from.values.cell(row)));
            }
        }
        self.rows += other.rows;
        Ok(())
    }

    /// The rows with these indices in this order, with all columns; indices beyond the end give empty rows.
    #[must_use]
    pub fn select(&self, rows: &[usize]) -> Self {
        let select = |column: &StudyColumn| {
            let mut values = ColumnValues::new(column.values.column_type());
            for row in rows {
                values.push(column.values.cell(*row));
            }
            StudyColumn { values, ..column.clone() }
        };
        Self { columns: self.columns.iter().map(select).collect(), places: self.places.clone(), rows: rows.len() }
    }

    /// Row indices by the text of a column's cell, in the order of the texts; an empty cell is an empty text.
    pub fn groups(&self, column: &str) -> BTreeMap<String, Vec<usize>> {
        let mut groups: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        for row in 0..self.rows {
            groups.entry(self.cell(row, column).to_string()).or_default().push(row);
        }
        groups
    }

    /// Columns in which not all rows have the same cell.
    pub fn varying_columns(&self) -> impl Iterator<Item = &StudyColumn> {
        self.columns.iter().filter(|column| {
            let first = column.values.cell(0);
            (1..self.rows).any(|row| column.values.cell(row) != first)
        })
    }
}
