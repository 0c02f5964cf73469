//! Predicted σ of the calibration parameters as tables.

use std::fmt;

use nalgebra::DMatrix;
use serde::Serialize;

use super::super::Situation;
use super::objective::Objective;
use crate::geometry::Dimension;
use crate::observability::Determination;
use crate::table::text::{TextTable, left, right};
use crate::text::Named as _;

/// Prior and predicted σ of one parameter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlannedParameter {
    pub name: String,
    #[serde(rename = "unit")]
    pub dimension: Dimension,
    /// σ before the motion, within the directions that some motion makes observable.
    pub prior_sigma: f64,
    /// Predicted σ after the motion.
    pub sigma: f64,
    /// `sigma` over `prior_sigma`.
    pub ratio: f64,
    /// Required accuracy.
    pub required: f64,
    /// Verdict on the parameter after the motion.
    pub verdict: Determination,
    /// True if the criterion contains it.
    pub matters: bool,
}

/// Predicted σ of all parameters after a motion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlanTable {
    pub parameters: Vec<PlannedParameter>,
    /// Least determined parameter of the criterion.
    pub worst: String,
    pub worst_ratio: f64,
    /// Mean ratio of the parameters of the criterion.
    pub mean_ratio: f64,
}

/// Predicted σ of all parameters at one time of a motion.
#[derive(Clone, Debug, PartialEq)]
pub struct SigmaRow {
    pub time_s: f64,
    /// σ and σ/prior of each parameter.
    pub sigmas: Vec<(f64, f64)>,
}

impl PlanTable {
    /// Table after this much information; `None` when a number is not finite.
    pub(super) fn new(situation: &Situation, objective: &Objective, gained: &DMatrix<f64>) -> Option<Self> {
        let (prior, after) = objective.sigmas(gained)?;
        let alone = objective.sigmas_without_prior(gained)?;
        let scale = situation.scale();
        let parameters: Vec<PlannedParameter> = situation
            .chain
            .parameters()
            .into_iter()
            .enumerate()
            .map(|(column, parameter)| {
                let [prior, after, alone] = [prior[column], after[column], alone[column]];
                let (sigma, required) = (after * scale[column], situation.required.of(parameter));
                PlannedParameter {
                    name: situation.names.name(parameter),
                    dimension: parameter.dimension(),
                    prior_sigma: prior * scale[column],
                    sigma,
                    ratio: if prior > 0.0 { after / prior } else { 1.0 },
                    required,
                    verdict: Determination::of(sigma, alone * scale[column], required, objective.is_redundant(column)),
                    matters: objective.is_chosen(column),
                }
            })
            .collect();
        let matters: Vec<&PlannedParameter> = parameters.iter().filter(|parameter| parameter.matters).collect();
        let worst = matters.iter().max_by(|a, b| a.ratio.total_cmp(&b.ratio))?;
        Some(Self {
            worst: worst.name.clone(),
            worst_ratio: worst.ratio,
            mean_ratio: matters.iter().map(|parameter| parameter.ratio).sum::<f64>() / matters.len() as f64,
            parameters,
        })
    }
}

impl SigmaRow {
    pub(super) fn new(time_s: f64, table: &PlanTable) -> Self {
        Self { time_s, sigmas: table.parameters.iter().map(|parameter| (parameter.sigma, parameter.ratio)).collect() }
    }
}

impl fmt::Display for PlanTable {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let columns = [left("", 16), right("prior", 12), right("after", 12), right("ratio", 10), left("", 0)];
        let rows = self.parameters.iter().map(|parameter| {
            let (factor, unit) = match parameter.dimension {
                Dimension::Angle => (1_f64.to_degrees(), "°"),
                _ => (1e3, " mm"),
            };
            let [prior, after] =
                [parameter.prior_sigma, parameter.sigma].map(|sigma| format!("{:.3}{unit}", sigma * factor));
            let note = if parameter.matters { "" } else { ", not in the criterion" };
            let verdict = format!("  {}{note}", parameter.verdict.name());
            [parameter.name.clone(), prior, after, format!("{:.3}", parameter.ratio), verdict]
        });
        write!(out, "predicted σ at the end\n{}", TextTable::new(columns, rows))?;
        writeln!(out, "largest σ/prior {:.3} ({}), mean {:.3}", self.worst_ratio, self.worst, self.mean_ratio)
    }
}
