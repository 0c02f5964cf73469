//! The tables of one study.

use std::collections::BTreeMap;

use crate::study::StudyTable;

/// Names of the columns that the view relies on; all of them may be missing in a table.
pub mod columns {
    /// Key of the run, in the tables of runs and of parameters.
    pub const KEY: &str = "key";
    pub const LOG: &str = "log";
    /// Name of the disturbances of a simulated flight.
    pub const DISTURBANCE: &str = "disturbance";
    /// Name of the errors added to the rig.
    pub const PERTURBATION: &str = "perturbation";
    /// The level of a run without disturbances, or without errors.
    pub const NONE: &str = "none";
    /// Seed of the flight and of the errors.
    pub const SEED: &str = "seed";
    pub const RUN: &str = "run";
    /// Outcome of the run; [`STATUS_OK`] with a result.
    pub const STATUS: &str = "status";
    /// The status of a run with a result.
    pub const STATUS_OK: &str = "ok";
    /// Reason why there is no result.
    pub const MESSAGE: &str = "message";
    /// Time of the frame with the largest error, in seconds since the log began.
    pub const WORST_FRAME_S: &str = "worst_frame_s";
    /// Column of the absolute trajectory error (RMSE, m).
    pub const ATE: &str = "ate_rmse_m";
    /// Name of a calibration parameter, in the table of parameters.
    pub const PARAMETER: &str = "parameter";
    pub const UNIT: &str = "unit";
    /// Final standard deviation of the parameter.
    pub const SIGMA: &str = "sigma";
    /// Final minus ground-truth value of the parameter.
    pub const ERROR: &str = "error";
}

/// A study: one row per run, and one row per run and calibration parameter.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Study {
    /// Name shown to users.
    pub name: String,
    /// One row per run.
    pub runs: StudyTable,
    /// One row per run and parameter.
    pub parameters: StudyTable,
}

impl Study {
    /// For each row of the table of parameters, the row of its run in the table of runs; `None` for a key without a
    /// run.
    pub fn run_of_parameter_rows(&self) -> Vec<Option<usize>> {
        let rows = 0..self.runs.rows();
        let of_key: BTreeMap<&str, usize> =
            rows.filter_map(|row| Some((self.runs.text(row, columns::KEY)?, row))).collect();
        let run_of = |row: usize| of_key.get(self.parameters.text(row, columns::KEY)?).copied();
        (0..self.parameters.rows()).map(run_of).collect()
    }

    /// Title of a run: its specification, log, disturbances, errors of the rig and seed, as far as they are known.
    pub fn title_of(&self, row: usize) -> String {
        let text = |column: &str| self.runs.text(row, column).filter(|text| !text.is_empty());
        let run = text(columns::RUN).map_or_else(|| format!("row {}", row + 1), str::to_owned);
        let log = text(columns::LOG).map(|log| format!(" on {log}")).unwrap_or_default();
        let levels = [columns::DISTURBANCE, columns::PERTURBATION].into_iter().filter_map(text);
        let levels = levels.filter(|level| *level != columns::NONE);
        let levels: Vec<&str> = [""].into_iter().chain(levels).collect();
        let levels = levels.join(", ");
        let seed = self.runs.integer(row, columns::SEED).map(|seed| format!(", seed {seed}")).unwrap_or_default();
        format!("{run}{log}{levels}{seed}")
    }
}
