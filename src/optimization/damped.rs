//! Levenberg–Marquardt with Marquardt's scaling: `(H + λ diag H) δ = −g` (Marquardt, *An Algorithm for Least-Squares
//! Estimation of Nonlinear Parameters*, 1963). `λ` decreases after a step that lowers the cost and increases after one that
//! does not.
//!
//! A problem is a [`LeastSquares`]: its cost, its normal equations and its step on the manifold. One that eliminates
//! unknowns by its own structure, as the landmarks of a window, is a [`DampedProblem`].

/// Normal equations `H δ = −g`, solved for damped steps.
pub trait DampedEquations {
    type Step;

    /// Solves `(H + λ diag H) δ = −g`; `None` unless the matrix is positive definite.
    fn solve(&self, damping: f64) -> Option<Self::Step>;
}

/// Least-squares problem whose equations are solved by themselves: dense ([`super::NormalEquations`]) or with groups of
/// unknowns (`TwoLevelEquations`).
pub trait LeastSquares {
    type Estimate;
    type Equations: DampedEquations;

    /// Sum of the squared whitened residuals, each by its robust loss.
    fn cost(&self, estimate: &Self::Estimate) -> f64;

    /// `H` and `g` of the residuals at an estimate.
    fn linearize(&self, estimate: &Self::Estimate) -> Self::Equations;

    /// Estimate `x ⊞ δ`.
    fn plus(&self, estimate: &Self::Estimate, step: &<Self::Equations as DampedEquations>::Step) -> Self::Estimate;
}

impl<P: LeastSquares> DampedProblem for P {
    type Estimate = P::Estimate;
    type Equations = P::Equations;

    fn cost(&self, estimate: &P::Estimate) -> f64 {
        LeastSquares::cost(self, estimate)
    }

    fn linearize(&self, estimate: &P::Estimate) -> P::Equations {
        LeastSquares::linearize(self, estimate)
    }

    fn step(&mut self, estimate: &P::Estimate, equations: &P::Equations, damping: f64) -> Option<P::Estimate> {
        Some(self.plus(estimate, &equations.solve(damping)?))
    }
}

/// Least-squares problem whose normal equations can be damped.
pub trait DampedProblem {
    type Estimate;
    /// Normal equations at an estimate.
    type Equations;

    fn cost(&self, estimate: &Self::Estimate) -> f64;

    /// Linearizes at an estimate; the equations are reused for all dampings.
    fn linearize(&self, estimate: &Self::Estimate) -> Self::Equations;

    /// True if the last step is short enough for the solver to stop: the cost is insensitive to weakly determined
    /// unknowns.
    fn is_settled(&self) -> bool {
        true
    }

    /// Estimate after the step damped by `λ`, `None` when the damped equations are singular.
    fn step(&mut self, estimate: &Self::Estimate, equations: &Self::Equations, damping: f64) -> Option<Self::Estimate>;
}

/// Limits and damping of [`minimize`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DampedOptions {
    /// Largest number of tried steps, accepted or not.
    pub iterations: usize,
    /// Convergence threshold: a step lowers the cost by no more than this fraction and the problem
    /// [is settled](DampedProblem::is_settled).
    pub relative_cost_tolerance: f64,
    /// λ of the first step.
    pub first_damping: f64,
    pub min_damping: f64,
    /// λ at which the solver stops.
    pub max_damping: f64,
    /// Factor on λ after a rejected step or singular equations.
    pub growth: f64,
}

/// Factor on λ after an accepted step.
const SHRINKAGE: f64 = 0.1;
/// Relative increase of the cost up to which a step is rejected because of rounding only.
const ROUNDING: f64 = 1e-9;

/// Reason why the solver stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StopReason {
    /// The last step lowered the cost by less than the tolerance, and the problem is settled.
    Converged,
    /// The last step changed the cost only by rounding.
    Rounding,
    /// No step lowers the cost, even with the largest damping.
    DampingLimit,
    /// The iterations are used up.
    IterationLimit,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Iteration {
    pub(crate) cost_before: f64,
    pub(crate) cost_after: f64,
    pub(crate) damping: f64,
    pub(crate) accepted: bool,
}

#[derive(Clone, Debug)]
pub struct DampedSolution<E> {
    pub estimate: E,
    /// Steps with solvable equations, in order.
    pub(crate) iterations: Vec<Iteration>,
    /// Number of tried steps, including those with singular equations.
    pub(crate) tried: usize,
    pub(crate) stop: StopReason,
}

/// Minimizes the cost of a problem from `start`.
pub fn minimize<P: DampedProblem>(
    problem: &mut P,
    start: P::Estimate,
    options: &DampedOptions,
) -> DampedSolution<P::Estimate> {
    let mut cost = problem.cost(&start);
    let mut damping = options.first_damping;
    let mut solution =
        DampedSolution { estimate: start, iterations: Vec::new(), tried: 0, stop: StopReason::IterationLimit };
    let mut linearized: Option<P::Equations> = None;
    while solution.tried < options.iterations {
        solution.tried += 1;
        let equations = linearized.get_or_insert_with(|| problem.linearize(&solution.estimate));
        if let Some(candidate) = problem.step(&solution.estimate, equations, damping) {
            let (cost_before, cost_after) = (cost, problem.cost(&candidate));
            let accepted = cost_after.is_finite() && cost_after <= cost_before;
            solution.iterations.push(Iteration { cost_before, cost_after, damping, accepted });
            if accepted {
                (solution.estimate, cost, linearized) = (candidate, cost_after, None);
                damping = (damping * SHRINKAGE).max(options.min_damping);
                let gain = cost_before - cost_after;
                if gain <= options.relative_cost_tolerance * cost_before && problem.is_settled() {
                    solution.stop = StopReason::Converged;
                    break;
                }
                continue;
            }
            if cost_after - cost_before <= ROUNDING * cost_before {
                solution.stop = StopReason::Rounding;
                break;
            }
        }
        damping = (damping * options.growth).min(options.max_damping);
        if damping >= options.max_damping {
            solution.stop = StopReason::DampingLimit;
            break;
        }
    }
    solution
}
