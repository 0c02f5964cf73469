//! Rows of the survey with columns of sensors.

use std::fmt;

use rayon::prelude::*;
use serde::Serialize;

use super::LaboratoryForm;
use super::experiments::{SECTIONS, SensorExperiment};
use super::table::{SetRank, set_ranks};
use crate::gimbal::{ParameterGroup, ParameterNames, Parameterization};
use crate::observability::laboratory::SensorColumns;
use crate::table::text::{TextTable, left};
use crate::text::Named as _;

/// Experiments with columns of sensors under one heading.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SensorSurveySection {
    pub title: String,
    pub rows: Vec<SensorSurveyRow>,
}

/// Ranks of one experiment for each set of columns, in the minimal parameterization.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SensorSurveyRow {
    pub motion: String,
    /// Sets of columns, the chain alone first.
    pub sets: Vec<SensorSurveyEntry>,
    /// Reason that sensor columns are unobservable; empty if all are observable.
    pub cause: String,
    /// Sensor parameters in the null directions of all columns together.
    pub lost: Vec<String>,
}

/// Rank of one set of columns.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SensorSurveyEntry {
    pub columns: String,
    /// Number of columns, including the columns of the chain.
    pub count: usize,
    pub rank: usize,
    /// Number of null directions that the chain alone does not have.
    pub added: usize,
}

/// Sets of the table with their headings.
const SETS: [(&str, SensorColumns); 7] = [
    ("chain", SensorColumns::NONE),
    ("readout", SensorColumns { readout: true, ..SensorColumns::NONE }),
    ("timeshift", SensorColumns { timeshift: true, ..SensorColumns::NONE }),
    ("both times", SensorColumns { readout: true, timeshift: true, ..SensorColumns::NONE }),
    ("intrinsics", SensorColumns { intrinsics: true, ..SensorColumns::NONE }),
    ("IMU", SensorColumns { imu_intrinsics: true, ..SensorColumns::NONE }),
    ("all", SensorColumns::ALL),
];
/// Smallest scaled weight of a parameter that belongs to a null direction.
const TAKES_PART: f64 = 0.02;

/// Runs every experiment with columns of sensors.
pub(in crate::observability::laboratory) fn survey_sensors() -> Vec<SensorSurveySection> {
    SECTIONS
        .par_iter()
        .map(|section| SensorSurveySection {
            title: section.title.to_owned(),
            rows: section.experiments.par_iter().filter_map(SensorSurveyRow::of).collect(),
        })
        .collect()
}

impl SensorSurveyRow {
    fn of(experiment: &SensorExperiment) -> Option<Self> {
        let sets = SETS.map(|(_, columns)| columns);
        let form = LaboratoryForm::whole(Parameterization::Minimal);
        let ranks = set_ranks(&experiment.setup()?, form, &sets)?;
        let chain = ranks.first().map_or(0, SetRank::deficit);
        Some(Self {
            motion: experiment.motion.name().to_owned(),
            cause: experiment.cause.to_owned(),
            lost: ranks.last().map_or_else(Vec::new, lost),
            sets: ranks
                .iter()
                .map(|rank| SensorSurveyEntry {
                    columns: rank.columns.to_string(),
                    count: rank.parameters.len(),
                    rank: rank.rank,
                    added: rank.deficit().saturating_sub(chain),
                })
                .collect(),
        })
    }
}

/// Names of the sensor parameters that belong to null directions.
fn lost(rank: &SetRank) -> Vec<String> {
    let takes_part = |column: usize| rank.null.iter().any(|direction| direction.weights[column].abs() > TAKES_PART);
    let names = ParameterNames::default();
    let parameters = rank.parameters.iter().enumerate();
    let sensors = parameters.filter(|(_, parameter)| parameter.group() != ParameterGroup::Chain);
    sensors.filter(|(column, _)| takes_part(*column)).map(|(_, parameter)| names.name(*parameter)).collect()
}

/// Names of columns; names of one sensor are grouped after its name: `gyroscope.sx sy, readout`.
fn grouped(names: &[String]) -> String {
    let mut text = String::new();
    let mut last = "";
    for name in names {
        let (part, quantity) = name.split_once('.').unwrap_or(("", name));
        if !text.is_empty() {
            text.push_str(if part == last && !part.is_empty() { " " } else { ", " });
        }
        text.push_str(if part == last && !part.is_empty() { quantity } else { name });
        last = part;
    }
    text
}

impl fmt::Display for SensorSurveySection {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(out, "{} (minimal parameterization)", self.title)?;
        let sets = SETS[1..].iter().map(|(heading, _)| left(*heading, 11));
        let columns = [left("", 28), left("chain", 9)].into_iter().chain(sets).chain([left("", 0)]);
        let mut rows = Vec::new();
        for row in &self.rows {
            let Some((chain, sensors)) = row.sets.split_first() else { continue };
            let mut cells = vec![row.motion.clone(), format!("{}/{}", chain.rank, chain.count)];
            cells.extend(sensors.iter().map(|set| format!("+{}", set.added)));
            cells.push(grouped(&row.lost));
            rows.push(cells);
            if !row.cause.is_empty() {
                rows.push(vec![String::new(), row.cause.clone()]);
            }
        }
        write!(out, "{}", TextTable::new(columns, rows))
    }
}
