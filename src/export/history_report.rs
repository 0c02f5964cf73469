//! `dcvins history`: the calibration of one mechanism over its flights, as a report and as tables.

use std::collections::BTreeMap;
use std::fmt::{self, Display, Formatter};
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::error::ExportError;
use super::folder_files::{json_text, write_files};
use super::history_folders::{FoundFlights, LeftOut, find};
use crate::calibration::history::{Change, FlightAgreement, FlightHistory, Verdict};
use crate::geometry::Dimension;
use crate::table::text::{TextTable, left, right};
use crate::table::{Column, Shown, csv};
use crate::text::{counted, printable, utc};

/// Name of the table of values in the folder of a history.
const VALUES: &str = "values.csv";
/// Name of the table of flights, which a window opens as the runs of a study.
const RESULTS: &str = "results.csv";
const REPORT: &str = "history.txt";
const JSON: &str = "history.json";

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HistoryFlight {
    /// Number in the order of the flights, from 1.
    pub number: usize,
    pub folder: String,
    pub log: String,
    /// Start of the log in UTC; `None` if its clock does not count from 1970.
    pub start: Option<String>,
    pub verdict: Verdict,
    /// Sum of the squared differences from the flights before, in standard deviations.
    pub chi_square: f64,
    /// Number of directions that the flight measures.
    pub directions: usize,
    /// The same as a quantile of the normal distribution.
    pub misfit_sigma: Option<f64>,
    /// Number of its interval, from 1.
    pub interval: usize,
    /// Parameters whose change explains a misfit.
    pub changes: Vec<HistoryChange>,
    /// Value of each parameter after the flight, with the prior of its run.
    pub values: Vec<f64>,
    pub sigmas: Vec<f64>,
}

/// Change of a parameter in radians, metres, seconds or pixels.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HistoryChange {
    pub parameter: String,
    #[serde(rename = "unit")]
    pub dimension: Dimension,
    pub by: f64,
    pub sigma: f64,
    /// Parameters whose change would explain the misfit as well.
    pub instead: Vec<String>,
}

/// Sum of the flights between two changes of the mechanism.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HistoryInterval {
    /// Numbers of the flights in the sum.
    pub flights: Vec<usize>,
    /// By parameter, in radians, metres, seconds or pixels.
    pub values: Vec<f64>,
    pub sigmas: Vec<f64>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HistoryParameter {
    pub name: String,
    #[serde(rename = "unit")]
    pub dimension: Dimension,
    /// Standard deviation that the rig requires.
    pub required: f64,
}

/// Calibration of one mechanism over its flights; text by [`Display`], JSON by [`Serialize`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HistoryReport {
    /// Key of the main camera.
    pub camera: String,
    /// Name of the runs.
    pub run: String,
    pub parameterization: String,
    pub parameters: Vec<HistoryParameter>,
    pub flights: Vec<HistoryFlight>,
    pub intervals: Vec<HistoryInterval>,
    /// Numbers of calibrations of other runs, by name.
    pub other_runs: BTreeMap<String, usize>,
    pub left_out: Vec<LeftOut>,
}

/// Reads the calibrations in folders and compares them, one per log: by the run with this name, or by the run that most
/// logs have.
///
/// # Errors
/// If a folder cannot be read, no calibration can be used, or a covariance is not positive definite.
pub fn calibration_history(folders: &[PathBuf], run: Option<&str>) -> Result<HistoryReport, ExportError> {
    let found = find(folders, run)?;
    let history = found.calibrated.history().ok_or_else(|| ExportError::History {
        problem: "a covariance is not positive definite".to_owned(),
        path: found.flights[0].folder.clone(),
    })?;
    Ok(HistoryReport::new(found, &history))
}

impl HistoryReport {
    fn new(found: FoundFlights, history: &FlightHistory) -> Self {
        let FoundFlights { flights, names, calibrated, other_runs, left_out } = found;
        let required = &flights[flights.len() - 1].found.rig.required_accuracy;
        let parameters = names.iter().zip(&calibrated.columns).map(|(name, column)| HistoryParameter {
            name: name.clone(),
            dimension: column.dimension(),
            required: required.of(*column),
        });
        let change = |change: &Change| HistoryChange {
            parameter: names[change.column].clone(),
            dimension: calibrated.columns[change.column].dimension(),
            by: change.by,
            sigma: change.sigma,
            instead: change.instead.iter().map(|column| names[*column].clone()).collect(),
        };
        let mut interval = 1;
        let sigmas = |covariance: &nalgebra::DMatrix<f64>| {
            covariance.diagonal().iter().map(|variance| variance.max(0.0).sqrt()).collect::<Vec<f64>>()
        };
        let rows = flights.iter().zip(&calibrated.flights).zip(&history.agreements).enumerate();
        let rows = rows.map(|(place, ((flight, calibrated), agreement))| {
            let FlightAgreement { verdict, chi_square, directions, misfit_sigma, changes } = agreement;
            interval += usize::from(*verdict == Verdict::Changed);
            HistoryFlight {
                number: place + 1,
                folder: flight.folder.display().to_string(),
                log: flight.log.clone(),
                start: flight.found.start_ns.and_then(utc),
                verdict: *verdict,
                chi_square: *chi_square,
                directions: *directions,
                misfit_sigma: *misfit_sigma,
                interval,
                changes: changes.iter().map(change).collect(),
                values: calibrated.values.iter().copied().collect(),
                sigmas: sigmas(&calibrated.covariance),
            }
        });
        let posterior = &flights[0].found.posterior;
        Self {
            camera: flights[0].found.cameras[0].clone(),
            run: flights[0].run.clone(),
            parameterization: posterior.cameras[0].parameterization.to_string(),
            parameters: parameters.collect(),
            flights: rows.collect(),
            intervals: history
                .intervals
                .iter()
                .map(|interval| HistoryInterval {
                    flights: interval.flights.iter().map(|flight| flight + 1).collect(),
                    values: interval.values.iter().copied().collect(),
                    sigmas: sigmas(&interval.covariance),
                })
                .collect(),
            other_runs,
            left_out,
        }
    }

    /// True if all flights agree.
    pub fn agrees(&self) -> bool {
        self.flights.iter().all(|flight| !flight.is_misfit())
    }

    /// The result in one line per misfit.
    fn sentences(&self) -> Vec<String> {
        let misfits = self.flights.iter().filter(|flight| flight.is_misfit());
        let sentences: Vec<String> = misfits.map(|flight| self.sentence(flight)).collect();
        match (sentences.is_empty(), self.flights.len()) {
            (false, _) => sentences,
            (true, 1) => vec!["one flight, nothing to compare it with".to_owned()],
            (true, count) => vec![format!("✓ {count} flights agree")],
        }
    }

    fn sentence(&self, flight: &HistoryFlight) -> String {
        let HistoryFlight { number, misfit_sigma, changes, verdict, .. } = flight;
        let sigma = misfit_sigma.map_or_else(String::new, |sigma| format!(" by {sigma:.1} σ"));
        let mut changed: Vec<String> = changes.iter().map(HistoryChange::sentence).collect();
        if changed.is_empty() {
            changed.push("no single parameter explains it".to_owned());
        }
        let changed = changed.join(", ");
        if *verdict == Verdict::Alone {
            let name = self.flight_name(*number);
            return format!("⚠ {name} does not agree with the flights before and after it{sigma}: {changed}");
        }
        let before = self.flights.iter().rev().find(|other| other.number < *number && other.verdict != Verdict::Alone);
        let before = before.map_or_else(String::new, |before| self.flight_name(before.number));
        format!("⚠ the calibration changed{sigma} between {before} and {}: {changed}", self.flight_name(*number))
    }

    /// For example `flight 5 (monday.mcap, 2026-05-12 10:03)`.
    fn flight_name(&self, number: usize) -> String {
        let HistoryFlight { log, start, .. } = &self.flights[number - 1];
        let start = start.as_ref().map_or_else(String::new, |start| format!(", {start}"));
        format!("flight {number} ({}{start})", printable(log))
    }

    /// Flights of an interval, as in `1 to 5` or `1, 2, 4`.
    fn interval_name(interval: &HistoryInterval) -> String {
        let flights = &interval.flights;
        let (first, last) = (flights[0], flights[flights.len() - 1]);
        if flights.len() > 2 && last - first + 1 == flights.len() {
            return format!("flights {first} to {last}");
        }
        let numbers: Vec<String> = flights.iter().map(usize::to_string).collect();
        format!("{} {}", if flights.len() == 1 { "flight" } else { "flights" }, numbers.join(", "))
    }
}

impl HistoryFlight {
    /// True if it does not agree with the flights before it.
    fn is_misfit(&self) -> bool {
        matches!(self.verdict, Verdict::Alone | Verdict::Changed)
    }
}

impl HistoryChange {
    /// For example `yaw.d +4.2 ± 0.5 mm (or pitch.a)`.
    fn sentence(&self) -> String {
        let shown = Shown::of(self.dimension);
        let sign = if self.by < 0.0 { "" } else { "+" };
        let by = shown.value_with_sigma(self.by, self.sigma);
        let instead =
            if self.instead.is_empty() { String::new() } else { format!(" (or {})", self.instead.join(", ")) };
        format!("{} {sign}{by}{instead}", self.parameter)
    }
}

impl Display for HistoryReport {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        for sentence in self.sentences() {
            writeln!(f, "{sentence}")?;
        }
        let Self { camera, run, parameterization, .. } = self;
        let count = counted(self.flights.len(), "flight");
        writeln!(f, "\ncamera {camera}, run {run}, parameterization {parameterization}, {count}:\n")?;
        let columns = [
            right("", 4),
            left("  start, UTC", 20),
            left("log", 0),
            right("χ²", 10),
            right("directions", 12),
            right("σ", 8),
        ];
        let rows = self.flights.iter().map(|flight| {
            let compared = flight.misfit_sigma;
            let start = flight.start.as_deref().unwrap_or("-");
            let verdict = match flight.verdict {
                Verdict::First | Verdict::Agrees => "",
                Verdict::Alone => "agrees with no other",
                Verdict::Changed => "changed",
            };
            [
                flight.number.to_string(),
                format!("  {start}"),
                printable(&flight.log).into_owned(),
                compared.map_or_else(|| "-".to_owned(), |_| format!("{:.1}", flight.chi_square)),
                flight.directions.to_string(),
                compared.map_or_else(|| "-".to_owned(), |sigma| format!("{sigma:.1}")),
                format!("  {verdict}"),
            ]
        });
        writeln!(f, "{}", TextTable::new(columns.into_iter().chain([left("", 0)]), rows))?;
        let intervals = self.intervals.iter().map(|interval| right(Self::interval_name(interval), 22));
        let columns = [left("parameter", 16)].into_iter().chain(intervals).chain([right("required", 12), left("", 0)]);
        let rows = self.parameters.iter().enumerate().map(|(place, parameter)| {
            let shown = Shown::of(parameter.dimension);
            let value =
                |interval: &HistoryInterval| shown.value_with_sigma(interval.values[place], interval.sigmas[place]);
            let newest = &self.intervals[self.intervals.len() - 1];
            let mark = if newest.sigmas[place] <= parameter.required { "  ✓" } else { "  ⚠" };
            [parameter.name.clone()]
                .into_iter()
                .chain(self.intervals.iter().map(value))
                .chain([shown.sigma(parameter.required), mark.to_owned()])
                .collect::<Vec<_>>()
        });
        write!(f, "{}", TextTable::new(columns, rows))?;
        if !self.other_runs.is_empty() || !self.left_out.is_empty() {
            writeln!(f)?;
        }
        for (run, count) in &self.other_runs {
            let (run, count) = (printable(run), counted(*count, "calibration"));
            writeln!(f, "not used: {count} by run {run}; --run {run} compares them")?;
        }
        for LeftOut { folder, reason } in &self.left_out {
            writeln!(f, "not used: {}: {}", printable(folder), printable(reason))?;
        }
        Ok(())
    }
}

/// Flight and place of a parameter.
type ValueRow<'a> = (&'a HistoryFlight, usize);
type ValueColumn<'a> = Column<'a, ValueRow<'a>>;

/// Writes `history.txt`, `history.json`, `values.csv` (one row per flight and parameter) and `results.csv` (one row per
/// flight) into a folder, with `gui` also the figure `history.png` and `history.svg`.
///
/// # Errors
/// If a file or the folder cannot be written.
pub fn write_history(report: &HistoryReport, folder: &Path) -> Result<Vec<PathBuf>, ExportError> {
    let columns = [
        ValueColumn::new("flight", |(flight, _)| flight.number),
        ValueColumn::new("start_utc", |(flight, _)| flight.start.clone().unwrap_or_default()),
        ValueColumn::new("log", |(flight, _)| flight.log.clone()),
        ValueColumn::new("interval", |(flight, _)| flight.interval),
        ValueColumn::new("parameter", |(_, place)| report.parameters[*place].name.clone()),
        ValueColumn::new("unit", |(_, place)| report.parameters[*place].dimension.unit().to_owned()),
        ValueColumn::new("value", |(flight, place)| flight.values[*place]),
        ValueColumn::new("sigma", |(flight, place)| flight.sigmas[*place]),
        ValueColumn::new("interval_value", |(flight, place)| report.intervals[flight.interval - 1].values[*place]),
        ValueColumn::new("interval_sigma", |(flight, place)| report.intervals[flight.interval - 1].sigmas[*place]),
        ValueColumn::new("required_sigma", |(_, place)| report.parameters[*place].required),
    ];
    let rows = report.flights.iter().flat_map(|flight| (0..report.parameters.len()).map(move |place| (flight, place)));
    let values = csv(&columns, rows);
    let json = json_text(report, &folder.join(JSON))?;
    let results = csv(&flight_columns(report), &report.flights);
    let texts = [(REPORT, report.to_string()), (JSON, json), (VALUES, values), (RESULTS, results)];
    let texts = texts.into_iter().map(|(name, text)| (name, text.into_bytes()));
    write_files(texts.chain(figures(report)), folder)
}

#[cfg(feature = "gui")]
fn figures(report: &HistoryReport) -> Vec<(&'static str, Vec<u8>)> {
    use super::folder_files::figure_files;
    use crate::gui::figures::{HistoryFigure, HistoryPlot, history_ui};

    let plot = |(place, parameter): (usize, &HistoryParameter)| HistoryPlot {
        name: parameter.name.clone(),
        dimension: parameter.dimension,
        required: parameter.required,
        flights: report.flights.iter().map(|flight| (flight.values[place], flight.sigmas[place])).collect(),
        intervals: report.intervals.iter().map(|it| (it.values[place], it.sigmas[place])).collect(),
        changed: report
            .flights
            .iter()
            .filter(|flight| flight.changes.iter().any(|change| change.parameter == parameter.name))
            .map(|flight| flight.number - 1)
            .collect(),
    };
    let figure = HistoryFigure {
        sentences: report.sentences(),
        intervals: report.flights.iter().map(|flight| flight.interval - 1).collect(),
        alone: report.flights.iter().map(|flight| flight.verdict == Verdict::Alone).collect(),
        plots: report.parameters.iter().enumerate().map(plot).collect(),
    };
    figure_files(["history.png", "history.svg"], [1920, 1300], ["history", "Calibration over flights"], |ui, theme| {
        history_ui(ui, theme, &figure);
    })
}

#[cfg(not(feature = "gui"))]
fn figures(_: &HistoryReport) -> Vec<(&'static str, Vec<u8>)> {
    Vec::new()
}

/// Columns of the table of flights: a study's, then value and standard deviation of each parameter.
fn flight_columns(report: &HistoryReport) -> Vec<Column<'_, HistoryFlight>> {
    type FlightColumn<'a> = Column<'a, HistoryFlight>;
    let mut columns = vec![
        FlightColumn::new("key", |flight| format!("flight-{}", flight.number)),
        FlightColumn::new("study", |_| "history"),
        FlightColumn::new("log", |flight| flight.log.clone()),
        FlightColumn::new("perturbation", |flight| format!("interval {}", flight.interval)),
        FlightColumn::new("run", |_| report.run.clone()),
        FlightColumn::new("status", |_| "ok"),
        FlightColumn::new("start_utc", |flight| flight.start.clone().unwrap_or_default()),
        FlightColumn::new("flight", |flight| flight.number),
        FlightColumn::new("misfit_sigma", |flight| flight.misfit_sigma),
    ];
    for (place, HistoryParameter { name, dimension, .. }) in report.parameters.iter().enumerate() {
        let (factor, unit) = dimension.shown_unit();
        let unit = if unit == "°" { "deg" } else { unit };
        columns.push(FlightColumn::new(format!("{name}_{unit}"), move |flight| flight.values[place] * factor));
        columns.push(FlightColumn::new(format!("{name}_sigma_{unit}"), move |flight| flight.sigmas[place] * factor));
    }
    columns
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use nalgebra::DMatrix;

    use super::*;
    use crate::estimator::{CalibrationPosterior, CameraPosterior, ColumnBelief};
    use crate::export::posterior::{POSTERIOR, posterior_text};
    use crate::files::RigFile as _;
    use crate::gimbal::{Chain, ClassicalChain, Parameterization};
    use crate::sensors::Rig;

    const SIGMA: f64 = 1e-4;
    const PRIOR_SIGMA: f64 = 1e-2;

    fn rig() -> Rig {
        let yaml = include_str!("../../sample_logs/garden.rig.yaml");
        Rig::from_yaml(yaml, Path::new("garden.rig.yaml")).unwrap()
    }

    /// Writes the posterior of a run on a flight, with `d` of the first link moved.
    fn write_flight(folder: &Path, day: i64, run: &str, moved_m: f64, before: bool) {
        let mut rig = rig();
        let gimbal = rig.gimbal.as_mut().unwrap();
        let form = |chain: &ClassicalChain| Chain::from_classical(chain, Parameterization::Minimal);
        let given = form(&gimbal.chain);
        let mut chain = gimbal.chain.clone();
        chain.links[0].d_m += moved_m;
        gimbal.set_chain(chain.clone());
        let (count, values) = (given.dof(), form(&chain).values().as_slice().to_vec());
        let diagonal = |sigma: f64| DMatrix::identity(count, count) * sigma.powi(2);
        let posterior = CalibrationPosterior {
            covariance: diagonal(SIGMA),
            before: before.then(|| ColumnBelief {
                values: given.values().as_slice().to_vec(),
                covariance: diagonal(PRIOR_SIGMA),
            }),
            cameras: vec![CameraPosterior {
                chain,
                parameterization: Parameterization::Minimal,
                parameters: given.parameters(),
                values,
                rig_sigmas: vec![PRIOR_SIGMA; count],
            }],
        };
        fs::create_dir_all(folder).unwrap();
        fs::write(folder.join("rig.yaml"), rig.to_yaml()).unwrap();
        let start_ns = (1_778_580_180 + 86_400 * day) * 1_000_000_000;
        let text = posterior_text(&posterior, &rig, start_ns, &format!("day{day}.mcap ({run})"));
        fs::write(folder.join(POSTERIOR), text).unwrap();
    }

    #[test]
    fn a_change_between_two_days_is_named() {
        let folder = tempfile::tempdir().unwrap();
        // Folders are not in the order of the flights.
        for (name, day, moved_m) in [("c", 0, 0.0), ("a", 2, 0.003), ("b", 1, 1e-5), ("d", 3, 0.003)] {
            write_flight(&folder.path().join(name).join("auto"), day, "auto", moved_m, true);
        }
        write_flight(&folder.path().join("a/cluster"), 2, "cluster", 0.0, true);
        write_flight(&folder.path().join("old"), 4, "auto", 0.0, false);
        let report = calibration_history(&[folder.path().to_owned()], None).unwrap();
        let text = report.to_string();
        let first = text.lines().next().unwrap();
        let expected = "between flight 2 (day1.mcap, 2026-05-13 10:03) and flight 3 (day2.mcap, 2026-05-14 10:03): \
                        yaw.d +3.00 ± 0.12 mm";
        assert!(first.contains(expected), "{text}");
        assert!(!report.agrees());
        let intervals: Vec<&[usize]> = report.intervals.iter().map(|interval| interval.flights.as_slice()).collect();
        assert_eq!(intervals, [[1, 2], [3, 4]]);
        let [left_out] = report.left_out.as_slice() else { panic!("{:?}", report.left_out) };
        assert!(left_out.reason.contains("earlier version"), "{left_out:?}");
        assert_eq!(report.other_runs.get("cluster"), Some(&1));

        let written = write_history(&report, &folder.path().join("out")).unwrap();
        assert_eq!(fs::read_to_string(&written[0]).unwrap(), text);
        let rows = |path: &Path| fs::read_to_string(path).unwrap().lines().count() - 1;
        assert_eq!(rows(&written[2]), 4 * report.parameters.len());
        assert_eq!(rows(&written[3]), 4);
    }

    #[test]
    fn what_cannot_be_compared_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let error = |run: Option<&str>| calibration_history(&[folder.path().to_owned()], run).unwrap_err().to_string();
        assert!(error(None).contains("no posterior.json"), "{}", error(None));
        write_flight(&folder.path().join("old"), 4, "auto", 0.0, false);
        assert!(error(None).contains("run it again"), "{}", error(None));
        assert!(error(Some("poe")).contains("no run is named 'poe', only auto"), "{}", error(Some("poe")));
        write_flight(&folder.path().join("new"), 5, "auto", 0.0, true);
        let one = calibration_history(&[folder.path().to_owned()], None).unwrap();
        assert!(one.to_string().starts_with("one flight, nothing to compare it with"));
    }
}
