//! `posterior.json`: values and covariance of a calibration, from which another flight starts (`--prior`).

use crate::files::RigFile as _;
use std::fmt::{self, Display, Formatter};
use std::fs;
use std::path::Path;

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::error::ExportError;
use crate::estimator::{CalibrationPosterior, CameraPosterior, ColumnBelief};
use crate::geometry::Dimension;
use crate::gimbal::{Chain, ParameterGroup, ParameterId, Parameterization, UnknownParameterization};
use crate::sensors::Rig;
use crate::session::{CalibrationRun, FlightPrior, FlightSigmas, Recording, RunRecord};
use crate::table::text::{TextTable, left, right};
use crate::text::{log_name, printable};

/// File of the posterior in the folder of a run or of an offline calibration.
pub(super) const POSTERIOR: &str = "posterior.json";
/// File of the calibrated rig beside it.
const RIG: &str = "rig.yaml";
const VERSION: u32 = 1;
/// Size limit of a file that is read.
const LARGEST_BYTES: u64 = 64 << 20;
/// Largest difference between a value of the posterior and of the rig beside it, in radians and metres.
const MAX_ROUNDING: f64 = 1e-6;

#[derive(Serialize, Deserialize)]
struct PosteriorFile {
    posterior_version: u32,
    /// Time of the first message of the log, in nanoseconds since 1970 by its clock; `None` in older files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    start_ns: Option<i64>,
    joints: Vec<String>,
    /// The main camera first.
    cameras: Vec<CameraEntry>,
    /// By rows, over the columns of all cameras.
    covariance: Vec<Vec<f64>>,
    /// The same before any measurement of the flight; `None` in older files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    covariance_before: Option<Vec<Vec<f64>>>,
    /// Standard deviations under the rig's prior, then after each flight.
    flights: Vec<FlightSigmas>,
}

#[derive(Serialize, Deserialize)]
struct CameraEntry {
    key: String,
    parameterization: String,
    columns: Vec<ColumnEntry>,
}

#[derive(Serialize, Deserialize)]
struct ColumnEntry {
    name: String,
    #[serde(default)]
    unit: String,
    value: f64,
    /// Before any measurement of the flight; `None` in older files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    before: Option<f64>,
    /// Under the prior of the rig.
    rig_sigma: f64,
}

/// A posterior with the names of its cameras and the flights that it comes from.
struct NamedPosterior<'a> {
    posterior: &'a CalibrationPosterior,
    cameras: Vec<String>,
    rig: &'a Rig,
    prior: Option<&'a FlightPrior>,
    start_ns: i64,
    /// Name of the log and of the run.
    source: String,
}

impl<'a> NamedPosterior<'a> {
    fn of_run(recording: &'a Recording, run: &'a RunRecord) -> Option<Self> {
        let posterior = run.posterior.as_deref()?;
        let estimate = &run.steps.last()?.report.calibration;
        Some(Self {
            posterior,
            cameras: run.camera_keys(estimate).into_iter().map(str::to_owned).collect(),
            rig: &recording.rig,
            prior: recording.prior.as_deref(),
            start_ns: recording.epoch_ns,
            source: format!("{} ({})", log_name(&recording.log_path), run.spec.label),
        })
    }

    fn of_calibration(run: &'a CalibrationRun) -> Self {
        Self {
            posterior: &run.posterior,
            cameras: vec![run.gimbal_camera.clone(), run.static_camera.clone()],
            rig: &run.given_rig,
            prior: run.prior.as_deref(),
            start_ns: run.epoch_ns,
            source: format!("{} (calibrate)", log_name(&run.log_path)),
        }
    }

    /// Names of the columns.
    fn names(&self) -> Vec<String> {
        let names = self.rig.parameter_names();
        let numbers = numbers(self.rig, &self.cameras);
        let columns =
            self.posterior.cameras.iter().zip(numbers).flat_map(|(camera, number)| {
                camera.parameters.iter().map(move |parameter| parameter.of_camera(number))
            });
        columns.map(|parameter| names.name(parameter)).collect()
    }

    /// Standard deviations under the rig's prior, after each earlier flight and after this one.
    fn flights(&self) -> Vec<FlightSigmas> {
        let named = |sigmas: Vec<f64>| self.names().into_iter().zip(sigmas).collect();
        let of_rig = self.posterior.cameras.iter().flat_map(|camera| camera.rig_sigmas.iter().copied()).collect();
        let of_rig = FlightSigmas { source: "rig".to_owned(), sigmas: named(of_rig) };
        let mut flights = self.prior.map_or_else(|| vec![of_rig], |prior| prior.history.clone());
        flights.push(FlightSigmas { source: self.source.clone(), sigmas: named(self.posterior.sigmas()) });
        flights
    }

    fn prior(&self, log: &Path, growth: f64) -> FlightPrior {
        FlightPrior {
            folder: log.to_owned(),
            cameras: self.cameras.clone(),
            joints: self.rig.joint_names(),
            posterior: self.posterior.clone(),
            growth,
            history: self.flights(),
        }
    }

    fn json(&self) -> String {
        let mut names = self.names().into_iter();
        let before = self.posterior.before.as_ref();
        let mut values_before = before.into_iter().flat_map(|before| before.values.iter().copied());
        let by_rows = |matrix: &DMatrix<f64>| matrix.row_iter().map(|row| row.iter().copied().collect()).collect();
        let cameras = self.posterior.cameras.iter().zip(&self.cameras).map(|(camera, key)| CameraEntry {
            key: key.clone(),
            parameterization: camera.parameterization.to_string(),
            columns: camera
                .parameters
                .iter()
                .zip(&camera.values)
                .zip(&camera.rig_sigmas)
                .zip(names.by_ref())
                .map(|(((parameter, value), rig_sigma), name)| ColumnEntry {
                    name,
                    unit: parameter.dimension().unit().to_owned(),
                    value: *value,
                    before: values_before.next(),
                    rig_sigma: *rig_sigma,
                })
                .collect(),
        });
        let file = PosteriorFile {
            posterior_version: VERSION,
            start_ns: Some(self.start_ns),
            joints: self.rig.joint_names(),
            cameras: cameras.collect(),
            covariance: by_rows(&self.posterior.covariance),
            covariance_before: before.map(|before| by_rows(&before.covariance)),
            flights: self.flights(),
        };
        format!("{}\n", serde_json::to_string(&file).unwrap_or_default())
    }
}

/// Text of `posterior.json` of a run, `None` if it has no posterior.
pub(super) fn posterior_of_run(recording: &Recording, run: &RunRecord) -> Option<String> {
    Some(NamedPosterior::of_run(recording, run)?.json())
}

/// Text of `posterior.json` of the rig's first gimbal camera.
#[cfg(test)]
pub(super) fn posterior_text(posterior: &CalibrationPosterior, rig: &Rig, start_ns: i64, source: &str) -> String {
    let cameras = vec![rig.cameras[0].key.clone()];
    NamedPosterior { posterior, cameras, rig, prior: None, start_ns, source: source.to_owned() }.json()
}

/// Text of `posterior.json` of an offline calibration.
pub(super) fn posterior_of_calibration(run: &CalibrationRun) -> String {
    NamedPosterior::of_calibration(run).json()
}

/// Standard deviations of a calibration after each of its flights.
#[derive(Clone, Debug, PartialEq)]
pub struct SigmaTable {
    /// Name and dimension of the parameters.
    parameters: Vec<(String, Dimension)>,
    flights: Vec<FlightSigmas>,
}

impl SigmaTable {
    /// Table of a run that started from earlier flights, `None` for any other.
    pub fn of_run(recording: &Recording, run: &RunRecord) -> Option<Self> {
        NamedPosterior::of_run(recording, run).filter(|named| named.prior.is_some()).map(|named| Self::new(&named))
    }

    /// Table of an offline calibration.
    pub fn of_calibration(run: &CalibrationRun) -> Self {
        Self::new(&NamedPosterior::of_calibration(run))
    }

    fn new(named: &NamedPosterior<'_>) -> Self {
        let dimensions = named.posterior.cameras.iter().flat_map(|camera| &camera.parameters);
        let dimensions = dimensions.map(|parameter| parameter.dimension());
        Self { parameters: named.names().into_iter().zip(dimensions).collect(), flights: named.flights() }
    }

    /// Standard deviations under the rig's prior, after each earlier flight and after this one.
    pub fn flights(&self) -> &[FlightSigmas] {
        &self.flights
    }
}

impl Display for SigmaTable {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        writeln!(f, "  σ under the rig's prior (0) and after each flight:")?;
        for (number, flight) in self.flights.iter().enumerate() {
            writeln!(f, "    {number}: {}", printable(&flight.source))?;
        }
        let numbers = (0..self.flights.len()).map(|number| right(number.to_string(), 10));
        let columns = [left("parameter", 26)].into_iter().chain(numbers).chain([left("", 0)]);
        let rows = self.parameters.iter().map(|(name, dimension)| {
            let (factor, unit) = dimension.shown_unit();
            let sigmas = self.flights.iter().map(|flight| flight.sigmas.get(name));
            let sigmas =
                sigmas.map(|sigma| sigma.map_or_else(|| "-".to_owned(), |sigma| format!("{:.4}", sigma * factor)));
            [name.clone()].into_iter().chain(sigmas).chain([format!(" {unit}")]).collect::<Vec<_>>()
        });
        write!(f, "{}", TextTable::new(columns, rows))
    }
}

/// Prior of another flight from an offline calibration; `growth` multiplies its standard deviations.
pub fn prior_of_calibration(run: &CalibrationRun, growth: f64) -> FlightPrior {
    NamedPosterior::of_calibration(run).prior(&run.log_path, growth)
}

/// Prior of another flight from a run, `None` if the run has no posterior; `growth` multiplies its standard deviations.
pub fn prior_of_run(recording: &Recording, run: &RunRecord, growth: f64) -> Option<FlightPrior> {
    Some(NamedPosterior::of_run(recording, run)?.prior(&recording.log_path, growth))
}

/// Calibration of a flight from the folder of its run or offline calibration.
#[derive(Clone, Debug)]
pub(super) struct FlightPosterior {
    /// Keys of its cameras, the main one first.
    pub(super) cameras: Vec<String>,
    pub(super) joints: Vec<String>,
    /// Names of the columns.
    pub(super) names: Vec<String>,
    pub(super) posterior: CalibrationPosterior,
    /// Time of the first message of the log, in nanoseconds since 1970 by its clock.
    pub(super) start_ns: Option<i64>,
    /// Standard deviations under the rig's prior, then after each flight.
    pub(super) flights: Vec<FlightSigmas>,
    /// Rig with the values of the calibration.
    pub(super) rig: Rig,
}

/// Reads the posterior of a run or an offline calibration from its folder; `growth` multiplies its standard deviations.
///
/// # Errors
/// If the folder has no posterior, or it is damaged or does not belong to the rig beside it.
pub fn read_prior(folder: &Path, growth: f64) -> Result<FlightPrior, ExportError> {
    let FlightPosterior { cameras, joints, posterior, flights, .. } = read_posterior(folder)?;
    Ok(FlightPrior { folder: folder.to_owned(), cameras, joints, posterior, growth, history: flights })
}

/// Reads the posterior of a run or an offline calibration from its folder.
///
/// # Errors
/// As [`read_prior`].
pub(super) fn read_posterior(folder: &Path) -> Result<FlightPosterior, ExportError> {
    let path = folder.join(POSTERIOR);
    let refused = |problem: String| ExportError::Posterior { problem, path: path.clone() };
    if !path.is_file() {
        let hint = "give the folder of one run (OUT/NAME of 'dcvins run') or of 'dcvins calibrate'";
        return Err(refused(format!("there is no such file; {hint} that ended with an estimated calibration")));
    }
    let read = |source| ExportError::Read { source, path: path.clone() };
    if fs::metadata(&path).map_err(read)?.len() > LARGEST_BYTES {
        return Err(refused("it is larger than 64 MiB".to_owned()));
    }
    let text = fs::read_to_string(&path).map_err(read)?;
    let file: PosteriorFile = serde_json::from_str(&text).map_err(|error| refused(error.to_string()))?;
    if file.posterior_version != VERSION {
        return Err(refused(format!("its version is {}, this program reads {VERSION}", file.posterior_version)));
    }
    let rig = Rig::from_file(&folder.join(RIG))?;
    let posterior = posterior_of(&file, &rig).map_err(refused)?;
    let columns = file.cameras.iter().flat_map(|camera| &camera.columns);
    Ok(FlightPosterior {
        names: columns.map(|column| column.name.clone()).collect(),
        cameras: file.cameras.into_iter().map(|camera| camera.key).collect(),
        joints: file.joints,
        posterior,
        start_ns: file.start_ns,
        flights: file.flights,
        rig,
    })
}

/// Posterior of a file with the chains of the rig beside it; the problem if they do not belong together.
fn posterior_of(file: &PosteriorFile, rig: &Rig) -> Result<CalibrationPosterior, String> {
    if file.joints != rig.joint_names() {
        return Err(format!("its joints are not those of the {RIG} beside it"));
    }
    let keys: Vec<String> = file.cameras.iter().map(|camera| camera.key.clone()).collect();
    let numbered = file.cameras.iter().zip(numbers(rig, &keys));
    let cameras: Vec<CameraPosterior> =
        numbered.map(|(entry, number)| camera_of(number, entry, rig)).collect::<Result<_, _>>()?;
    let count: usize = cameras.iter().map(|camera| camera.parameters.len()).sum();
    let columns = file.cameras.iter().flat_map(|camera| &camera.columns);
    let values_before: Option<Vec<f64>> = columns.map(|column| column.before).collect();
    let covariance_before = file.covariance_before.as_ref().map(|rows| covariance_of(rows, count)).transpose()?;
    let before = values_before.zip(covariance_before);
    Ok(CalibrationPosterior {
        cameras,
        covariance: covariance_of(&file.covariance, count)?,
        before: before.map(|(values, covariance)| ColumnBelief { values, covariance }),
    })
}

/// Covariance of `count` columns by rows; the problem if it is none.
fn covariance_of(rows: &[Vec<f64>], count: usize) -> Result<DMatrix<f64>, String> {
    if count == 0 || rows.len() != count || rows.iter().any(|row| row.len() != count) {
        return Err(format!("its covariance is not {count} × {count}, as its columns are"));
    }
    let covariance = DMatrix::from_fn(count, count, |row, column| 0.5 * (rows[row][column] + rows[column][row]));
    let positive = covariance.clone() + DMatrix::identity(count, count) * 1e-12;
    if covariance.iter().any(|entry| !entry.is_finite()) || positive.cholesky().is_none() {
        return Err("its covariance is not positive definite".to_owned());
    }
    Ok(covariance)
}

/// Numbers of cameras in the names of parameters, the main camera first.
fn numbers(rig: &Rig, keys: &[String]) -> Vec<u8> {
    let number = |(place, key): (usize, &String)| if place == 0 { 0 } else { rig.camera_number(key) };
    keys.iter().enumerate().map(number).collect()
}

fn camera_of(camera: u8, entry: &CameraEntry, rig: &Rig) -> Result<CameraPosterior, String> {
    let key = printable(&entry.key);
    let chain = rig.chain_of_camera(&entry.key).ok_or_else(|| format!("the {RIG} beside it has no camera '{key}'"))?;
    let parameterization: Parameterization = entry
        .parameterization
        .parse()
        .map_err(|problem: UnknownParameterization| printable(&problem.to_string()).into_owned())?;
    let names = rig.parameter_names();
    let parse = |column: &ColumnEntry| {
        let parameter = names.parse(&column.name);
        let parameter = parameter.filter(|parameter| parameter.of_camera(camera) == *parameter);
        let parameter = parameter.ok_or_else(|| format!("camera '{key}' has no '{}'", printable(&column.name)))?;
        Ok(parameter.of_camera(0))
    };
    let parameters: Vec<ParameterId> = entry.columns.iter().map(parse).collect::<Result<_, String>>()?;
    let whole = Chain::from_classical(&chain, parameterization);
    let of_chain: Vec<ParameterId> =
        parameters.iter().copied().filter(|parameter| parameter.group() == ParameterGroup::Chain).collect();
    let reduced = whole.clone().without_joint_offsets();
    let form = [&whole, &reduced].into_iter().find(|form| form.parameters() == of_chain);
    let starts_with_chain = parameters.starts_with(&of_chain);
    let form = form.filter(|_| starts_with_chain).ok_or_else(|| {
        format!("the columns of camera '{key}' are not those of the parameterization {parameterization}")
    })?;
    for (column, (parameter, value)) in entry.columns.iter().zip(of_chain.iter().zip(&form.values())) {
        let difference = parameter.dimension().difference(column.value, *value).abs();
        if difference.is_nan() || difference > MAX_ROUNDING {
            return Err(format!("its {} is not that of the {RIG} beside it", printable(&column.name)));
        }
    }
    Ok(CameraPosterior {
        chain,
        parameterization,
        parameters,
        values: entry.columns.iter().map(|column| column.value).collect(),
        rig_sigmas: entry.columns.iter().map(|column| column.rig_sigma).collect(),
    })
}
