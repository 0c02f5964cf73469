//! Plans of moves with words, chosen one after the other.

use std::fmt;

use nalgebra::DMatrix;
use rayon::prelude::*;
use serde::Serialize;

use super::super::Situation;
use super::moves::{HandMove, combined};
use super::objective::Objective;
use super::summary::{PlanTable, SigmaRow};
use super::windows::WindowLayout;

/// Moves for a person, with the predicted σ after each.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HandPlan {
    pub steps: Vec<HandStep>,
    /// Parameters at the end.
    #[serde(flatten)]
    pub table: PlanTable,
    /// σ at the start and after each step.
    #[serde(skip)]
    pub sigmas: Vec<SigmaRow>,
}

/// One move, which starts and ends with the joints at their middle angles.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HandStep {
    pub words: String,
    pub duration_s: f64,
    /// Criterion after the step; 1 before the first.
    pub value: f64,
    /// Least determined parameter after the step.
    pub worst: String,
    /// Its ratio of σ to the prior's σ.
    pub worst_ratio: f64,
}

/// A step with the information of all steps so far.
#[derive(Clone, Debug)]
pub(super) struct ChosenMove {
    pub(super) choice: HandMove,
    pub(super) information: DMatrix<f64>,
}

/// Chooses the move of each window that lowers the criterion most after those before; every move starts from rest.
pub(super) fn choose(situation: &Situation, objective: &Objective, layout: &WindowLayout) -> Vec<ChosenMove> {
    let times_s = layout.times_s(0);
    let moves: Vec<(HandMove, DMatrix<f64>)> = combined(situation)
        .par_iter()
        .filter_map(|choice| Some((*choice, choice.information(situation, &times_s)?)))
        .collect();
    let columns = situation.information.ncols();
    let mut chosen: Vec<ChosenMove> = Vec::new();
    for _ in 0..layout.count {
        let before = chosen.last().map_or_else(|| DMatrix::zeros(columns, columns), |last| last.information.clone());
        let value = |gained: &DMatrix<f64>| objective.search_value(&(&before + gained)).unwrap_or(f64::INFINITY);
        let values: Vec<f64> = moves.iter().map(|(_, gained)| value(gained)).collect();
        // The first of equal moves.
        let best = (0..moves.len()).min_by(|a, b| values[*a].total_cmp(&values[*b]));
        let Some(best) = best.filter(|best| values[*best].is_finite()) else { break };
        chosen.push(ChosenMove { choice: moves[best].0, information: before + &moves[best].1 });
    }
    chosen
}

impl HandPlan {
    pub(super) fn new(situation: &Situation, objective: &Objective, layout: &WindowLayout) -> Option<Self> {
        let chosen = choose(situation, objective, layout);
        let mut steps = Vec::new();
        let columns = situation.information.ncols();
        let start = PlanTable::new(situation, objective, &DMatrix::zeros(columns, columns))?;
        let mut sigmas = vec![SigmaRow::new(0.0, &start)];
        for (index, step) in chosen.iter().enumerate() {
            let table = PlanTable::new(situation, objective, &step.information)?;
            steps.push(HandStep {
                words: step.choice.words(situation),
                duration_s: layout.length_s,
                value: objective.value(&step.information)?,
                worst: table.worst.clone(),
                worst_ratio: table.worst_ratio,
            });
            sigmas.push(SigmaRow::new((index + 1) as f64 * layout.length_s, &table));
        }
        let table = PlanTable::new(situation, objective, &chosen.last()?.information)?;
        Some(Self { steps, table, sigmas })
    }
}

impl fmt::Display for HandPlan {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(out, "moves by hand, each from the middle of the joints' ranges, with the predicted σ after it")?;
        for (index, step) in self.steps.iter().enumerate() {
            writeln!(
                out,
                "  {}. {}, {:.0} s\n     → largest σ/prior {:.3} ({})",
                index + 1,
                step.words,
                step.duration_s,
                step.worst_ratio,
                step.worst
            )?;
        }
        write!(out, "{}", self.table)
    }
}
