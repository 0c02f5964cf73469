//! Plans of moves with words, chosen one after the other.

use std::fmt;

use nalgebra::DMatrix;
use rayon::prelude::*;
use serde::Serialize;

use super::admitted::with_two_joints;
use super::moves::HandMove;
use super::search::SearchProblem;
use super::starts;
use super::summary::{PlanTable, SigmaRow};
use super::windows::{WindowRows, joined, rows_of_window, trajectory};
use crate::simulation::MotionSplines;

/// Moves for a person, with the predicted σ after each.
#[derive(Clone, Debug, Serialize)]
pub struct HandPlan {
    pub steps: Vec<HandStep>,
    /// Parameters at the end.
    #[serde(flatten)]
    pub table: PlanTable,
    /// σ at the start and after each step.
    #[serde(skip)]
    pub sigmas: Vec<SigmaRow>,
    #[serde(skip)]
    pub motion: MotionSplines,
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

/// Chooses the move of each window that lowers the criterion most after those before; every move starts and ends at rest.
/// After the first move whose information `is_enough`, no further one is chosen.
pub(super) fn choose(
    problem: &SearchProblem<'_>,
    duration_s: f64,
    is_enough: &dyn Fn(&DMatrix<f64>) -> bool,
) -> Vec<HandMove> {
    let &SearchProblem { situation, objective, ref layout, .. } = problem;
    let columns = situation.information.ncols();
    let candidates = with_two_joints(problem, layout.length_s);
    let mut chosen: Vec<HandMove> = Vec::new();
    let mut windows: Vec<WindowRows> = Vec::new();
    for window in 0..layout.count {
        let evaluated = candidates.par_iter().map(|candidate| {
            let motion = starts::as_described(problem, duration_s, &[chosen.as_slice(), &[*candidate]].concat());
            let flight = trajectory(situation, &motion);
            let rows = rows_of_window(situation, &motion, &flight, layout, window)?;
            let value = objective.search_value(&joined(windows.iter().chain([&rows]), columns))?;
            Some((value, *candidate, rows))
        });
        let evaluated: Vec<(f64, HandMove, WindowRows)> = evaluated.flatten().collect();
        // The first of equal moves.
        let Some((_, best, rows)) = evaluated.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)) else { break };
        chosen.push(best);
        windows.push(rows);
        if is_enough(&joined(&windows, columns)) {
            break;
        }
    }
    chosen
}

impl HandPlan {
    /// Plan of given moves, one for each window; `None` when a number is not finite.
    pub(super) fn of_moves(problem: &SearchProblem<'_>, duration_s: f64, moves: &[HandMove]) -> Option<Self> {
        let &SearchProblem { situation, objective, ref layout, .. } = problem;
        let flown = problem.evaluate(starts::as_described(problem, duration_s, moves))?;
        let mut steps = Vec::new();
        let columns = situation.information.ncols();
        let start = PlanTable::new(situation, objective, &DMatrix::zeros(columns, columns))?;
        let mut sigmas = vec![SigmaRow::new(0.0, &start)];
        let mut last = None;
        for (index, step) in moves.iter().enumerate() {
            let gained = problem.total(&flown.windows[..=index]);
            let table = PlanTable::new(situation, objective, &gained)?;
            steps.push(HandStep {
                words: step.words(situation),
                duration_s: layout.length_s,
                value: objective.value(&gained)?,
                worst: table.worst.clone(),
                worst_ratio: table.worst_ratio,
            });
            sigmas.push(SigmaRow::new((index + 1) as f64 * layout.length_s, &table));
            last = Some(table);
        }
        Some(Self { steps, table: last?, sigmas, motion: flown.motion })
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
