//! Files of `dcvins excerpt`: one log with its rig per stretch, and `excerpt.json` with their effect on the calibration.

use crate::files::RigFile as _;
use std::fmt::{self, Display, Formatter};
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::error::ExportError;
use super::folder_files::{json_text, write_files};
use super::masks;
use crate::files::output;
use crate::flight_log::{FlightLog, LogWriterOptions, write_excerpt};
use crate::geometry::{ns_from_seconds, seconds_from_ns};
use crate::observability::{UsefulStretch, UsefulStretches};
use crate::sensors::Rig;
use crate::session::{CollectedInformation, FlightSigmas};
use crate::table::text::{TextTable, left, right};
use crate::text::log_name;

const INDEX: &str = "excerpt.json";
/// Largest growth of σ that still counts as the result of the whole flight.
const AIM_RATIO: f64 = 1.1;
/// Parameters that are named as the reason of a stretch, and the growth of σ without it from which they are.
const REASONS: usize = 3;
const MIN_REASON: f64 = 1.05;

/// Content of the file `excerpt.json`.
#[derive(Clone, Debug, Serialize)]
pub struct ExcerptSummary {
    pub log: String,
    pub run: String,
    /// Requested duration of all stretches, in seconds.
    pub seconds: f64,
    pub stretches: Vec<ExcerptStretch>,
    pub parameters: Vec<ExcerptParameter>,
}

#[derive(Clone, Debug, Serialize)]
pub struct ExcerptStretch {
    pub log: PathBuf,
    pub start_s: f64,
    pub end_s: f64,
    pub messages: u64,
    /// Parameters whose σ grows most without this stretch, each with that factor.
    pub needed_by: Vec<(String, f64)>,
}

/// Standard deviations of a parameter after the whole flight and after its stretches alone.
#[derive(Clone, Debug, Serialize)]
pub struct ExcerptParameter {
    pub name: String,
    /// Predicted σ of the stretches, divided by the σ of the whole flight.
    pub predicted_ratio: f64,
    /// The same from a run over the stretches.
    pub achieved_ratio: Option<f64>,
}

impl ExcerptSummary {
    /// Summary of the chosen stretches before they are written.
    pub fn new(log: &Path, run: &str, seconds: f64, rig: &Rig, of: (&CollectedInformation, &UsefulStretches)) -> Self {
        let (collected, useful) = of;
        let names = rig.parameter_names();
        let names: Vec<String> = collected.parameters.iter().map(|parameter| names.name(*parameter)).collect();
        let stretch = |(number, stretch): (usize, &UsefulStretch)| {
            let mut needed_by: Vec<(String, f64)> =
                names.iter().cloned().zip(stretch.growth_without.iter().copied()).collect();
            needed_by.retain(|(_, growth)| *growth >= MIN_REASON);
            needed_by.sort_by(|a, b| b.1.total_cmp(&a.1));
            needed_by.truncate(REASONS);
            ExcerptStretch {
                log: stretch_file(log, number),
                start_s: seconds_from_ns(stretch.start_ns),
                end_s: seconds_from_ns(stretch.end_ns),
                messages: 0,
                needed_by,
            }
        };
        Self {
            log: log_name(log),
            run: run.to_owned(),
            seconds,
            stretches: useful.stretches.iter().enumerate().map(stretch).collect(),
            parameters: names
                .iter()
                .zip(&useful.ratios)
                .map(|(name, ratio)| ExcerptParameter {
                    name: name.clone(),
                    predicted_ratio: *ratio,
                    achieved_ratio: None,
                })
                .collect(),
        }
    }

    /// Takes the ratios of a run over the stretches from the standard deviations after it and after the whole flight.
    pub fn set_achieved(&mut self, whole: &FlightSigmas, stretches: &FlightSigmas) {
        for parameter in &mut self.parameters {
            let sigma = |of: &FlightSigmas| of.sigmas.get(&parameter.name).copied();
            parameter.achieved_ratio = sigma(stretches).zip(sigma(whole)).map(|(one, whole)| one / whole);
        }
    }

    /// Parameter with the largest ratio, achieved where it is known.
    fn worst(&self) -> Option<(&ExcerptParameter, f64)> {
        let ratio = |parameter: &ExcerptParameter| parameter.achieved_ratio.unwrap_or(parameter.predicted_ratio);
        let rated = self.parameters.iter().map(|parameter| (parameter, ratio(parameter)));
        rated.max_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// Name of the log of a stretch, counted from 0.
fn stretch_file(log: &Path, number: usize) -> PathBuf {
    let stem = log_name(log);
    PathBuf::from(format!("{}-{}.mcap", Path::new(&stem).with_extension("").display(), number + 1))
}

/// Checks that an excerpt of this number of stretches of a log may be written into a folder.
///
/// # Errors
/// If the folder cannot be written, or a file exists and `force` is not given.
pub fn check_excerpt_folder(folder: &Path, log: &Path, stretches: usize, force: bool) -> Result<(), ExportError> {
    output::check_folder(folder).map_err(ExportError::write(folder))?;
    let names = (0..stretches).map(|number| stretch_file(log, number)).chain([PathBuf::from(INDEX)]);
    for path in names.map(|name| folder.join(name)) {
        if path.exists() && !force {
            return Err(ExportError::Existing { problem: "it exists already".to_owned(), path });
        }
    }
    Ok(())
}

/// Writes each stretch as a log with the rig, and the ground-truth rig if there is one, beside it.
///
/// # Errors
/// If a file cannot be written.
pub fn write_stretches(
    summary: &mut ExcerptSummary,
    log: &FlightLog,
    (rig, ground_truth): (&Rig, Option<&Rig>),
    folder: &Path,
) -> Result<(), ExportError> {
    let mut rig = rig.clone();
    let masks = masks::beside(&mut rig)?;
    write_files(masks, folder)?;
    for stretch in &mut summary.stretches {
        let path = folder.join(&stretch.log);
        let span = [stretch.start_s, stretch.end_s].map(ns_from_seconds);
        let report = write_excerpt(log, span.into(), &path, &LogWriterOptions::default())?;
        stretch.messages = report.messages;
        let mut rigs = vec![(stretch.log.with_extension("rig.yaml"), rig.to_yaml())];
        rigs.extend(ground_truth.map(|rig| (stretch.log.with_extension("truth.yaml"), rig.to_yaml())));
        write_files(rigs, folder)?;
    }
    Ok(())
}

/// Writes `excerpt.json`.
///
/// # Errors
/// If the file cannot be written.
pub fn write_excerpt_index(summary: &ExcerptSummary, folder: &Path) -> Result<(), ExportError> {
    let json = json_text(summary, &folder.join(INDEX))?;
    write_files([(INDEX, json)], folder).map(drop)
}

impl Display for ExcerptSummary {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let total_s: f64 = self.stretches.iter().map(|stretch| stretch.end_s - stretch.start_s).sum();
        writeln!(f, "{} ({}): {total_s:.1} s in {} stretches", self.log, self.run, self.stretches.len())?;
        for stretch in &self.stretches {
            let needed: Vec<String> =
                stretch.needed_by.iter().map(|(name, growth)| format!("σ({name}) × {growth:.2}")).collect();
            let needed = if needed.is_empty() { "no parameter needs it alone".to_owned() } else { needed.join(", ") };
            let (start_s, end_s, log) = (stretch.start_s, stretch.end_s, stretch.log.display());
            writeln!(f, "  {start_s:7.2} to {end_s:7.2} s  {log}; without it {needed}")?;
        }
        writeln!(f, "  σ of the stretches / σ of the whole flight")?;
        let columns = [left("parameter", 26), right("predicted", 10), right("achieved", 10)];
        let rows = self.parameters.iter().map(|parameter| {
            let achieved = parameter.achieved_ratio.map_or_else(|| "-".to_owned(), |ratio| format!("{ratio:.3}"));
            [parameter.name.clone(), format!("{:.3}", parameter.predicted_ratio), achieved]
        });
        write!(f, "{}", TextTable::new(columns, rows))?;
        let Some((worst, ratio)) = self.worst() else { return Ok(()) };
        let percent = 100.0 * (ratio - 1.0);
        if ratio <= AIM_RATIO {
            writeln!(f, "  every σ is within 10 % of the whole flight's; largest: {} {percent:+.1} %", worst.name)
        } else {
            writeln!(
                f,
                "  {:.0} s do not keep every σ within 10 % of the whole flight's: {} {percent:+.0} %; give more --seconds",
                self.seconds, worst.name
            )
        }
    }
}
