//! One motion after which all parameters are as accurate as required.

use nalgebra::DMatrix;

use super::super::{ADVICE_DURATION_S, Situation};
use super::by_hand::{HandPlan, choose};
use super::limits::MotionLimits;
use super::objective::PlanCriterion;
use super::plan::{PLAN_DURATION_S, objective_and_windows};
use super::search::SearchProblem;
use super::windows::WindowLayout;
use crate::gimbal::ParameterId;
use crate::simulation::MotionSplines;

/// Longest motion that is asked of a person, in seconds.
pub const LONGEST_MOTION_S: f64 = 10.0 * ADVICE_DURATION_S;
/// Longest motion that is asked for while a flight goes on, in seconds: it is found in a third of the time.
pub const NEXT_MOTION_S: f64 = 3.0 * ADVICE_DURATION_S;
/// Ratio of σ and required accuracy at which no further move is chosen: the last move loses a little because it ends at
/// rest.
const ENOUGH: f64 = 0.95;

/// Moves by hand, one after the other, until all parameters reach the required accuracy.
#[derive(Clone, Debug, PartialEq)]
pub struct SufficientMotion {
    /// Moves with their durations in seconds; equal ones that follow each other are one.
    pub moves: Vec<(String, f64)>,
    pub motion: MotionSplines,
    /// Parameter with the largest ratio of σ and required accuracy after the longest motion, with its predicted σ; `None`
    /// if all reach the requirement.
    pub remaining: Option<(ParameterId, f64)>,
}

/// Shortest sequence of moves within the limits that brings all parameters of a situation to the required accuracy, or the
/// best one of `longest_s`; each move is the one that lowers the largest ratio of σ and required accuracy most after those before.
///
/// `None` if all parameters reach it already, or if no motion makes any of them observable.
pub fn sufficient_motion(situation: &Situation, limits: &MotionLimits, longest_s: f64) -> Option<SufficientMotion> {
    let (objective, layout) = objective_and_windows(situation, longest_s, PlanCriterion::Required, &[]).ok()?;
    let columns = situation.information.ncols();
    let is_within = |gained: &DMatrix<f64>, limit: f64| objective.value(gained).is_some_and(|ratio| ratio <= limit);
    if is_within(&DMatrix::zeros(columns, columns), 1.0) {
        return None;
    }
    let problem = SearchProblem { situation, objective: &objective, limits, layout };
    let moves = choose(&problem, longest_s, &|gained| is_within(gained, ENOUGH));
    let duration_s = (moves.len() as f64 * layout.length_s).max(PLAN_DURATION_S[0]);
    let problem = SearchProblem { layout: WindowLayout::fine(duration_s), ..problem };
    let plan = HandPlan::of_moves(&problem, duration_s, &moves)?;
    let of_required = |(_, row): &(ParameterId, &super::PlannedParameter)| row.sigma / row.required;
    let improvable = situation.chain.parameters().into_iter().zip(&plan.table.parameters);
    let remaining = improvable
        .filter(|(_, row)| row.verdict.is_improvable())
        .max_by(|a, b| of_required(a).total_cmp(&of_required(b)))
        .map(|(parameter, row)| (parameter, row.sigma));
    let mut merged: Vec<(String, f64)> = Vec::new();
    for step in plan.steps {
        match merged.last_mut() {
            Some((words, duration_s)) if *words == step.words => *duration_s += step.duration_s,
            _ => merged.push((step.words, step.duration_s)),
        }
    }
    Some(SufficientMotion { moves: merged, motion: plan.motion, remaining })
}

impl SufficientMotion {
    pub fn duration_s(&self) -> f64 {
        self.motion.duration_s()
    }
}
