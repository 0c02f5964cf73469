//! Studies: the runs that a plan asks for, and the tables of their results.
//!
//! Everything here is plain data and computation on it; files are read and written by `export/study/`, processes are
//! started by the command line.
//!
//! - `table`: columns of numbers, integers, texts and booleans with units and descriptions.

mod table;
#[cfg(test)]
mod tests;

pub use table::{Cell, ColumnType, ColumnValues, StudyColumn, StudyTable, TableError};
