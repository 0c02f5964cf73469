//! `calibration.json` and the printed report of `dcvins calibrate --stills`.

use std::fmt::{self, Formatter};

use serde::Serialize;

use crate::calibration::stills::{
    AngleKnowledge, AngleModel, EncoderErrorKind, EncoderTest, PixelStatistics, ScoredChain, SetReport, StillsOutcome,
    StillsParameter,
};
use crate::geometry::Dimension;
use crate::table::text::{TextTable, left, right};
use crate::text::counted;

/// Correlation from which a pair of parameters is printed.
const MIN_CORRELATION: f64 = 0.9;
/// Largest number of printed pairs.
const MAX_PAIRS: usize = 6;

/// Content of the file `calibration.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StillsReport {
    /// File name of the stills.
    pub stills: String,
    /// File name of a chain that was judged instead of a calibration.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub judged: Option<String>,
    /// Ids of the sets that were not used.
    pub without: Vec<u64>,
    #[serde(flatten)]
    pub outcome: StillsOutcome,
}

impl fmt::Display for StillsReport {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.answer(f)?;
        for warning in &self.outcome.warnings {
            writeln!(f, "  warning: {warning}")?;
        }
        self.errors(f)?;
        if self.outcome.tables.is_empty() {
            return Ok(());
        }
        self.parameters(f)?;
        self.ranks(f)?;
        self.encoders(f)?;
        self.correlations(f)
    }
}

impl StillsReport {
    /// Result in a few lines: error in pixels, encoders, axes, wrong readings.
    fn answer(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let outcome = &self.outcome;
        let what = match (&self.judged, outcome.angles) {
            (Some(chain), _) => format!("chain of {chain} judged"),
            (None, Some(AngleModel::Free)) => "chain calibrated with free joint angles".to_owned(),
            (None, _) => "chain calibrated".to_owned(),
        };
        writeln!(
            f,
            "{}: {what}, {} at {}",
            self.stills,
            counted(outcome.sets.len(), "set"),
            counted(outcome.stations, "station")
        )?;
        let mean =
            |score: Option<PixelStatistics>| score.map_or_else(|| "–".to_owned(), |it| format!("{:.2} px", it.mean_px));
        for floor in outcome.floors.iter().skip(1) {
            let score = |chain| outcome.score(chain, &floor.camera);
            let as_read = |chain| mean(score(chain).and_then(|it| it.as_read));
            let estimated = |chain| mean(score(chain).and_then(|it| it.estimated));
            let text = if self.judged.is_some() {
                let given = ScoredChain::Given;
                format!("{} with the angles as read, {} with estimated angles", as_read(given), estimated(given))
            } else {
                let (held, training) = (ScoredChain::HoldOut, ScoredChain::Training);
                format!(
                    "{} on sets left out with the angles as read ({} on all), {} with estimated angles",
                    as_read(held),
                    as_read(training),
                    estimated(held)
                )
            };
            writeln!(f, "  {:<14} {text}; floor {:.2} px", floor.camera, floor.floor.mean_px)?;
        }
        let encoders = outcome.joints.iter().zip(&outcome.noise.encoder_rad);
        let encoders: Vec<String> =
            encoders.map(|(joint, sigma)| format!("{joint} {:.2}°", sigma.to_degrees())).collect();
        match outcome.angles {
            Some(AngleModel::Encoder) => writeln!(f, "  encoder σ      {}", encoders.join(", "))?,
            Some(AngleModel::Free) => writeln!(
                f,
                "  encoder σ      not used, every angle is free; by the encoder model {}",
                encoders.join(", ")
            )?,
            None => {
                let rms = outcome.joints.iter().enumerate();
                let rms: Vec<String> =
                    rms.map(|(index, joint)| format!("{joint} {:.2}°", outcome.rms_correction_deg(index))).collect();
                writeln!(f, "  corrections    {} rms, estimated angle − reading", rms.join(", "))?;
            }
        }
        let axes: Vec<String> = outcome
            .axes
            .iter()
            .map(|axis| {
                let sigma =
                    if axis.sigma_deg.is_finite() { format!(" ± {:.2}°", axis.sigma_deg) } else { String::new() };
                format!(
                    "{}–{} {:.2}°{sigma} (initial {:.1}°)",
                    axis.joints[0], axis.joints[1], axis.value_deg, axis.initial_deg
                )
            })
            .collect();
        if !axes.is_empty() {
            writeln!(f, "  between axes   {}", axes.join(", "))?;
        }
        let wrong: Vec<String> = outcome.sets.iter().filter(|set| set.wrong).map(|set| self.wrong(set)).collect();
        if !wrong.is_empty() {
            writeln!(f, "  wrong readings {}", wrong.join(", "))?;
        }
        Ok(())
    }

    fn wrong(&self, set: &SetReport) -> String {
        let largest = self.outcome.largest_correction_deg(set);
        // The reading is wrong by the opposite of its correction.
        let error = largest.map_or_else(String::new, |(joint, deg)| format!(" ({joint} off by {:.1}°)", -deg));
        format!("set {}{error}", set.id)
    }

    fn errors(&self, f: &mut Formatter<'_>) -> fmt::Result {
        writeln!(f, "\nerrors in px, mean ± standard deviation over the sets")?;
        let columns = [
            left("camera", 13),
            left("chain", 10),
            right("angles as read", 19),
            right("estimated¹", 19),
            right("as read, all sets", 21),
        ];
        let cell = |score: Option<PixelStatistics>| {
            score.map_or_else(|| "–".to_owned(), |it| format!("{:.4} ± {:.4}", it.mean_px, it.std_px))
        };
        let mut rows = Vec::new();
        for floor in &self.outcome.floors {
            rows.push(vec![floor.camera.clone(), "floor".to_owned(), cell(Some(floor.floor))]);
            if floor.points_left_out > 0 {
                rows.push(vec![String::new(), format!("{} left out", counted(floor.points_left_out, "point"))]);
            }
            let scores = self.outcome.scores.iter().filter(|score| score.camera == floor.camera);
            rows.extend(scores.map(|score| {
                let [as_read, estimated, all] = [score.as_read, score.estimated, score.as_read_all].map(cell);
                vec![String::new(), score.chain.name().to_owned(), as_read, estimated, all]
            }));
        }
        write!(f, "{}", TextTable::new(columns, rows))?;
        writeln!(f, "  ¹ from half of the points of the rigid cameras, evaluated on the other half")
    }

    fn parameters(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Some(table) = self.outcome.tables.first() else { return Ok(()) };
        writeln!(
            f,
            "\nparameters ({}; σ is the larger of formal and jackknife over stations; others: parameters.csv)",
            table.parameterization
        )?;
        let columns = [left("", 26), right("initial", 13), right("value", 13), right("± σ", 11), left("  unit", 0)];
        let rows = table.parameters.iter().chain(&self.outcome.rigid).map(|parameter| {
            let (factor, unit, digits) = shown_unit(parameter);
            let [initial, value, sigma] = [parameter.initial, parameter.value, parameter.sigma]
                .map(|value| format!("{:.digits$}", value * factor));
            [parameter.name.clone(), initial, value, sigma, format!("  {unit}")]
        });
        write!(f, "{}", TextTable::new(columns, rows))?;
        let noise = &self.outcome.noise;
        writeln!(
            f,
            "  map errors: rigid cameras {:.2}° and {:.1} mm per station, gimbal camera {:.1} mm per set",
            noise.station_rotation_rad.to_degrees(),
            noise.station_position_m * 1e3,
            noise.set_position_m * 1e3
        )
    }

    fn ranks(&self, f: &mut Formatter<'_>) -> fmt::Result {
        writeln!(f, "\nrank of the chain: structural, of them informed (σ below 10° and 3 cm), of the columns")?;
        let mut names: Vec<&str> = self.outcome.ranks.iter().map(|rank| rank.parameterization).collect();
        names.dedup();
        let rows = names.into_iter().map(|name| {
            let cell = |angles: AngleKnowledge| {
                let found =
                    self.outcome.ranks.iter().find(|rank| rank.parameterization == name && rank.angles == angles);
                found.map_or_else(
                    || "–".to_owned(),
                    |it| format!("{}, {} of {}", it.rank_structural, it.rank_informed, it.columns),
                )
            };
            let cells = [AngleKnowledge::Known, AngleKnowledge::Encoder, AngleKnowledge::Free].map(cell);
            [name.to_owned()].into_iter().chain(cells)
        });
        let columns = [left("", 20), right("angles known", 19), right("encoder", 19), right("angles free", 19)];
        write!(f, "{}", TextTable::new(columns, rows))?;
        let reported = self.outcome.ranks.iter().filter(|rank| rank.parameterization == self.outcome.parameterization);
        for rank in reported.filter(|rank| !rank.null_directions.is_empty()) {
            writeln!(f, "  null with {} angles: {}", rank.angles.name(), rank.null_directions.join("; "))?;
        }
        Ok(())
    }

    fn encoders(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let tests = &self.outcome.encoder_tests;
        if tests.is_empty() {
            return Ok(());
        }
        let significant: Vec<&EncoderTest> = tests.iter().filter(|test| test.significant).collect();
        if significant.is_empty() {
            return writeln!(
                f,
                "\nencoders: no scale, first harmonic or drift is significant ({}, F test at 1 % over all)",
                counted(tests.len(), "test")
            );
        }
        writeln!(f, "\nencoders ({}, F test at 1 % over all)", counted(tests.len(), "test"))?;
        for test in significant {
            writeln!(
                f,
                "  {}: {}; σ {:.2}° → {:.2}° (F {:.1}, p {:.1e})",
                test.joint,
                finding(test),
                test.encoder_sigma_deg[1],
                test.encoder_sigma_deg[0],
                test.f,
                test.probability
            )?;
        }
        Ok(())
    }

    fn correlations(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let pairs = self.outcome.correlations.pairs_above(MIN_CORRELATION);
        let pairs: Vec<String> =
            pairs.iter().take(MAX_PAIRS).map(|(a, b, value)| format!("{a} with {b} {value:+.2}")).collect();
        if pairs.is_empty() {
            return writeln!(f, "\ncorrelations: none above {MIN_CORRELATION}");
        }
        writeln!(f, "\ncorrelations above {MIN_CORRELATION}: {}", pairs.join(", "))
    }
}

/// Factor, symbol and digits with which a parameter is printed.
fn shown_unit(parameter: &StillsParameter) -> (f64, &'static str, usize) {
    match parameter.dimension {
        Dimension::Angle => (1.0_f64.to_degrees(), "°", 3),
        Dimension::Length => (1e3, "mm", 2),
        other => (1.0, other.unit(), 4),
    }
}

/// A systematic error of an encoder with its values.
fn finding(test: &EncoderTest) -> String {
    let degrees = |[value, sigma]: [f64; 2]| format!("{:+.2}° ± {:.2}°", value.to_degrees(), sigma.to_degrees());
    let coefficient = |index: usize| test.coefficients.get(index).copied().unwrap_or([f64::NAN; 2]);
    match test.kind {
        EncoderErrorKind::Scale => {
            let [value, sigma] = coefficient(0);
            format!("angle = reading + ({:+.2} ± {:.2}) % of it", 100.0 * value, 100.0 * sigma)
        }
        EncoderErrorKind::Harmonic => {
            format!("first harmonic {} sin, {} cos", degrees(coefficient(0)), degrees(coefficient(1)))
        }
        EncoderErrorKind::Drift => format!("drift {} from the first to the last set", degrees(coefficient(0))),
    }
}
