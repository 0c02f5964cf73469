//! What is kept of a study for later comparisons.

use super::columns::run_column;
use super::table::{StudyTable, TableError};

/// The table of runs without what differs between two machines: paths, the program, times and memory.
///
/// The same results give the same table wherever they were computed, so that a baseline can be committed.
///
/// # Errors
/// Never for a table, whose columns have one length and different names.
pub fn baseline_table(runs: &StudyTable) -> Result<StudyTable, TableError> {
    let kept = |name: &str| !run_column(name).is_some_and(|column| column.local);
    StudyTable::new(runs.columns().iter().filter(|column| kept(&column.name)).cloned().collect())
}
