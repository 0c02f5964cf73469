//! Levenberg–Marquardt solver of the window, landmarks eliminated: minimizes Eq. 8 by steps δ with
//!
//! ```text
//! (H + λ diag H) δ = −g    H = JᵀJ    g = Jᵀr
//! ```

use std::mem;
use std::rc::Rc;

use nalgebra::{DMatrix, DVector, Matrix6};

use super::problem::{NormalEquations, Problem};
use crate::estimator::factors::costs::Costs;
use crate::estimator::factors::reprojection::ReducedVisualEquations;
use crate::estimator::state::estimate::Estimate;
use crate::estimator::state::layout::Layout;
use crate::optimization::damped::{DampedOptions, DampedProblem, Iteration, minimize};
use crate::optimization::{Cholesky, DIAGONAL_FLOOR, fix};

/// One iteration of the solver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IterationReport {
    pub cost_before: f64,
    pub cost_after: f64,
    /// Damping `λ` of Levenberg–Marquardt, relative to the diagonal.
    pub damping: f64,
    pub step_norm: f64,
    /// True if the step was accepted.
    pub accepted: bool,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct SolverLimits {
    /// Largest number of tried steps, accepted or not.
    pub(crate) iterations: usize,
    /// Convergence threshold: a step lowers the cost by less than this fraction and moves calibration and newest joint
    /// angles by less than [`SETTLED_SIGMAS`].
    pub(crate) relative_cost_tolerance: f64,
}

#[derive(Clone, Debug)]
pub(crate) struct Solution {
    pub(crate) estimate: Estimate,
    pub(crate) costs_before: Costs,
    pub(crate) costs_after: Costs,
    pub(crate) iterations: Vec<IterationReport>,
    /// Posterior covariance of the calibration at the last linearization; empty without calibration or if the
    /// information is not positive definite.
    pub(crate) calibration_covariance: DMatrix<f64>,
    /// Posterior covariance of the newest pose at the last linearization, rotation first; `None` if the information is
    /// not positive definite.
    pub(crate) newest_pose_covariance: Option<Matrix6<f64>>,
}

impl Solution {
    /// Posterior standard deviations of the calibration's columns; empty without calibration.
    pub(crate) fn calibration_sigmas(&self) -> Vec<f64> {
        let variances = self.calibration_covariance.diagonal();
        variances.iter().map(|variance| variance.max(0.0).sqrt()).collect()
    }
}

/// Marquardt's λ of a solve until a step raises the cost: no more than rounding requires.
///
/// It multiplies the information about an unknown while all others are fixed. The features of a window determine a
/// rotation of the chain to 1e-5 rad in that case, but only to 1e-2 rad if joint angles and the other rotations are
/// unknown too: λ = 1e-6 would halve its steps.
const DAMPING: f64 = 1e-9;
/// Step of calibration and newest joint angles below which the solver may stop, in standard deviations (root mean
/// square over the columns): marginalization keeps the remaining error of an unfinished solve.
const SETTLED_SIGMAS: f64 = 0.01;

/// Minimizes the cost from `start`.
pub(crate) fn solve(problem: &Problem<'_>, start: Estimate, limits: SolverLimits) -> Solution {
    let first = problem.layout.calibration().start;
    let fixed = start.calibration.frozen_columns().into_iter().map(|column| first + column).collect();
    let mut window = DampedWindow {
        problem,
        fixed,
        step_norms: Vec::new(),
        moved_sigmas: 0.0,
        last: None,
        hessian: DMatrix::default(),
        hessian_is_information: false,
        factor_storage: Vec::new(),
    };
    let start = window.evaluated(start);
    let costs_before = start.costs;
    let options = DampedOptions {
        iterations: limits.iterations,
        relative_cost_tolerance: limits.relative_cost_tolerance,
        first_damping: DAMPING,
        min_damping: DAMPING,
        max_damping: 1e8,
        growth: 100.0,
    };
    let solution = minimize(&mut window, start, &options);
    let report = |(tried, step_norm): (&Iteration, &f64)| IterationReport {
        cost_before: tried.cost_before,
        cost_after: tried.cost_after,
        damping: tried.damping,
        step_norm: *step_norm,
        accepted: tried.accepted,
    };
    let posterior = window.posterior();
    let posterior = posterior.as_ref();
    Solution {
        iterations: solution.iterations.iter().zip(&window.step_norms).map(report).collect(),
        newest_pose_covariance: posterior.and_then(|factor| window.newest_pose_covariance(factor)),
        calibration_covariance: posterior.map_or_else(Default::default, |factor| window.calibration_covariance(factor)),
        costs_before,
        costs_after: solution.estimate.costs,
        estimate: solution.estimate.estimate,
    }
}

struct DampedWindow<'a> {
    problem: &'a Problem<'a>,
    fixed: Vec<usize>,
    step_norms: Vec<f64>,
    /// Root mean square step of calibration and newest joint angles in the last solved step, in standard deviations.
    moved_sigmas: f64,
    /// Last linearization for which a step was solved.
    last: Option<Rc<NormalEquations>>,
    /// Normal equations after elimination of the landmarks, of the last tried step.
    hessian: DMatrix<f64>,
    /// True if [`Self::hessian`] belongs to [`Self::last`] and was damped by [`DAMPING`] only: with more damping, the
    /// eliminated landmarks withhold too much information.
    hessian_is_information: bool,
    /// Memory of the last factor.
    factor_storage: Vec<f64>,
}

struct Evaluated {
    estimate: Estimate,
    costs: Costs,
}

impl DampedWindow<'_> {
    fn evaluated(&self, estimate: Estimate) -> Evaluated {
        Evaluated { costs: self.problem.costs(&estimate), estimate }
    }

    /// Factorization of the undamped information at the last linearization: damping would act as information about
    /// position, yaw and other weakly observable unknowns. `None` without a solved step or if the information is not
    /// positive definite.
    fn posterior(&mut self) -> Option<Cholesky> {
        let equations = self.last.take()?;
        if !self.hessian_is_information {
            self.reduce(&equations, &equations.eliminate(0.0));
        }
        self.factor(0.0)
    }

    /// Posterior covariance of the calibration, other unknowns marginalized; zero for fixed parameters.
    fn calibration_covariance(&self, posterior: &Cholesky) -> DMatrix<f64> {
        let layout = &self.problem.layout;
        let mut covariance = posterior.trailing_covariance(layout.calibration);
        for column in &self.fixed {
            let column = column - layout.calibration().start;
            covariance.row_mut(column).fill(0.0);
            covariance.column_mut(column).fill(0.0);
        }
        covariance
    }

    /// Posterior covariance of the newest pose, other unknowns marginalized; `None` if it is not finite.
    fn newest_pose_covariance(&self, posterior: &Cholesky) -> Option<Matrix6<f64>> {
        let newest = self.problem.layout.pose(self.problem.layout.frames.checked_sub(1)?);
        let covariance = posterior.covariance_of(newest);
        covariance.iter().all(|entry| entry.is_finite()).then(|| Matrix6::from_column_slice(covariance.as_slice()))
    }

    /// Root mean square step of the calibration and of the newest frame's joints, in standard deviations.
    fn moved_sigmas(&self, factor: &Cholesky, step: &DVector<f64>) -> f64 {
        // The joints of the newest frame and the calibration are eliminated last.
        let count = self.problem.layout.joint_block() + self.problem.layout.calibration;
        factor.trailing_length(count, step) / (count.max(1) as f64).sqrt()
    }

    /// Computes [`Self::hessian`] and returns the gradient, landmarks eliminated; fixed parameters do not move.
    fn reduce(&mut self, equations: &NormalEquations, eliminated: &[ReducedVisualEquations]) -> DVector<f64> {
        let mut gradient = equations.reduce_into(&mut self.hessian, &self.problem.layout, eliminated);
        for column in &self.fixed {
            fix(&mut self.hessian, &mut gradient, *column);
        }
        self.hessian_is_information = false;
        gradient
    }

    /// Factorization of [`Self::hessian`] with λ = `damping`; `None` if it is not positive definite.
    fn factor(&mut self, damping: f64) -> Option<Cholesky> {
        let storage = mem::take(&mut self.factor_storage);
        let order = self.problem.layout.elimination_order();
        Cholesky::ordered_in(storage, &self.hessian, order, |diagonal| with_floor(diagonal, damping))
    }
}

/// Factors an information matrix without landmarks; `None` if it is not positive definite.
pub(crate) fn factor(layout: &Layout, information: &DMatrix<f64>) -> Option<Cholesky> {
    Cholesky::ordered(information, layout.elimination_order(), |diagonal| with_floor(diagonal, 0.0))
}

/// Entry of the diagonal with λ = `damping`.
fn with_floor(diagonal: f64, damping: f64) -> f64 {
    diagonal + (damping * diagonal + DIAGONAL_FLOOR)
}

impl DampedProblem for DampedWindow<'_> {
    type Estimate = Evaluated;
    type Equations = Rc<NormalEquations>;

    fn cost(&self, evaluated: &Evaluated) -> f64 {
        evaluated.costs.total()
    }

    fn linearize(&self, evaluated: &Evaluated) -> Rc<NormalEquations> {
        Rc::new(self.problem.linearize(&evaluated.estimate))
    }

    fn is_settled(&self) -> bool {
        self.moved_sigmas <= SETTLED_SIGMAS
    }

    fn step(&mut self, evaluated: &Evaluated, equations: &Rc<NormalEquations>, damping: f64) -> Option<Evaluated> {
        let reduced = equations.eliminate(damping);
        let gradient = self.reduce(equations, &reduced);
        let factor = self.factor(damping)?;
        let step = -factor.solve(&gradient);
        let landmarks = equations.landmark_steps(&self.problem.layout, &reduced, &step);
        self.step_norms.push(step.norm());
        self.moved_sigmas = self.moved_sigmas(&factor, &step);
        self.factor_storage = factor.into_storage();
        self.last = Some(Rc::clone(equations));
        self.hessian_is_information = damping <= DAMPING;
        Some(self.evaluated(self.problem.stepped(&evaluated.estimate, &step, &landmarks)))
    }
}
