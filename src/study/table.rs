//! A table of a study: named columns of one type each, with unit and description, and rows of equal length.
//!
//! Every cell may be empty, so that a run that crashed is an ordinary row. Numbers are finite or empty.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::fmt;

use thiserror::Error;

use crate::files::csv_writer::CsvWriter;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ColumnType {
    /// Floating-point number of 64 bits.
    Number,
    /// Signed integer of 64 bits.
    Integer,
    Text,
    Bool,
}

impl ColumnType {
    /// Name in messages and documents.
    pub fn name(self) -> &'static str {
        match self {
            Self::Number => "number",
            Self::Integer => "integer",
            Self::Text => "text",
            Self::Bool => "bool",
        }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// No value, of any type.
    Empty,
    /// A number; a non-finite one is stored as [`Cell::Empty`].
    Number(f64),
    Integer(i64),
    Text(String),
    Bool(bool),
}

impl Cell {
    /// `None` for an empty cell.
    pub fn column_type(&self) -> Option<ColumnType> {
        match self {
            Self::Empty => None,
            Self::Number(_) => Some(ColumnType::Number),
            Self::Integer(_) => Some(ColumnType::Integer),
            Self::Text(_) => Some(ColumnType::Text),
            Self::Bool(_) => Some(ColumnType::Bool),
        }
    }

    /// The value as a number; integers are converted, true is 1 and false is 0.
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Number(number) => Some(*number),
            Self::Integer(integer) => Some(*integer as f64),
            Self::Bool(yes) => Some(f64::from(u8::from(*yes))),
            Self::Empty | Self::Text(_) => None,
        }
    }

    /// Order for sorting: by value within a type, false before true; empty cells come last.
    pub fn order(&self, other: &Self) -> Ordering {
        match (self, other) {
            (Self::Text(a), Self::Text(b)) => a.cmp(b),
            (Self::Integer(a), Self::Integer(b)) => a.cmp(b),
            _ => match (self.number(), other.number()) {
                (Some(a), Some(b)) => a.total_cmp(&b),
                (Some(_), None) => Ordering::Less,
                (None, Some(_)) => Ordering::Greater,
                (None, None) => matches!(self, Self::Empty).cmp(&matches!(other, Self::Empty)),
            },
        }
    }
}

/// The value in machine-readable form, with all digits of a number; empty for an empty cell.
impl fmt::Display for Cell {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Empty => Ok(()),
            Self::Number(number) => write!(formatter, "{number}"),
            Self::Integer(integer) => write!(formatter, "{integer}"),
            Self::Text(text) => formatter.write_str(text),
            Self::Bool(yes) => write!(formatter, "{yes}"),
        }
    }
}

impl From<f64> for Cell {
    fn from(number: f64) -> Self {
        if number.is_finite() { Self::Number(number) } else { Self::Empty }
    }
}

impl From<i64> for Cell {
    fn from(integer: i64) -> Self {
        Self::Integer(integer)
    }
}

impl From<usize> for Cell {
    fn from(count: usize) -> Self {
        i64::try_from(count).map_or(Self::Empty, Self::Integer)
    }
}

impl From<bool> for Cell {
    fn from(yes: bool) -> Self {
        Self::Bool(yes)
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl<T: Into<Self>> From<Option<T>> for Cell {
    fn from(value: Option<T>) -> Self {
        value.map_or(Self::Empty, Into::into)
    }
}

/// The values of one column, one per row; `None` is an empty cell.
#[derive(Clone, Debug, PartialEq)]
pub enum ColumnValues {
    Number(Vec<Option<f64>>),
    Integer(Vec<Option<i64>>),
    Text(Vec<Option<String>>),
    Bool(Vec<Option<bool>>),
}

impl ColumnValues {
    pub fn new(column_type: ColumnType) -> Self {
        match column_type {
            ColumnType::Number => Self::Number(Vec::new()),
            ColumnType::Integer => Self::Integer(Vec::new()),
            ColumnType::Text => Self::Text(Vec::new()),
            ColumnType::Bool => Self::Bool(Vec::new()),
        }
    }

    pub fn column_type(&self) -> ColumnType {
        match self {
            Self::Number(_) => ColumnType::Number,
            Self::Integer(_) => ColumnType::Integer,
            Self::Text(_) => ColumnType::Text,
            Self::Bool(_) => ColumnType::Bool,
        }
    }

    pub fn len(&self) -> usize {
        match self {
            Self::Number(values) => values.len(),
            Self::Integer(values) => values.len(),
            Self::Text(values) => values.len(),
            Self::Bool(values) => values.len(),
        }
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The cell of a row; empty beyond the end.
    pub fn cell(&self, row: usize) -> Cell {
        match self {
            Self::Number(values) => values.get(row).copied().flatten().into(),
            Self::Integer(values) => values.get(row).copied().flatten().into(),
            Self::Text(values) => values.get(row).and_then(Option::as_deref).into(),
            Self::Bool(values) => values.get(row).copied().flatten().into(),
        }
    }

    /// Appends a cell; returns `false` and leaves the column unchanged if the type differs.
    fn push(&mut self, cell: Cell) -> bool {
        match (self, cell) {
            (Self::Number(values), Cell::Number(number)) => values.push(Some(number).filter(|it| it.is_finite())),
            // Some programs write 1 for 1.0.
            (Self::Number(values), Cell::Integer(integer)) => values.push(Some(integer as f64)),
            (Self::Number(values), Cell::Empty) => values.push(None),
            (Self::Integer(values), Cell::Integer(integer)) => values.push(Some(integer)),
            (Self::Integer(values), Cell::Empty) => values.push(None),
            (Self::Text(values), Cell::Text(text)) => values.push(Some(text)),
            (Self::Text(values), Cell::Empty) => values.push(None),
            (Self::Bool(values), Cell::Bool(yes)) => values.push(Some(yes)),
            (Self::Bool(values), Cell::Empty) => values.push(None),
            _ => return false,
        }
        true
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
        let rows = columns.first().map_or(0, |column| column.values.len());
        let mut places = BTreeMap::new();
        for (place, column) in columns.iter().enumerate() {
            let (name, found) = (column.name.clone(), column.values.len());
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

    /// A cell as a number, as in [`Cell::number`].
    pub fn number(&self, row: usize, column: &str) -> Option<f64> {
        match &self.column(column)?.values {
            ColumnValues::Number(values) => values.get(row).copied().flatten(),
            ColumnValues::Integer(values) => values.get(row).copied().flatten().map(|value| value as f64),
            ColumnValues::Bool(values) => values.get(row).copied().flatten().map(|yes| f64::from(u8::from(yes))),
            ColumnValues::Text(_) => None,
        }
    }

    /// A cell of a text column, `None` if it is empty or the column has another type.
    pub fn text(&self, row: usize, column: &str) -> Option<&str> {
        match &self.column(column)?.values {
            ColumnValues::Text(values) => values.get(row)?.as_deref(),
            _ => None,
        }
    }

    /// A cell of an integer column, `None` if it is empty or the column has another type.
    pub fn integer(&self, row: usize, column: &str) -> Option<i64> {
        match &self.column(column)?.values {
            ColumnValues::Integer(values) => values.get(row).copied().flatten(),
            _ => None,
        }
    }

    /// A cell of a Boolean column, `None` if it is empty or the column has another type.
    pub fn boolean(&self, row: usize, column: &str) -> Option<bool> {
        match &self.column(column)?.values {
            ColumnValues::Bool(values) => values.get(row).copied().flatten(),
            _ => None,
        }
    }

    /// The cells of a row in the order of the columns.
    pub fn row(&self, row: usize) -> impl Iterator<Item = Cell> + '_ {
        self.columns.iter().map(move |column| column.values.cell(row))
    }

    /// Rows of these numbers as comma-separated values under the names of the columns.
    pub fn csv(&self, rows: impl IntoIterator<Item = usize>) -> String {
        let mut csv = CsvWriter::new(self.columns.iter().map(|column| column.name.as_str()));
        for row in rows {
            csv.row(self.row(row).map(|cell| cell.to_string()));
        }
        csv.into_text()
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
