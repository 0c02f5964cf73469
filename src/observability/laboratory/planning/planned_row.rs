//! Table of σ: one parameter with the prior, the log, the motion and both.

use super::problem::MotionPrediction;
use super::summary::PlannedParameter;
use crate::observability::Determination;
use crate::table::{Column, Shown, Style, Tone, fixed};
use crate::text::Named as _;

/// Smallest change of σ that is coloured, as a ratio.
const NOTICED_CHANGE: f64 = 0.005;

/// σ of one parameter in all columns.
pub struct PlannedRow<'a> {
    pub flight: Option<&'a PlannedParameter>,
    motion: &'a PlannedParameter,
    both: Option<&'a PlannedParameter>,
    /// After everything that is known.
    pub last: &'a PlannedParameter,
    /// Ratio of the last σ to the σ before the change.
    change: Option<f64>,
    /// σ over the prior σ before the change.
    pub ratio_before: Option<f64>,
}

type PlannedColumn<'a> = Column<'a, PlannedRow<'a>>;

impl<'a> PlannedRow<'a> {
    /// Rows of a prediction, with the prediction before the last change of the motion.
    pub fn all(now: &'a MotionPrediction, before: Option<&'a MotionPrediction>) -> Vec<Self> {
        let of = |(index, motion): (usize, &'a PlannedParameter)| {
            let last = &now.result().parameters[index];
            let before = before.and_then(|before| before.result().parameters.get(index));
            PlannedRow {
                flight: now.flight.as_ref().map(|table| &table.parameters[index]),
                motion,
                both: now.both.as_ref().map(|table| &table.parameters[index]),
                last,
                change: before.map(|before| last.sigma / before.sigma).filter(|change| change.is_finite()),
                ratio_before: before.map(|before| before.ratio),
            }
        };
        now.motion.parameters.iter().enumerate().map(of).collect()
    }

    /// Columns in files and on the screen; `flight` is the meaning of the σ of the log.
    pub fn columns(flight: String) -> Vec<PlannedColumn<'a>> {
        let of_ratio = "Last σ over the prior σ; line: the required accuracy; thin mark: this log alone";
        let columns = [
            PlannedColumn::new("parameter", |row| row.last.name.as_str())
                .means("", "Calibration parameter of the chain; click on a row to select it")
                .on_screen("Parameter"),
            PlannedColumn::new("unit", |row| row.last.dimension.unit()),
            PlannedColumn::new("prior_sigma", |row| row.last.prior_sigma)
                .means("", "Standard deviation by the rig, before any flight")
                .text(|row, _| row.shown().sigma(row.motion.prior_sigma))
                .tone(|_| Tone::Weak)
                .on_screen("Prior σ"),
            PlannedColumn::new("log_sigma", |row| Some(row.flight?.sigma))
                .means("", flight)
                .text(|row, _| row.sigma(row.flight))
                .tone(|_| Tone::Plain)
                .optional()
                .on_screen("This log"),
            PlannedColumn::new("motion_sigma", |row| row.motion.sigma)
                .means("", "Predicted σ after the motion, from the prior alone")
                .text(|row, _| row.sigma(Some(row.motion)))
                .tone(|row| if row.both.is_some() { Tone::Plain } else { Tone::Strong })
                .on_screen("Motion"),
            PlannedColumn::new("log_and_motion_sigma", |row| Some(row.both?.sigma))
                .means("", "Predicted σ after this log and the motion")
                .text(|row, _| row.sigma(row.both))
                .optional()
                .on_screen("Log + motion"),
            PlannedColumn::shown(|row| row.last.ratio).means("", of_ratio).style(Style::Drawing).on_screen("σ / prior"),
            PlannedColumn::new("ratio", |row| row.last.ratio)
                .means("", of_ratio)
                .text(|row, _| fixed(row.last.ratio, 3))
                .on_screen(""),
            PlannedColumn::shown(|row| row.change)
                .means("", "Change of the last σ by the last change of the motion")
                .text(|row, _| row.change.map_or_else(String::new, change_text))
                .tone(|row| row.change.map_or(Tone::Weak, change_tone))
                .optional()
                .on_screen("Change"),
            PlannedColumn::new("required", |row| row.last.required)
                .means("", "Largest σ with which the parameter is known well enough")
                .text(|row, _| row.shown().sigma(row.last.required))
                .tone(|_| Tone::Weak)
                .on_screen("Required"),
            PlannedColumn::new("verdict", |row| row.last.verdict.name())
                .means("", Determination::RULE)
                .text(|row, medium| row.last.verdict.shown(medium))
                .tone(|row| row.last.verdict.tone())
                .on_screen("Verdict"),
        ];
        columns.into()
    }

    fn shown(&self) -> Shown {
        Shown::of(self.last.dimension)
    }

    fn sigma(&self, of: Option<&PlannedParameter>) -> String {
        of.map_or_else(String::new, |of| self.shown().sigma(of.sigma))
    }

    /// The row as one text, for a screen reader and the clipboard.
    pub fn sentence(&self) -> String {
        let shown = self.shown();
        let mut parts = vec![format!("{}: prior σ {}", self.last.name, shown.sigma(self.motion.prior_sigma))];
        parts.extend(self.flight.map(|flight| format!("this log {}", shown.sigma(flight.sigma))));
        parts.push(format!("motion alone {}", shown.sigma(self.motion.sigma)));
        parts.extend(self.both.map(|both| format!("log and motion {}", shown.sigma(both.sigma))));
        parts.push(format!("σ {} of the prior", fixed(self.last.ratio, 3)));
        parts.push(self.last.verdict.name().to_owned());
        parts.extend(self.change.map(|change| format!("change {}", change_text(change))));
        parts.join(", ")
    }
}

/// Change of σ in percent with its sign.
fn change_text(change: f64) -> String {
    let percent = fixed(100.0 * (change - 1.0).abs(), 0);
    match (percent.as_str(), change < 1.0) {
        ("0", _) => "0 %".to_owned(),
        (_, true) => format!("−{percent} %"),
        (_, false) => format!("+{percent} %"),
    }
}

fn change_tone(change: f64) -> Tone {
    if change < 1.0 - NOTICED_CHANGE {
        Tone::Good
    } else if change > 1.0 + NOTICED_CHANGE {
        Tone::Bad
    } else {
        Tone::Weak
    }
}
