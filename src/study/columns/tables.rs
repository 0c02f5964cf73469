//! Tables of a study from the results of its jobs.

use super::frames::FrameRow;
use super::job_result::JobResult;
use super::parameters::ParameterRow;
use crate::study::table::{StudyColumn, StudyTable};
use crate::table::Column;

/// Table of runs without a row.
pub fn runs_table() -> StudyTable {
    table(JobResult::columns(), &[])
}

/// Table of parameters without a row.
pub fn parameters_table() -> StudyTable {
    table(ParameterRow::columns(), &[])
}

/// Table of frames without a row.
pub fn frames_table() -> StudyTable {
    table(FrameRow::columns(), &[])
}

fn table<Row>(columns: Vec<Column<'_, Row>>, rows: &[Row]) -> StudyTable {
    let filled = columns.into_iter().map(|column| {
        let mut filled = StudyColumn::new(&column.name, column.cell_type, column.unit, &column.meaning);
        for row in rows {
            filled.values.push(column.cell(row));
        }
        filled
    });
    StudyTable::new(filled.collect()).expect("columns have one length and different names")
}

#[derive(Clone, Debug, PartialEq)]
pub struct StudyTables {
    /// One row per run.
    pub runs: StudyTable,
    /// One row per run and calibration parameter.
    pub parameters: StudyTable,
    /// One row per run and frame; empty unless the plan requests it.
    pub frames: StudyTable,
}

impl Default for StudyTables {
    fn default() -> Self {
        Self { runs: runs_table(), parameters: parameters_table(), frames: frames_table() }
    }
}

impl StudyTables {
    /// The rows of one job, including the rows of its frames if `with_frames`.
    pub fn of(result: &JobResult<'_>, with_frames: bool) -> Self {
        let frames = if with_frames { FrameRow::all(result) } else { Vec::new() };
        Self {
            runs: table(JobResult::columns(), std::slice::from_ref(result)),
            parameters: table(ParameterRow::columns(), &ParameterRow::all(result)),
            frames: table(FrameRow::columns(), &frames),
        }
    }
}
