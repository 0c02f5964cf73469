//! Levenberg–Marquardt on the window, the landmarks eliminated.

use nalgebra::{DMatrix, DVector};

use super::problem::{Costs, Estimate, Problem};
use crate::estimator::IterationReport;
use crate::estimator::factors::dense::Cholesky;

/// Limits of a solve.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SolverLimits {
    /// Most steps tried, taken or not.
    pub(crate) iterations: usize,
    /// Ends when a step lowers the cost by less than this share.
    pub(crate) relative_cost_tolerance: f64,
}

/// What a solve left behind.
#[derive(Clone, Debug)]
pub(crate) struct Solution {
    pub(crate) estimate: Estimate,
    pub(crate) costs_before: Costs,
    pub(crate) costs_after: Costs,
    pub(crate) iterations: Vec<IterationReport>,
    /// Covariance of the calibration at the last linearization, the rest marginalized; empty without calibration.
    pub(crate) calibration_covariance: DMatrix<f64>,
}

impl Solution {
    /// Posterior standard deviations of the calibration's columns, empty without calibration.
    pub(crate) fn calibration_sigmas(&self) -> Vec<f64> {
        let variances = self.calibration_covariance.diagonal();
        variances.iter().map(|variance| variance.max(0.0).sqrt()).collect()
    }
}

const FIRST_DAMPING: f64 = 1e-6;
const LEAST_DAMPING: f64 = 1e-9;
const MOST_DAMPING: f64 = 1e8;
/// Added to the diagonal so that an unknown without any factor stays where it is.
const FLOOR: f64 = 1e-6;

/// Lowers the cost from `start`.
pub(crate) fn solve(problem: &Problem<'_>, start: Estimate, limits: SolverLimits) -> Solution {
    let costs_before = problem.costs(&start);
    let mut solution = Solution {
        estimate: start,
        costs_before,
        costs_after: costs_before,
        iterations: Vec::new(),
        calibration_covariance: DMatrix::zeros(0, 0),
    };
    let held: Vec<usize> = {
        let start = problem.layout.calibration().start;
        solution.estimate.calibration.frozen_columns().into_iter().map(|column| start + column).collect()
    };
    let mut damping = FIRST_DAMPING;
    let mut tries = 0;
    while tries < limits.iterations {
        let equations = problem.linearize(&solution.estimate);
        let mut done = true;
        while tries < limits.iterations {
            tries += 1;
            let reduced = equations.eliminate(damping);
            let (mut hessian, mut gradient) = equations.reduced(&problem.layout, &reduced);
            hold(&held, &mut hessian, &mut gradient);
            let Some(factor) = Cholesky::new(&damped(&hessian, damping)) else {
                damping = (damping * 100.0).min(MOST_DAMPING);
                continue;
            };
            let step = -factor.solve(&gradient);
            let landmarks = equations.landmark_steps(&problem.layout, &reduced, &step);
            let candidate = problem.stepped(&solution.estimate, &step, &landmarks);
            let costs = problem.costs(&candidate);
            let before = solution.costs_after.total();
            let after = costs.total();
            let accepted = after.is_finite() && after <= before;
            solution.iterations.push(IterationReport {
                cost_before: before,
                cost_after: after,
                damping,
                step_norm: step.norm(),
                accepted,
            });
            solution.calibration_covariance = factor.trailing_covariance(problem.layout.calibration);
            for column in &held {
                let column = column - problem.layout.calibration().start;
                solution.calibration_covariance.row_mut(column).fill(0.0);
                solution.calibration_covariance.column_mut(column).fill(0.0);
            }
            if accepted {
                solution.estimate = candidate;
                solution.costs_after = costs;
                damping = (damping * 0.1).max(LEAST_DAMPING);
                done = before - after <= limits.relative_cost_tolerance * before;
                break;
            }
            // A step that fails by no more than rounding is the end of the way.
            if after - before <= 1e-9 * before {
                break;
            }
            damping = (damping * 100.0).clamp(LEAST_DAMPING, MOST_DAMPING);
            done = damping >= MOST_DAMPING;
            if done {
                break;
            }
        }
        if done {
            break;
        }
    }
    solution
}

/// Takes unknowns out of the normal equations: their steps become zero, whatever the factors say.
fn hold(held: &[usize], hessian: &mut DMatrix<f64>, gradient: &mut DVector<f64>) {
    for column in held {
        hessian.row_mut(*column).fill(0.0);
        hessian.column_mut(*column).fill(0.0);
        hessian[(*column, *column)] = 1.0;
        gradient[*column] = 0.0;
    }
}

fn damped(hessian: &DMatrix<f64>, damping: f64) -> DMatrix<f64> {
    let mut damped = hessian.clone();
    for k in 0..damped.nrows() {
        damped[(k, k)] += damping * hessian[(k, k)] + FLOOR;
    }
    damped
}
