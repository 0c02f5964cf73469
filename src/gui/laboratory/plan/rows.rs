//! Rows of the table of σ: one parameter with the prior, this log, the motion and both.

use egui::{Color32, FontId};

use super::planned_run::FlightSoFar;
use crate::gui::determination::look_of;
use crate::gui::theme::{Theme, label_font, number_font};
use crate::gui::units::{Shown, fixed};
use crate::observability::Determination;
use crate::observability::laboratory::{MotionPrediction, PlannedParameter, Situation};
use crate::text::Named as _;

/// Smallest change of σ that is coloured, as a ratio.
const NOTICED_CHANGE: f64 = 0.005;

/// A prediction with the one before the last change of the motion.
pub(super) struct ShownPrediction<'a> {
    pub(super) situation: &'a Situation,
    pub(super) now: &'a MotionPrediction,
    pub(super) before: Option<&'a MotionPrediction>,
    pub(super) flight: Option<&'a FlightSoFar>,
}

/// Column of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SigmaColumn {
    Parameter,
    Prior,
    Flight,
    Motion,
    Both,
    Bar,
    Ratio,
    Change,
    Verdict,
}

impl SigmaColumn {
    pub(super) const ALL: [Self; 9] = [
        Self::Parameter,
        Self::Prior,
        Self::Flight,
        Self::Motion,
        Self::Both,
        Self::Bar,
        Self::Ratio,
        Self::Change,
        Self::Verdict,
    ];

    pub(super) const fn title(self) -> &'static str {
        match self {
            Self::Parameter => "Parameter",
            Self::Prior => "Prior σ",
            Self::Flight => "This log",
            Self::Motion => "Motion",
            Self::Both => "Log + motion",
            Self::Bar => "σ / prior",
            Self::Ratio => "",
            Self::Change => "Change",
            Self::Verdict => "Verdict",
        }
    }

    pub(super) fn meaning(self, flight: Option<&FlightSoFar>) -> String {
        match self {
            Self::Parameter => "Calibration parameter of the chain; click on a row to select it".to_owned(),
            Self::Prior => "Standard deviation by the rig, before any flight".to_owned(),
            Self::Flight => flight.map_or_else(String::new, |flight| {
                let so_far = if flight.is_whole { "its end" } else { "its last computed image" };
                format!("Posterior σ of the selected run at {so_far}, {} s", fixed(flight.at_s, 2))
            }),
            Self::Motion => "Predicted σ after the motion, from the prior alone".to_owned(),
            Self::Both => "Predicted σ after this log and the motion".to_owned(),
            Self::Bar | Self::Ratio => {
                "Last σ over the prior σ; lines: 0.3 and 0.9; thin mark: this log alone".to_owned()
            }
            Self::Change => "Change of the last σ by the last change of the motion".to_owned(),
            Self::Verdict => Determination::RULE.to_owned(),
        }
    }
}

/// Cell of a text column: text, font and colour.
pub(super) type TextCell = (String, FontId, Color32);

/// σ of one parameter in all columns.
pub(super) struct PlannedRow<'a> {
    prior: &'a PlannedParameter,
    pub(super) flight: Option<&'a PlannedParameter>,
    motion: &'a PlannedParameter,
    both: Option<&'a PlannedParameter>,
    /// After everything that is known.
    pub(super) last: &'a PlannedParameter,
    /// Ratio of the last σ to that before the change.
    pub(super) change: Option<f64>,
    /// σ over the prior σ before the change.
    pub(super) ratio_before: Option<f64>,
}

impl<'a> PlannedRow<'a> {
    pub(super) fn all(shown: &ShownPrediction<'a>) -> Vec<Self> {
        let now = shown.now;
        let rows = now.motion.parameters.iter().enumerate();
        let of = |(index, motion): (usize, &'a PlannedParameter)| {
            let last = &now.result().parameters[index];
            let before = shown.before.and_then(|before| before.result().parameters.get(index));
            PlannedRow {
                prior: motion,
                flight: now.flight.as_ref().map(|table| &table.parameters[index]),
                motion,
                both: now.both.as_ref().map(|table| &table.parameters[index]),
                last,
                change: before.map(|before| last.sigma / before.sigma).filter(|change| change.is_finite()),
                ratio_before: before.map(|before| before.ratio),
            }
        };
        rows.map(of).collect()
    }

    pub(super) fn cell(&self, column: SigmaColumn, theme: &Theme) -> TextCell {
        let sigma = |parameter: Option<&PlannedParameter>, color: Color32| {
            let text = parameter.map_or_else(String::new, |it| Shown::of(it.dimension).sigma(it.sigma));
            (text, number_font(), color)
        };
        match column {
            SigmaColumn::Parameter => (self.last.name.clone(), label_font(), theme.text_strong),
            SigmaColumn::Prior => {
                let text = Shown::of(self.prior.dimension).sigma(self.prior.prior_sigma);
                (text, number_font(), theme.text_weak)
            }
            SigmaColumn::Flight => sigma(self.flight, theme.text),
            SigmaColumn::Motion if self.both.is_some() => sigma(Some(self.motion), theme.text),
            SigmaColumn::Motion => sigma(Some(self.motion), theme.text_strong),
            SigmaColumn::Both => sigma(self.both, theme.text_strong),
            SigmaColumn::Bar => (String::new(), label_font(), theme.text),
            SigmaColumn::Ratio => (fixed(self.last.ratio, 3), number_font(), theme.text_strong),
            SigmaColumn::Change => self.change.map_or_else(
                || (String::new(), number_font(), theme.text_weak),
                |change| (change_text(change), number_font(), change_color(change, theme)),
            ),
            SigmaColumn::Verdict => {
                let (mark, color) = look_of(self.last.verdict, theme);
                (format!("{mark} {}", self.last.verdict.name()), label_font(), color)
            }
        }
    }

    /// The row as one text, for a screen reader and the clipboard.
    pub(super) fn sentence(&self) -> String {
        let shown = Shown::of(self.last.dimension);
        let mut parts = vec![format!("{}: prior σ {}", self.last.name, shown.sigma(self.prior.prior_sigma))];
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

fn change_color(change: f64, theme: &Theme) -> Color32 {
    if change < 1.0 - NOTICED_CHANGE {
        theme.ok
    } else if change > 1.0 + NOTICED_CHANGE {
        theme.error
    } else {
        theme.text_weak
    }
}
