//! Levenberg–Marquardt with Marquardt's scaling: `(H + λ diag H) δ = −g`, `λ` lowered after a step that lowers the cost and
//! raised after one that does not.

/// A least-squares problem whose normal equations can be damped.
pub(crate) trait DampedProblem {
    /// Values of all unknowns.
    type Estimate;
    /// The problem linearized at an estimate.
    type Equations;

    /// The cost, in any unit.
    fn cost(&self, estimate: &Self::Estimate) -> f64;

    /// Linearizes at an estimate; the equations are reused for every damping.
    fn linearize(&self, estimate: &Self::Estimate) -> Self::Equations;

    /// Whether the last step is short enough to be the last one: the cost hardly tells of unknowns that the measurements
    /// determine weakly.
    fn is_settled(&self) -> bool {
        true
    }

    /// The estimate after the step damped by `λ`, `None` when the damped equations are singular.
    fn step(&mut self, estimate: &Self::Estimate, equations: &Self::Equations, damping: f64) -> Option<Self::Estimate>;
}

/// Limits and damping of [`minimize`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct DampedOptions {
    /// Largest number of tried steps, accepted or not.
    pub(crate) iterations: usize,
    /// Converged when a step lowers the cost by no more than this ratio of it and the problem
    /// [is settled](DampedProblem::is_settled).
    pub(crate) relative_cost_tolerance: f64,
    /// λ of the first step.
    pub(crate) first_damping: f64,
    /// Smallest λ.
    pub(crate) min_damping: f64,
    /// λ at which the solver stops.
    pub(crate) max_damping: f64,
    /// λ grows by this factor after a rejected step and when the equations are singular.
    pub(crate) growth: f64,
}

/// λ shrinks by this factor after an accepted step.
const SHRINKAGE: f64 = 0.1;
/// A step that raises the cost by no more than this ratio of it was rejected because of rounding alone.
const ROUNDING: f64 = 1e-9;

/// Reason for which the solver stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StopReason {
    /// The last step lowered the cost by less than the tolerance, and the problem is settled.
    Converged,
    /// The last step changed the cost by no more than rounding.
    Rounding,
    /// No step lowers the cost, however damped.
    DampingLimit,
    /// All iterations were used.
    IterationLimit,
}

/// One step tried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Iteration {
    pub(crate) cost_before: f64,
    pub(crate) cost_after: f64,
    pub(crate) damping: f64,
    pub(crate) accepted: bool,
}

/// Last estimate.
#[derive(Clone, Debug)]
pub(crate) struct DampedSolution<E> {
    pub(crate) estimate: E,
    /// Steps whose equations were solved, in order.
    pub(crate) iterations: Vec<Iteration>,
    /// Steps tried, those with singular equations included.
    pub(crate) tried: usize,
    pub(crate) stop: StopReason,
}

/// Minimizes the cost of a problem from `start`.
pub(crate) fn minimize<P: DampedProblem>(
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
