//! Columns of the calibration table: in files, on the screen and in reports.

use super::flight_parameter::{FlightParameter, ParameterSummary};
use crate::geometry::Dimension;
use crate::observability::Determination;
use crate::table::{Column, Medium, Shown, Style, Tone};
use crate::text::Named as _;

/// Row of the calibration table.
pub struct CalibrationRow<'a> {
    pub flight: &'a FlightParameter,
    /// Values of the whole run; `None` while it computes.
    pub summary: Option<&'a ParameterSummary>,
    /// True while the suggested motions are being computed.
    pub waits_for_advice: bool,
}

/// Error in standard deviations that is marked.
const FAR_ERROR: f64 = 3.0;

type CalibrationColumn<'a> = Column<'a, CalibrationRow<'a>>;

impl<'a> CalibrationRow<'a> {
    pub fn columns() -> Vec<CalibrationColumn<'a>> {
        let columns = [
            CalibrationColumn::new("parameter", |row| row.flight.name.as_str())
                .means("", "Click on a row: go to the start of the verdict and select the parameter")
                .headings("Parameter", "parameter")
                .natural(),
            CalibrationColumn::new("group", |row| row.flight.group),
            CalibrationColumn::new("unit", |row| row.flight.dimension.unit()),
            CalibrationColumn::shown(|row| row.summary.map(|summary| summary.initial))
                .text(|row, _| row.summary.map_or_else(String::new, |summary| row.on_page(summary.initial)))
                .on_page("rig"),
            CalibrationColumn::new("value", |row| row.flight.value)
                .means(
                    "",
                    "Estimate at the end of the flight and its posterior standard deviation, multiplied by the factor by \
                     which the estimates of the run have changed more than their σ allow (at least 1)",
                )
                .text(Self::value_text)
                .headings("Value ± 1 σ", "final ± 1 σ"),
            CalibrationColumn::new("sigma", |row| row.flight.sigma),
            CalibrationColumn::new("sigma_scale", |row| row.flight.sigma_scale),
            CalibrationColumn::new("prior_sigma", |row| row.flight.prior_sigma),
            CalibrationColumn::new("ratio", |row| row.flight.ratio)
                .means("", "1: the flight adds nothing; 0.5: three quarters of the information come from it")
                .text(|row, medium| row.flight.ratio.map_or_else(String::new, |ratio| medium.fixed(ratio, 3)))
                .on_screen("σ / prior")
                .largest_first(),
            CalibrationColumn::new("flight_sigma", |row| row.flight.flight_sigma),
            CalibrationColumn::new("required", |row| row.flight.required),
            CalibrationColumn::new("verdict", |row| row.flight.verdict.name())
                .means("", Determination::RULE)
                .text(|row, medium| row.flight.verdict.shown(medium))
                .tone(|row| row.flight.verdict.tone())
                .order(|a, b| {
                    let rank = |row: &Self| (row.flight.verdict.severity(), row.flight.of_required());
                    rank(a).partial_cmp(&rank(b)).unwrap_or(std::cmp::Ordering::Equal)
                })
                .headings("Verdict", "verdict")
                .largest_first(),
            CalibrationColumn::new("since_s", |row| row.flight.since_s())
                .means("s", "Time from which the verdict holds without interruption until the end of the flight")
                .text(Self::since_text)
                .tone(|_| Tone::Accent)
                .on_screen("Since"),
            CalibrationColumn::new("error", |row| row.flight.error)
                .text(|row, _| row.error_text())
                .optional()
                .on_page("error (multiple of σ)"),
            CalibrationColumn::new("error_in_sigmas", |row| row.flight.error_in_sigmas())
                .means("σ", "Error of the value against the ground truth, in units of its σ")
                .text(|row, medium| {
                    row.flight.error_in_sigmas().map_or_else(String::new, |error| medium.fixed(error, 1))
                })
                .tone(|row| match row.flight.error_in_sigmas() {
                    Some(error) if error.abs() > FAR_ERROR => Tone::Bad,
                    _ => Tone::Weak,
                })
                .optional()
                .on_screen("Error / σ"),
            CalibrationColumn::new("cause", |row| row.flight.cause.map_or("", |cause| cause.name())),
            CalibrationColumn::new("reason", |row| row.flight.reason.as_str())
                .means(
                    "",
                    "Cause; windows that inform the parameter less than a prior of 10° or 3 cm; largest posterior \
                     correlations",
                )
                .style(Style::Wrapped)
                .on_screen("Why"),
            CalibrationColumn::new("remedy", |row| row.flight.remedy.as_str())
                .means("", "Motion, record or run that would improve the verdict, with its predicted effect on σ")
                .text(Self::remedy_text)
                .style(Style::Wrapped)
                .on_screen("What helps"),
        ];
        columns.into()
    }

    /// Value in the unit of pages, with the decimals of its dimension.
    fn on_page(&self, value: f64) -> String {
        let decimals = match self.flight.dimension {
            Dimension::Length => 2,
            Dimension::Angle | Dimension::Time | Dimension::Pixel => 3,
            Dimension::Ratio => 6,
        };
        Medium::Page.fixed(value * Shown::of(self.flight.dimension).factor, decimals)
    }

    fn value_text(&self, medium: Medium) -> String {
        let FlightParameter { parameter, dimension, value, sigma, .. } = self.flight;
        if medium == Medium::Page {
            let sigma = sigma.map_or_else(String::new, |sigma| format!(" ± {}", self.on_page(sigma)));
            return format!("{}{sigma}{}", self.on_page(*value), Shown::of(*dimension).unit);
        }
        let (shown, sigma) = (parameter.shown(), sigma.unwrap_or(f64::NAN));
        let value = shown.value(*value, sigma);
        format!("{} ± {}", value.strip_suffix(shown.unit).unwrap_or(&value), shown.sigma(sigma))
    }

    fn since_text(&self, medium: Medium) -> String {
        let unit = if medium == Medium::Screen { " s" } else { "" };
        self.flight.since_s().map_or_else(String::new, |since_s| format!("{}{unit}", medium.fixed(since_s, 2)))
    }

    fn error_text(&self) -> String {
        let Some(error) = self.flight.error else { return String::new() };
        let ratio = self.flight.error_in_sigmas().map(f64::abs);
        let ratio = ratio.map_or_else(String::new, |ratio| format!(" ({} σ)", Medium::Page.fixed(ratio, 1)));
        format!("{}{}{ratio}", self.on_page(error), Shown::of(self.flight.dimension).unit)
    }

    fn remedy_text(&self, _: Medium) -> String {
        let FlightParameter { cause, remedy, .. } = self.flight;
        let is_computing = remedy.is_empty() && cause.is_some() && self.waits_for_advice;
        if is_computing { "computing…".to_owned() } else { remedy.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_unit_is_shown_as_people_read_it() {
        let check = |dimension: Dimension, expected: [&str; 3]| {
            let name = "parameter".to_owned();
            let (ground_truth, error, sigma) = (Some(0.5), Some(-0.25), Some(0.125));
            let summary = ParameterSummary {
                name: name.clone(),
                dimension,
                initial: 0.0,
                last: 0.25,
                sigma,
                ground_truth,
                error,
            };
            let flight = FlightParameter {
                parameter: crate::gimbal::ParameterId::timeshift(0),
                name,
                group: "clocks",
                dimension,
                value: 0.25,
                sigma,
                prior_sigma: Some(0.25),
                ratio: Some(0.5),
                flight_sigma: None,
                sigma_scale: 1.0,
                error,
                required: 0.0625,
                verdict: Determination::WeaklyDetermined,
                since_ns: Some(1_500_000_000),
                cause: None,
                reason: "motion".to_owned(),
                remedy: String::new(),
            };
            let cells = |summary: Option<&ParameterSummary>| {
                let rows = [CalibrationRow { flight: &flight, summary, waits_for_advice: false }];
                let columns = CalibrationRow::columns().into_iter();
                let shown = columns.filter(|column| column.is_shown(Medium::Page, rows.iter()));
                shown.map(|column| column.shown_text(&rows[0], Medium::Page)).collect::<Vec<_>>()
            };
            let [rig, last, error] = expected;
            assert_eq!(cells(Some(&summary)), ["parameter", rig, last, "fail, weakly determined", error]);
            assert_eq!(cells(None).len(), 5);
        };
        check(Dimension::Angle, ["0.000", "14.324 ± 7.162°", "−14.324° (2.0 σ)"]);
        check(Dimension::Length, ["0.00", "250.00 ± 125.00 mm", "−250.00 mm (2.0 σ)"]);
        check(Dimension::Time, ["0.000", "250.000 ± 125.000 ms", "−250.000 ms (2.0 σ)"]);
    }
}
