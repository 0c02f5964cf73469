//! Pairing of the runs of two studies.
//!
//! Two runs are paired if log, disturbance, perturbation and seed are equal and the settings of their specifications
//! are equivalent: `auto`, `auto:window=10` and `auto:name=before` have equivalent settings, because 10 keyframes are
//! the default.
//! A run without such a partner is paired with the run of the same name, so that `auto:pixel-noise=2,name=auto` is
//! compared with `auto`. The key of a job, which contains the hash of the program, and paths are not used.

use std::collections::{BTreeMap, BTreeSet};

use super::columns::PAIRING_COLUMNS;
use super::table::StudyTable;
use crate::session::RunSpec;
use crate::table::Cell;

/// Rows of two tables with the same inputs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct RunPair {
    /// Log, levels, seed and specification in the new table.
    pub(super) name: String,
    /// Row of the old table.
    pub(super) old: usize,
    /// Row of the new table.
    pub(super) new: usize,
    /// True if their settings are equivalent.
    pub(super) same_settings: bool,
}

/// A row with the values by which it is paired.
struct Candidate {
    row: usize,
    /// Log, disturbance, perturbation and seed.
    inputs: Vec<String>,
    settings: String,
    label: String,
}

impl Candidate {
    fn of(table: &StudyTable, row: usize) -> Self {
        let inputs = ["log", "disturbance", "perturbation", "seed"].map(|column| table.cell(row, column).to_string());
        let run = table.text(row, "run").unwrap_or_default();
        // A text that this version cannot parse is compared literally.
        let spec = run.parse::<RunSpec>().ok();
        let settings = spec.as_ref().map_or_else(|| run.to_owned(), RunSpec::settings);
        let label = spec.map_or_else(|| run.to_owned(), |spec| spec.label);
        Self { row, inputs: inputs.into(), settings, label }
    }

    /// Rows of a table; of duplicate rows the last one is used.
    fn all(table: &StudyTable) -> Vec<Self> {
        let rows = (0..table.rows()).map(|row| Self::of(table, row));
        let distinct: BTreeMap<_, Self> =
            rows.map(|it| ((it.inputs.clone(), it.settings.clone(), it.label.clone()), it)).collect();
        distinct.into_values().collect()
    }
}

/// Pairs of two tables of runs, in the order of log, levels, seed and settings; a row is in at most one pair.
pub(super) fn pair_runs(old: &StudyTable, new: &StudyTable) -> Vec<RunPair> {
    type Rule = fn(&Candidate, &Candidate) -> bool;
    const RULES: [Rule; 3] = [
        |a, b| a.settings == b.settings && a.label == b.label,
        |a, b| a.settings == b.settings,
        |a, b| a.label == b.label,
    ];
    let mut by_inputs: BTreeMap<Vec<String>, Vec<Candidate>> = BTreeMap::new();
    for candidate in Candidate::all(old) {
        by_inputs.entry(candidate.inputs.clone()).or_default().push(candidate);
    }
    let candidates = Candidate::all(new);
    let mut paired: BTreeMap<usize, RunPair> = BTreeMap::new();
    let mut taken = BTreeSet::new();
    for rule in RULES {
        for (place, candidate) in candidates.iter().enumerate() {
            let mut free = by_inputs.get(&candidate.inputs).into_iter().flatten().filter(|it| !taken.contains(&it.row));
            if paired.contains_key(&place) {
                continue;
            }
            let Some(partner) = free.find(|partner| rule(candidate, partner)) else { continue };
            taken.insert(partner.row);
            let same_settings = candidate.settings == partner.settings;
            let pair =
                RunPair { name: name_of(new, candidate.row), old: partner.row, new: candidate.row, same_settings };
            paired.insert(place, pair);
        }
    }
    paired.into_values().collect()
}

/// Log, levels, seed and specification of a row as one text.
fn name_of(table: &StudyTable, row: usize) -> String {
    let cells = PAIRING_COLUMNS.iter().map(|column| match table.cell(row, column) {
        Cell::Integer(seed) => format!("seed {seed}"),
        other => other.to_string(),
    });
    cells.filter(|text| !text.is_empty() && text != "none").collect::<Vec<_>>().join(", ")
}
