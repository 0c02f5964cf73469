//! Levenberg–Marquardt on the bundle.

use nalgebra::DMatrix;

use super::CalibrationOptions;
use super::bundle::Bundle;
use super::state::Estimate;

const FIRST_DAMPING: f64 = 1e-5;
const LEAST_DAMPING: f64 = 1e-9;
const MOST_DAMPING: f64 = 1e8;
/// Added to the diagonal so that an unknown without any factor stays where it is.
const FLOOR: f64 = 1e-6;

/// How an adjustment ended.
#[derive(Clone, Debug)]
pub(super) struct Adjusted {
    pub(super) estimate: Estimate,
    /// Steps tried, taken or not.
    pub(super) iterations: usize,
}

/// Lowers the bundle's cost from `start`; `None` when not even the first equations can be solved.
pub(super) fn adjust(bundle: &Bundle<'_>, start: Estimate, options: &CalibrationOptions) -> Option<Adjusted> {
    let mut adjusted = Adjusted { estimate: start, iterations: 0 };
    let mut cost = bundle.cost(&adjusted.estimate);
    let mut damping = FIRST_DAMPING;
    let mut solved = false;
    while adjusted.iterations < options.iterations {
        let equations = bundle.linearize(&adjusted.estimate);
        let mut settled = true;
        while adjusted.iterations < options.iterations {
            adjusted.iterations += 1;
            let reduced = equations.visual().eliminate(damping);
            let (mut matrix, band, border) = bundle.assemble(&equations, &reduced);
            matrix.damp(damping, FLOOR);
            let solution = matrix.factor().and_then(|factor| factor.solve(&band, &border));
            let Some((band, border)) = solution else {
                damping = (damping * 100.0).min(MOST_DAMPING);
                continue;
            };
            solved = true;
            let view_steps = bundle.view_steps(&equations, &band, &border);
            let landmarks = equations.visual().substitute(&reduced, &view_steps);
            let candidate = adjusted.estimate.moved(&bundle.columns, &band, &border, &landmarks);
            let next = bundle.cost(&candidate);
            if next.is_finite() && next <= cost {
                settled = cost - next <= options.relative_cost_tolerance * cost;
                (adjusted.estimate, cost) = (candidate, next);
                damping = (damping * 0.1).max(LEAST_DAMPING);
                break;
            }
            // A step that fails by no more than rounding is the end of the way.
            if next - cost <= 1e-9 * cost || damping >= MOST_DAMPING {
                break;
            }
            damping = (damping * 30.0).min(MOST_DAMPING);
        }
        if settled {
            break;
        }
    }
    solved.then_some(adjusted)
}

/// Covariance of the border's unknowns, everything else eliminated.
pub(super) fn border_covariance(bundle: &Bundle<'_>, estimate: &Estimate) -> Option<DMatrix<f64>> {
    let equations = bundle.linearize(estimate);
    let reduced = equations.visual().eliminate(0.0);
    let (mut matrix, _, _) = bundle.assemble(&equations, &reduced);
    matrix.damp(0.0, FLOOR);
    Some(matrix.factor()?.border_information().clone().cholesky()?.inverse())
}
