//! Reduction of a study to the values that are kept for later comparisons.

use super::table::{StudyTable, TableError};

/// Columns that name files and programs.
const OF_FILES: [&str; 8] =
    ["key", "message", "attempts", "log_path", "rig_path", "truth_path", "trajectory_path", "program"];
/// Columns of measured time and memory, in addition to those whose names end in `_ms`.
const OF_COSTS: [&str; 3] = ["wall_s", "peak_memory_bytes", "real_time_factor"];

/// The table of runs without values that differ between two machines: paths, the program, times and memory.
///
/// Equal results give equal tables on every machine, so a baseline can be committed.
///
/// # Errors
/// Never for a table, whose columns have one length and different names.
pub fn baseline_table(runs: &StudyTable) -> Result<StudyTable, TableError> {
    let kept = |name: &str| !OF_FILES.contains(&name) && !OF_COSTS.contains(&name) && !name.ends_with("_ms");
    StudyTable::new(runs.columns().iter().filter(|column| kept(&column.name)).cloned().collect())
}
