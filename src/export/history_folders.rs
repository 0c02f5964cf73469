//! Calibrations of flights in folders, for a history.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::{DMatrix, DVector};

use super::error::ExportError;
use super::posterior::{FlightPosterior, POSTERIOR, read_posterior};
use crate::calibration::history::{CalibratedFlight, CalibratedFlights};
use crate::estimator::ColumnBelief;
use crate::gimbal::Parameterization;

/// Depth to which folders are searched.
const MAX_DEPTH: usize = 8;

/// A calibration that is no part of the history.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct LeftOut {
    pub folder: String,
    pub reason: String,
}

/// Calibration of one flight in its folder.
pub(super) struct FoundFlight {
    pub(super) folder: PathBuf,
    /// Name of the log.
    pub(super) log: String,
    /// Name of the run, `calibrate` for an offline calibration.
    pub(super) run: String,
    pub(super) found: FlightPosterior,
}

/// Flights of one mechanism, the oldest first, with the columns that all of them have.
pub(super) struct FoundFlights {
    pub(super) flights: Vec<FoundFlight>,
    /// Names of the columns.
    pub(super) names: Vec<String>,
    pub(super) calibrated: CalibratedFlights,
    /// Numbers of calibrations of other runs, by name.
    pub(super) other_runs: BTreeMap<String, usize>,
    pub(super) left_out: Vec<LeftOut>,
}

/// Finds the calibrations in folders and below them, one per log: by the run with this name, or by the run that most
/// logs have.
///
/// # Errors
/// If a folder cannot be read, or no calibration can be used.
pub(super) fn find(folders: &[PathBuf], run: Option<&str>) -> Result<FoundFlights, ExportError> {
    let mut places = Vec::new();
    for folder in folders {
        search(folder, 0, &mut places)?;
    }
    places.dedup();
    let (mut flights, mut left_out) = (Vec::new(), Vec::new());
    for folder in places {
        match read_posterior(&folder) {
            Ok(found) => flights.push(named(folder, found)),
            Err(error) => left_out.push(LeftOut::new(&folder, error.to_string())),
        }
    }
    let none = |left_out: &[LeftOut]| {
        let reasons: Vec<&str> = left_out.iter().map(|it| it.reason.as_str()).collect();
        let problem = if reasons.is_empty() {
            format!("it has no {POSTERIOR}, as 'dcvins run' and 'dcvins calibrate' write it")
        } else {
            reasons.join("; ")
        };
        ExportError::History { problem, path: folders.first().cloned().unwrap_or_default() }
    };
    if flights.is_empty() {
        return Err(none(&left_out));
    }
    let chosen = run.map_or_else(|| usual_run(&flights), str::to_owned);
    let mut of_run: Vec<FoundFlight> = Vec::new();
    let mut other_runs = BTreeMap::new();
    for flight in flights {
        if flight.run != chosen {
            *other_runs.entry(flight.run).or_insert(0) += 1;
        } else if let Some(reason) = flight.problem(of_run.first()) {
            left_out.push(LeftOut::new(&flight.folder, reason));
        } else {
            of_run.push(flight);
        }
    }
    if of_run.is_empty() && left_out.is_empty() {
        let known: Vec<String> = other_runs.into_keys().collect();
        let problem = format!("no run is named '{chosen}', only {}", known.join(", "));
        return Err(ExportError::History { problem, path: folders.first().cloned().unwrap_or_default() });
    }
    of_run.sort_by_key(|flight| flight.found.start_ns);
    if of_run.is_empty() {
        return Err(none(&left_out));
    }
    let (names, calibrated) = common_columns(&of_run);
    Ok(FoundFlights { flights: of_run, names, calibrated, other_runs, left_out })
}

impl LeftOut {
    fn new(folder: &Path, reason: String) -> Self {
        Self { folder: folder.display().to_string(), reason }
    }
}

/// Adds the folders with a posterior in the order of their names.
fn search(folder: &Path, depth: usize, places: &mut Vec<PathBuf>) -> Result<(), ExportError> {
    if folder.join(POSTERIOR).is_file() {
        places.push(folder.to_owned());
    }
    if depth == MAX_DEPTH {
        return Ok(());
    }
    let read = |source| ExportError::Read { source, path: folder.to_owned() };
    let entries: Vec<PathBuf> =
        fs::read_dir(folder).map_err(read)?.map(|entry| Ok(entry?.path())).collect::<Result<_, _>>().map_err(read)?;
    let mut below: Vec<PathBuf> = entries.into_iter().filter(|path| path.is_dir() && !path.is_symlink()).collect();
    below.sort();
    below.iter().try_for_each(|path| search(path, depth + 1, places))
}

/// Log and run of a posterior: `flight.mcap (auto)` is its last source.
fn named(folder: PathBuf, found: FlightPosterior) -> FoundFlight {
    let source = found.flights.last().map(|flight| flight.source.as_str()).unwrap_or_default();
    let (log, run) = source.rsplit_once(" (").unwrap_or((source, ""));
    FoundFlight { log: log.to_owned(), run: run.trim_end_matches(')').to_owned(), folder, found }
}

/// The run of which most calibrations can be compared; of several, the one with most columns, then the first by name.
fn usual_run(flights: &[FoundFlight]) -> String {
    let mut runs: Vec<&str> = flights.iter().map(|flight| flight.run.as_str()).collect();
    runs.sort_unstable();
    runs.dedup();
    let weight = |run: &&&str| {
        let of_run = flights.iter().filter(|flight| flight.run == **run && flight.problem(None).is_none());
        let columns: Vec<usize> = of_run.map(|flight| flight.found.names.len()).collect();
        (columns.len(), columns.into_iter().max())
    };
    runs.iter().rev().max_by_key(weight).copied().unwrap_or_default().to_owned()
}

impl FoundFlight {
    /// Reason why the calibration cannot be compared with the first one, `None` if it can.
    fn problem(&self, first: Option<&Self>) -> Option<String> {
        let found = &self.found;
        if found.posterior.before.is_none() {
            return Some(
                "written by an earlier version, without the values before the flight: run it again".to_owned(),
            );
        }
        let parameterization = |flight: &Self| flight.found.posterior.cameras[0].parameterization;
        let own = parameterization(self);
        if matches!(own, Parameterization::Classical | Parameterization::Poe) {
            return Some(format!("its parameterization is {own}: a history compares minimal ones"));
        }
        let first = first?;
        let differences = [
            (first.found.joints != found.joints).then(|| format!("joints {}", found.joints.join(", "))),
            (first.found.cameras[0] != found.cameras[0]).then(|| format!("camera '{}'", found.cameras[0])),
            (parameterization(first) != own).then(|| format!("parameterization {own}")),
        ];
        let differences: Vec<String> = differences.into_iter().flatten().collect();
        (!differences.is_empty()).then(|| {
            let joined = differences.join(", ");
            format!("another mechanism than '{}': {joined}", first.folder.display())
        })
    }
}

/// Names of the columns that all flights have, and their calibrations in these columns.
fn common_columns(flights: &[FoundFlight]) -> (Vec<String>, CalibratedFlights) {
    let all_have = |name: &&String| flights.iter().all(|flight| flight.found.names.contains(name));
    let names: Vec<String> = flights[0].found.names.iter().filter(all_have).cloned().collect();
    let columns_of = |flight: &FoundFlight| -> Vec<usize> {
        names.iter().filter_map(|name| flight.found.names.iter().position(|own| own == name)).collect()
    };
    let first = &flights[0].found.posterior;
    let parameters: Vec<_> = first.cameras.iter().flat_map(|camera| camera.parameters.iter().copied()).collect();
    let columns = columns_of(&flights[0]).into_iter().map(|column| parameters[column]).collect();
    let in_columns = |flight: &FoundFlight| {
        let (places, posterior) = (columns_of(flight), &flight.found.posterior);
        let select = |covariance: &DMatrix<f64>| covariance.select_rows(&places).select_columns(&places);
        let values: Vec<f64> = posterior.cameras.iter().flat_map(|camera| camera.values.iter().copied()).collect();
        let picked = |values: &[f64]| DVector::from_iterator(places.len(), places.iter().map(|place| values[*place]));
        let ColumnBelief { values: before, covariance: covariance_before } = posterior.before.as_ref()?;
        Some(CalibratedFlight {
            values: picked(&values),
            covariance: select(&posterior.covariance),
            values_before: picked(before),
            covariance_before: select(covariance_before),
        })
    };
    let calibrated = CalibratedFlights { columns, flights: flights.iter().filter_map(in_columns).collect() };
    (names, calibrated)
}
