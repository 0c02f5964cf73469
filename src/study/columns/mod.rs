//! Columns of the tables of a study: name, unit, meaning and value of each in one place.
//!
//! CSV and Parquet files, summary tables, the study view, comparisons, baselines and reports take columns from here.
//! A new column of the table of runs is one entry of [`JobResult::COLUMNS`] in `runs.rs`, and its row in `docs/formats.md`,
//! which a test compares with the tables.

mod frames;
mod job_result;
mod parameters;
mod runs;

use self::frames::FrameRow;
pub use self::job_result::{JobCosts, JobResult, JobStatus, RunResult};
use self::parameters::ParameterRow;
pub(super) use self::runs::run_column;
use super::comparison::Direction;
use super::table::{ColumnValues, StudyColumn, StudyTable};

/// Columns by which runs of two studies are paired.
pub const PAIRING_COLUMNS: [&str; 5] = ["log", "disturbance", "perturbation", "seed", "run"];

/// Definition of a column of a table with rows of type `Row`.
pub(super) struct Column<Row> {
    /// Name, unique in its table: lower case, with the unit at its end where there is one (`ate_rmse_m`).
    name: &'static str,
    /// Unit, empty for numbers without one and for text.
    unit: &'static str,
    /// Content of a cell in one line.
    meaning: &'static str,
    value: Value<Row>,
    /// Which change is worse in a comparison.
    pub(super) worse: Direction,
    /// Whether equal results have different values on two machines: paths, the program, times and memory.
    pub(super) local: bool,
    /// Whether its lengths are shown in millimetres.
    pub(super) fine: bool,
}

/// Value of a row by the type of the column; `None` is an empty cell, and so is a number that is not finite.
enum Value<Row> {
    Number(fn(&Row) -> Option<f64>),
    Integer(fn(&Row) -> Option<usize>),
    Text(fn(&Row) -> Option<String>),
    Bool(fn(&Row) -> Option<bool>),
}

impl<Row> Column<Row> {
    const fn new(name: &'static str, unit: &'static str, meaning: &'static str, value: Value<Row>) -> Self {
        Self { name, unit, meaning, value, worse: Direction::Larger, local: false, fine: false }
    }

    const fn number(
        name: &'static str,
        unit: &'static str,
        meaning: &'static str,
        value: fn(&Row) -> Option<f64>,
    ) -> Self {
        Self::new(name, unit, meaning, Value::Number(value))
    }

    const fn count(name: &'static str, meaning: &'static str, value: fn(&Row) -> Option<usize>) -> Self {
        Self::new(name, "", meaning, Value::Integer(value))
    }

    const fn bytes(name: &'static str, meaning: &'static str, value: fn(&Row) -> Option<usize>) -> Self {
        Self::new(name, "B", meaning, Value::Integer(value))
    }

    const fn text(name: &'static str, meaning: &'static str, value: fn(&Row) -> Option<String>) -> Self {
        Self::new(name, "", meaning, Value::Text(value))
    }

    const fn flag(name: &'static str, meaning: &'static str, value: fn(&Row) -> Option<bool>) -> Self {
        Self::new(name, "", meaning, Value::Bool(value))
    }

    const fn worse(mut self, worse: Direction) -> Self {
        self.worse = worse;
        self
    }

    const fn local(mut self) -> Self {
        self.local = true;
        self
    }

    const fn fine(mut self) -> Self {
        self.fine = true;
        self
    }

    fn filled(&self, rows: &[Row]) -> StudyColumn {
        let values = match self.value {
            Value::Number(value) => {
                ColumnValues::Number(rows.iter().map(|row| value(row).filter(|number| number.is_finite())).collect())
            }
            Value::Integer(value) => {
                ColumnValues::Integer(rows.iter().map(|row| i64::try_from(value(row)?).ok()).collect())
            }
            Value::Text(value) => ColumnValues::Text(rows.iter().map(value).collect()),
            Value::Bool(value) => ColumnValues::Bool(rows.iter().map(value).collect()),
        };
        StudyColumn {
            name: self.name.to_owned(),
            unit: self.unit.to_owned(),
            description: self.meaning.to_owned(),
            values,
        }
    }
}

fn table<Row>(columns: &[Column<Row>], rows: &[Row]) -> StudyTable {
    let columns = columns.iter().map(|column| column.filled(rows)).collect();
    StudyTable::new(columns).expect("columns have one length and different names")
}

/// Table of runs without a row.
pub fn runs_table() -> StudyTable {
    table(JobResult::COLUMNS, &[])
}

/// Table of parameters without a row.
pub fn parameters_table() -> StudyTable {
    table(ParameterRow::COLUMNS, &[])
}

/// Table of frames without a row.
pub fn frames_table() -> StudyTable {
    table(FrameRow::COLUMNS, &[])
}

/// The tables of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct StudyTables {
    /// One row per run.
    pub runs: StudyTable,
    /// One row per run and calibration parameter.
    pub parameters: StudyTable,
    /// One row per run and frame; empty unless the plan asks for it.
    pub frames: StudyTable,
}

impl Default for StudyTables {
    fn default() -> Self {
        Self { runs: runs_table(), parameters: parameters_table(), frames: frames_table() }
    }
}

impl StudyTables {
    /// The rows of one job, those of its frames if `with_frames`.
    pub fn of(result: &JobResult<'_>, with_frames: bool) -> Self {
        let frames = if with_frames { FrameRow::all(result) } else { Vec::new() };
        Self {
            runs: table(JobResult::COLUMNS, std::slice::from_ref(result)),
            parameters: table(ParameterRow::COLUMNS, &ParameterRow::all(result)),
            frames: table(FrameRow::COLUMNS, &frames),
        }
    }
}
