//! Table of samples that is written row by row into a file.

use std::fs::{self, File};
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use crate::export::error::ExportError;
use crate::flight_log::output;

/// Rows of a stamp in nanoseconds and further cells.
pub(super) struct SampleTable {
    rows: csv::Writer<BufWriter<File>>,
    count: u64,
    path: PathBuf,
}

impl SampleTable {
    /// Creates a file, and its folder if it is missing.
    pub(super) fn create(path: &Path, columns: &[String]) -> Result<Self, ExportError> {
        let folder = output::folder_of(path);
        let file = fs::create_dir_all(&folder).and_then(|()| File::create(path));
        let file = BufWriter::new(file.map_err(ExportError::write(path))?);
        let mut table = Self { rows: csv::Writer::from_writer(file), count: 0, path: path.to_owned() };
        table.write(columns)?;
        Ok(table)
    }

    /// Appends numbers, which read back exactly.
    pub(super) fn row<'a>(
        &mut self,
        stamp_ns: i64,
        numbers: impl IntoIterator<Item = &'a f64>,
    ) -> Result<(), ExportError> {
        let numbers = numbers.into_iter().map(f64::to_string);
        let cells: Vec<String> = std::iter::once(stamp_ns.to_string()).chain(numbers).collect();
        self.count += 1;
        self.write(&cells)
    }

    /// Appends a row with a text.
    pub(super) fn text_row(&mut self, stamp_ns: i64, text: &str) -> Result<(), ExportError> {
        self.count += 1;
        self.write(&[stamp_ns.to_string(), text.to_owned()])
    }

    /// Number of rows of the complete table.
    pub(super) fn finish(mut self) -> Result<u64, ExportError> {
        self.rows.flush().map_err(ExportError::write(&self.path))?;
        Ok(self.count)
    }

    fn write(&mut self, cells: &[String]) -> Result<(), ExportError> {
        let written = self.rows.write_record(cells);
        written.map_err(|error| ExportError::Write { source: error.into(), path: self.path.clone() })
    }
}
