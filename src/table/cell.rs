//! Values of the cells of a table, and the types of its columns.

use std::cmp::Ordering;
use std::fmt;

use crate::geometry::seconds_from_ns;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ColumnType {
    /// Number with 64-bit floating point.
    Number,
    /// Whole number, 64-bit signed.
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

/// Stamp in nanoseconds since the log began, written as seconds with nine decimals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamp(pub i64);

#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// No value, of any type.
    Empty,
    /// A number; a non-finite one is stored as [`Cell::Empty`].
    Number(f64),
    Stamp(Stamp),
    Integer(i64),
    Text(String),
    Bool(bool),
}

impl Cell {
    /// `None` for an empty cell.
    pub fn column_type(&self) -> Option<ColumnType> {
        match self {
            Self::Empty => None,
            Self::Number(_) | Self::Stamp(_) => Some(ColumnType::Number),
            Self::Integer(_) => Some(ColumnType::Integer),
            Self::Text(_) => Some(ColumnType::Text),
            Self::Bool(_) => Some(ColumnType::Bool),
        }
    }

    /// The value as a number; integers are converted, true is 1 and false is 0.
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Number(number) => Some(*number),
            Self::Stamp(stamp) => Some(seconds_from_ns(stamp.0)),
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
            Self::Stamp(stamp) => write!(formatter, "{:.9}", seconds_from_ns(stamp.0)),
            Self::Integer(integer) => write!(formatter, "{integer}"),
            Self::Text(text) => formatter.write_str(text),
            Self::Bool(yes) => write!(formatter, "{yes}"),
        }
    }
}

/// A type whose values fill the cells of a column.
pub trait CellValue: Into<Cell> {
    const TYPE: ColumnType;
}

/// Column type of each type of values, and the function that makes a cell.
macro_rules! cell_values {
    ($($value:ty: $column_type:ident by $cell:expr;)+) => {$(
        impl CellValue for $value {
            const TYPE: ColumnType = ColumnType::$column_type;
        }

        impl From<$value> for Cell {
            fn from(value: $value) -> Self {
                $cell(value)
            }
        }
    )+};
}

cell_values! {
    f64: Number by finite;
    Stamp: Number by Cell::Stamp;
    i64: Integer by Cell::Integer;
    u32: Integer by count;
    u64: Integer by count;
    usize: Integer by count;
    bool: Bool by Cell::Bool;
    &str: Text by text;
    String: Text by Cell::Text;
}

fn finite(number: f64) -> Cell {
    if number.is_finite() { Cell::Number(number) } else { Cell::Empty }
}

fn count(count: impl TryInto<i64>) -> Cell {
    count.try_into().map_or(Cell::Empty, Cell::Integer)
}

fn text(text: &str) -> Cell {
    Cell::Text(text.to_owned())
}

impl<T: CellValue> CellValue for Option<T> {
    const TYPE: ColumnType = T::TYPE;
}

impl<T: Into<Self>> From<Option<T>> for Cell {
    fn from(value: Option<T>) -> Self {
        value.map_or(Self::Empty, Into::into)
    }
}
