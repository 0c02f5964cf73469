//! Errors of calibration parameters against their standard deviations.

use std::collections::BTreeMap;

use serde::Serialize;

use super::metric::Metric;
use super::study::{Study, columns};
use crate::geometry::{mean_square_quantile, median};
use crate::table::{Column, Medium, Tone, significant};

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterPoint {
    pub row: usize,
    /// Standard deviation at the end, in the shown unit.
    pub sigma: f64,
    /// Final minus true value, in the shown unit.
    pub error: f64,
}

/// A parameter over many runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParameterErrors {
    pub name: String,
    pub unit: &'static str,
    /// Runs with a ground truth and a σ above zero.
    #[serde(skip)]
    pub points: Vec<ParameterPoint>,
    /// Root mean square of error over σ; 1 when consistent.
    pub ratio_rms: f64,
    /// Mean of error over σ; 0 without a bias.
    pub ratio_mean: f64,
    /// Fraction of points within 1 σ, 0.683 when consistent.
    pub within_1: f64,
    /// Fraction of points within 3 σ, 0.997 when consistent.
    pub within_3: f64,
    /// Root mean square of the errors, in the shown unit.
    pub error_rms: f64,
    /// Median σ, in the shown unit.
    pub sigma_median: f64,
}

/// Agreement of the standard deviations of a parameter with its errors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SigmaVerdict {
    /// The errors are larger than σ implies.
    TooSmall,
    Consistent,
    /// The errors are smaller than σ implies.
    TooLarge,
}

impl SigmaVerdict {
    /// Symbol and emphasis on a screen.
    pub const fn look(self) -> (&'static str, Tone) {
        match self {
            Self::Consistent => ("✔", Tone::Good),
            Self::TooSmall => ("⚠", Tone::Bad),
            Self::TooLarge => ("⚠", Tone::Caution),
        }
    }
}

type ErrorColumn = Column<'static, ParameterErrors>;

impl ParameterErrors {
    /// Columns of the table in files, on the screen and in reports.
    pub fn columns() -> Vec<ErrorColumn> {
        let percent = |rate: f64, medium: Medium| format!("{} %", medium.fixed(100.0 * rate, 1));
        // On a page the unit has a column.
        let with_unit = |value: f64, unit: &str, medium: Medium| match (medium, unit) {
            (Medium::Page, _) => medium.fixed(value, 4),
            (Medium::Screen, "" | "°") => format!("{}{unit}", significant(value)),
            (Medium::Screen, _) => format!("{} {unit}", significant(value)),
        };
        let columns = [
            ErrorColumn::new("parameter", |of| of.name.clone())
                .means("", "Click: show its runs on the right")
                .headings("Parameter", "parameter"),
            ErrorColumn::new("unit", |of| of.unit).on_page("unit"),
            ErrorColumn::new("runs", |of| of.points.len()).on_page("runs"),
            ErrorColumn::new("error_over_sigma_rms", |of| of.ratio_rms)
                .means("", "Root mean square of error over σ; 1 when σ is consistent, above 1 when it is too small")
                .text(|of, medium| match medium {
                    Medium::Screen => format!("{} {}", medium.fixed(of.ratio_rms, 2), of.verdict().look().0),
                    Medium::Page => medium.fixed(of.ratio_rms, 2),
                })
                .tone(|of| of.verdict().look().1)
                .headings("error / σ", "RMS of error / σ"),
            ErrorColumn::new("error_over_sigma_mean", |of| of.ratio_mean)
                .means("", "Mean of error over σ; 0 without a bias")
                .text(|of, medium| medium.fixed(of.ratio_mean, 2))
                .headings("mean", "mean of error / σ"),
            ErrorColumn::new("within_1_sigma", |of| of.within_1)
                .means("", "Runs whose error is within 1 σ; 68 % when consistent")
                .text(move |of, medium| percent(of.within_1, medium))
                .headings("≤ 1σ", "within 1 σ"),
            ErrorColumn::new("within_3_sigma", |of| of.within_3)
                .means("", "Runs whose error is within 3 σ; 99.7 % when consistent")
                .text(move |of, medium| percent(of.within_3, medium))
                .headings("≤ 3σ", "within 3 σ"),
            ErrorColumn::new("error_rms", |of| of.error_rms)
                .means("", "Root mean square of the errors")
                .text(move |of, medium| with_unit(of.error_rms, of.unit, medium))
                .headings("RMS error", "RMS error"),
            ErrorColumn::new("sigma_median", |of| of.sigma_median)
                .means("", "Median of the standard deviations at the end")
                .text(move |of, medium| with_unit(of.sigma_median, of.unit, medium))
                .headings("median σ", "median σ"),
        ];
        columns.into()
    }

    /// Verdict on the RMS ratio of error to σ: consistent between 0.5 and 1.5, or within the 99 % interval for this
    /// number of runs.
    pub fn verdict(&self) -> SigmaVerdict {
        const NORMAL_QUANTILE: f64 = 2.58;
        let by_chance = |normal: f64| mean_square_quantile(self.points.len().max(1) as f64, normal).sqrt();
        if self.ratio_rms > by_chance(NORMAL_QUANTILE).max(1.5) {
            SigmaVerdict::TooSmall
        } else if self.ratio_rms < by_chance(-NORMAL_QUANTILE).min(0.5) {
            SigmaVerdict::TooLarge
        } else {
            SigmaVerdict::Consistent
        }
    }
}

/// The parameters of `rows` in the order of the table of parameters; `run_of` is the result of
/// [`Study::run_of_parameter_rows`].
pub fn parameter_errors(study: &Study, run_of: &[Option<usize>], rows: &[usize]) -> Vec<ParameterErrors> {
    let mut shown = vec![false; study.runs.rows()];
    for row in rows {
        shown[*row] = true;
    }
    let mut places: BTreeMap<&str, usize> = BTreeMap::new();
    let mut all: Vec<(&str, &'static str, Vec<ParameterPoint>)> = Vec::new();
    let table = &study.parameters;
    for (place, run) in run_of.iter().enumerate() {
        let Some(run) = run.filter(|run| shown[*run]) else { continue };
        let values = (table.number(place, columns::SIGMA), table.number(place, columns::ERROR));
        let (Some(name), (Some(sigma), Some(error))) = (table.text(place, columns::PARAMETER), values) else {
            continue;
        };
        if sigma <= 0.0 {
            continue;
        }
        let unit = table.text(place, columns::UNIT).unwrap_or_default();
        let (factor, unit) = match unit {
            "s" => (1e3, "ms"),
            unit => Metric::shown_unit(unit, true),
        };
        let at = *places.entry(name).or_insert_with(|| {
            all.push((name, unit, Vec::new()));
            all.len() - 1
        });
        all[at].2.push(ParameterPoint { row: run, sigma: sigma * factor, error: error * factor });
    }
    all.into_iter().map(|(name, unit, points)| summarized(name, unit, points)).collect()
}

fn summarized(name: &str, unit: &'static str, points: Vec<ParameterPoint>) -> ParameterErrors {
    let count = points.len().max(1) as f64;
    let mean = |of: &dyn Fn(&ParameterPoint) -> f64| points.iter().map(of).sum::<f64>() / count;
    let within = |limit: f64| mean(&|point| f64::from(u8::from(point.error.abs() <= limit * point.sigma)));
    ParameterErrors {
        name: name.to_owned(),
        unit,
        ratio_rms: mean(&|point| (point.error / point.sigma).powi(2)).sqrt(),
        ratio_mean: mean(&|point| point.error / point.sigma),
        within_1: within(1.0),
        within_3: within(3.0),
        error_rms: mean(&|point| point.error.powi(2)).sqrt(),
        sigma_median: median(points.iter().map(|point| point.sigma)).unwrap_or(f64::NAN),
        points,
    }
}
