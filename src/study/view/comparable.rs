//! Selection of the runs that are opened together.

use super::study::columns;
use crate::study::StudyTable;

/// Columns that are equal in runs over the same log with the same rig.
const SAME: [&str; 10] = [
    columns::LOG,
    columns::DISTURBANCE,
    columns::PERTURBATION,
    columns::SEED,
    "log_path",
    "rig_path",
    "truth_path",
    "log_sha256",
    "start_s",
    "duration_s",
];

/// Row `row`, then the other rows with equal log, rig and start and other specifications, in the order of the table; at
/// most `most` in all.
///
/// Rigs with errors are stored in the folders of the jobs, so their paths differ even if the errors are equal; for
/// perturbed runs, the name of the errors and the seed are compared instead.
pub fn comparable_rows(table: &StudyTable, row: usize, most: usize) -> Vec<usize> {
    let perturbed = table.text(row, "rig_path").is_some_and(|path| path.starts_with("jobs/"));
    let same = |other: usize| {
        let compared = SAME.into_iter().filter(|column| !(perturbed && *column == "rig_path"));
        compared.into_iter().all(|column| table.cell(row, column) == table.cell(other, column))
    };
    let mut rows = vec![row];
    let mut specs = vec![table.text(row, columns::RUN)];
    for other in 0..table.rows() {
        let spec = table.text(other, columns::RUN);
        if rows.len() < most && other != row && !specs.contains(&spec) && same(other) {
            rows.push(other);
            specs.push(spec);
        }
    }
    rows.truncate(most.max(1));
    rows
}
