//! Ranks, deficits and null directions of the scenarios of docs/mathematics.md, section 7, in one table.

use std::fmt;

use rayon::prelude::*;
use serde::Serialize;

use super::experiments::{DegeneracyExperiment, MIN_FRAMES, SECTIONS};
use super::sensors::{SensorSurveySection, survey_sensors};
use super::spurious::{self, SpuriousRow};
use super::{LaboratoryForm, LaboratoryResult};
use crate::gimbal::{ParameterNames, Parameterization};
use crate::observability::Deficit;
use crate::table::text::{TextTable, left};
use crate::text::Named as _;

/// Number of frames for which a window is taken to have its largest rank.
const MAX_FRAMES: usize = 16;
const MINIMAL: LaboratoryForm = LaboratoryForm::whole(Parameterization::Minimal);

/// Computed ranks and null directions of the built-in experiments.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DegeneracySurvey {
    pub sections: Vec<SurveySection>,
    /// Smallest numbers of frames for which the minimal parameterization has its full rank.
    pub least_frames: Vec<MinFramesRow>,
    /// Experiments with columns of sensors.
    pub sensors: Vec<SensorSurveySection>,
    /// Spurious information of two windows linearized at different values of the calibration.
    pub spurious: Vec<SpuriousRow>,
}

/// Experiments on one subject.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SurveySection {
    pub title: String,
    pub rows: Vec<SurveyRow>,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SurveyRow {
    pub scenario: String,
    pub mechanism: String,
    pub motion: String,
    pub entries: Vec<SurveyEntry>,
    /// Rank deficit of the first parameterization, by cause.
    pub deficit: Option<Deficit>,
    /// Null directions of the first parameterization that are known in closed form.
    pub known: usize,
    /// Number of these that the computed Jacobian confirms.
    pub known_agreeing: usize,
    /// Parameters of the null directions of the minimal parameterization.
    pub null_of_minimal: Vec<String>,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SurveyEntry {
    pub form: String,
    /// Abbreviation in the table.
    pub column: String,
    pub columns: usize,
    pub rank: usize,
}

/// Smallest number of frames with full rank in the minimal parameterization.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct MinFramesRow {
    /// Knowledge of poses and joint angles.
    pub scenario: String,
    pub columns: usize,
    /// Largest structural rank over numbers of frames.
    pub rank: usize,
    /// Smallest number of frames with full rank.
    pub frames: usize,
}

/// Runs every built-in experiment: the scenarios of docs/mathematics.md, sections 7 and 11, and the cases of section 9.
pub fn survey() -> DegeneracySurvey {
    DegeneracySurvey {
        sections: SECTIONS
            .par_iter()
            .map(|section| SurveySection {
                title: section.title.to_owned(),
                rows: section.experiments.par_iter().filter_map(SurveyRow::of).collect(),
            })
            .collect(),
        least_frames: MIN_FRAMES.par_iter().filter_map(MinFramesRow::of).collect(),
        sensors: survey_sensors(),
        spurious: spurious::measure(),
    }
}

impl SurveyRow {
    fn of(experiment: &DegeneracyExperiment) -> Option<Self> {
        let results = experiment.setup()?.run_all(experiment.forms);
        if results.len() != experiment.forms.len() {
            return None;
        }
        let entries = results
            .iter()
            .map(|result| SurveyEntry {
                form: result.form.name(),
                column: abbreviation(result.form),
                columns: result.rank.parameters.len(),
                rank: result.rank.rank_structural,
            })
            .collect();
        let first = results.first();
        let minimal = results.iter().find(|result| result.form == MINIMAL);
        Some(Self {
            scenario: experiment.scenario.to_owned(),
            mechanism: experiment.mechanism.to_owned(),
            motion: experiment.motion.name().to_owned(),
            entries,
            deficit: first.map(|result| result.rank.deficit()),
            known: first.map_or(0, |result| result.rank.known.len()),
            known_agreeing: first.map_or(0, |result| result.rank.known_agreeing()),
            null_of_minimal: minimal
                .map_or_else(Vec::new, LaboratoryResult::null_parameters)
                .into_iter()
                .map(|parameter| ParameterNames::default().name(parameter))
                .collect(),
        })
    }
}

impl MinFramesRow {
    fn of(experiment: &DegeneracyExperiment) -> Option<Self> {
        let rank_of = |frames: usize| experiment.setup_of(frames)?.run(MINIMAL).map(|result| result.rank);
        let full = rank_of(MAX_FRAMES)?;
        let frames = (2..MAX_FRAMES)
            .find(|frames| rank_of(*frames).is_some_and(|rank| rank.rank_structural >= full.rank_structural))
            .unwrap_or(MAX_FRAMES);
        Some(Self {
            scenario: experiment.scenario.to_owned(),
            columns: full.parameters.len(),
            rank: full.rank_structural,
            frames,
        })
    }
}

/// `C`, `M`, …, as explained in the heading of the table.
fn abbreviation(form: LaboratoryForm) -> String {
    let name = match form.parameterization {
        Parameterization::Classical => "C",
        Parameterization::Minimal => "M",
        Parameterization::MinimalSwapped => "B",
        Parameterization::MinimalYx => "Mb",
        Parameterization::Poe => "P",
        other @ Parameterization::MinimalSwappedYx => other.name(),
    };
    let suffix = if form.joint_offsets { "" } else { "-" };
    format!("{name}{suffix}")
}

impl fmt::Display for DegeneracySurvey {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            out,
            "Structural rank / number of columns. C classical, M minimal, B minimal-swapped, Mb minimal-yx, P poe, - without joint\n\
             offsets. Deficit of the first: G parameterization, F stationary joints, E free joint angles, M motion;\n\
             = number of its closed-form null directions that the computed Jacobian confirms."
        )?;
        for section in &self.sections {
            let columns = [42, 46, 12, 7, 0].map(|width| left("", width));
            let rows = section.rows.iter().map(SurveyRow::texts);
            write!(out, "\n{}\n{}", section.title, TextTable::new(columns, rows))?;
        }
        writeln!(out, "\nSmallest number of frames for full rank, minimal parameterization (three joints, generic)")?;
        let rows = self.least_frames.iter().map(|row| {
            let MinFramesRow { scenario, columns, rank, frames } = row;
            [scenario.clone(), format!("M {rank}/{columns} from {frames} frames")]
        });
        write!(out, "{}", TextTable::new([left("", 42), left("", 0)], rows))?;
        writeln!(
            out,
            "\nStructural rank of the chain, null directions that sensor columns add to its own (timeshift: camera and encoders;\n\
             IMU: scale and misalignment of both sensors, rotation between them), and the sensor columns that take part."
        )?;
        for section in &self.sensors {
            write!(out, "\n{section}")?;
        }
        writeln!(out, "\n{}", spurious::title())?;
        for row in &self.spurious {
            writeln!(out, "{row}")?;
        }
        Ok(())
    }
}

impl SurveyRow {
    fn texts(&self) -> [String; 5] {
        let ranks: Vec<String> =
            self.entries.iter().map(|entry| format!("{} {}/{}", entry.column, entry.rank, entry.columns)).collect();
        let deficit = self.deficit.as_ref().map_or_else(String::new, Deficit::short);
        let known = if self.known == 0 { String::new() } else { format!("= {}/{}", self.known_agreeing, self.known) };
        let null = if self.null_of_minimal.is_empty() {
            String::new()
        } else {
            format!("  null of M: {}", short_list(&self.null_of_minimal))
        };
        [self.scenario.clone(), ranks.join("  "), deficit, known, null]
    }
}

/// Names separated by spaces; a long list is shortened to the first names and the number of the others.
fn short_list(names: &[String]) -> String {
    const SHOWN: usize = 6;
    let shown = names.iter().take(SHOWN).map(String::as_str).collect::<Vec<_>>().join(" ");
    if names.len() > SHOWN { format!("{shown} and {} more", names.len() - SHOWN) } else { shown }
}

impl Deficit {
    /// Deficits as text, `G6 F4`, or `-` at full rank.
    pub(super) fn short(&self) -> String {
        let parts = [("G", self.parameterization), ("F", self.joints), ("E", self.absorbed), ("M", self.motion)];
        let lost: Vec<String> =
            parts.iter().filter(|(_, count)| *count > 0).map(|(name, count)| format!("{name}{count}")).collect();
        if lost.is_empty() { "-".to_owned() } else { lost.join(" ") }
    }
}
