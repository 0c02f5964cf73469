//! Tables: a column is defined once, with name, unit, meaning, value, order and look.
//!
//! The definition stands next to the type of its rows, in the lowest folder where the values are known; files, screens
//! and pages are made from it.

mod alignment;
mod cell;
mod column;
mod csv;
mod number;
pub mod text;

pub use self::alignment::align_numbers;
pub use self::cell::{Cell, CellValue, ColumnType, Stamp};
pub use self::column::{Column, Direction, Style, Tone, distinct};
pub use self::csv::{csv, csv_text};
pub use self::number::{Medium, Shown, fixed, significant};
