//! Levenberg–Marquardt solver of the bundle.

use std::ops::Range;

use nalgebra::{DMatrix, Matrix6};

use super::CalibrationOptions;
use super::bundle::{Bundle, BundleEquations};
use super::state::{BundleEstimate, Columns};
use crate::estimator::PoseCovariance;
use crate::optimization::DIAGONAL_FLOOR;
use crate::optimization::damped::{DampedOptions, DampedProblem, minimize};

#[derive(Clone, Debug)]
pub(super) struct Adjusted {
    pub(super) estimate: BundleEstimate,
    /// Number of tried steps, accepted or not.
    pub(super) iterations: usize,
}

/// Minimizes the bundle's cost from `start`; `None` when the first equations are singular.
pub(super) fn adjust(bundle: &Bundle<'_>, start: BundleEstimate, options: &CalibrationOptions) -> Option<Adjusted> {
    let options = DampedOptions {
        iterations: options.iterations,
        relative_cost_tolerance: options.relative_cost_tolerance,
        first_damping: 1e-5,
        min_damping: 1e-9,
        max_damping: 1e8,
        growth: 30.0,
    };
    let solution = minimize(&mut DampedBundle { bundle, memory: Vec::new() }, start, &options);
    (!solution.iterations.is_empty()).then_some(Adjusted { estimate: solution.estimate, iterations: solution.tried })
}

struct DampedBundle<'a> {
    bundle: &'a Bundle<'a>,
    /// Memory of the previous equations.
    memory: Vec<f64>,
}

impl DampedProblem for DampedBundle<'_> {
    type Estimate = BundleEstimate;
    type Equations = BundleEquations;

    fn cost(&self, estimate: &BundleEstimate) -> f64 {
        self.bundle.cost(estimate)
    }

    fn linearize(&self, estimate: &BundleEstimate) -> BundleEquations {
        self.bundle.linearize(estimate)
    }

    fn step(&mut self, estimate: &BundleEstimate, equations: &BundleEquations, damping: f64) -> Option<BundleEstimate> {
        let bundle = self.bundle;
        let reduced = equations.visual().eliminate_by_parts(damping);
        let (mut matrix, band, border) = bundle.assemble(equations, &reduced, std::mem::take(&mut self.memory));
        matrix.damp(damping, DIAGONAL_FLOOR);
        let factor = matrix.factor()?;
        let (band, border) = factor.solve(&band, &border)?;
        self.memory = factor.into_memory();
        let view_steps = bundle.view_steps(equations, &band, &border);
        let landmarks = equations.visual().substitute(&reduced, |view| view_steps[&view]);
        Some(estimate.moved(&bundle.columns, &band, &border, &landmarks))
    }
}

/// Covariances at an estimate, all other unknowns marginalized.
pub(super) struct Covariances {
    /// Covariance of the border's unknowns (borders × borders).
    pub(super) border: DMatrix<f64>,
    /// Covariance of the pose of each frame set; empty if not requested.
    pub(super) poses: Vec<PoseCovariance>,
}

/// Covariances of the border and, if `of_poses`, of the poses; `None` when the equations are singular.
pub(super) fn covariances(bundle: &Bundle<'_>, estimate: &BundleEstimate, of_poses: bool) -> Option<Covariances> {
    let equations = bundle.linearize(estimate);
    let reduced = equations.visual().eliminate_by_parts(0.0);
    let (mut matrix, _, _) = bundle.assemble(&equations, &reduced, Vec::new());
    matrix.damp(0.0, DIAGONAL_FLOOR);
    let factor = matrix.factor()?;
    let border = factor.border_information().clone().cholesky()?.inverse();
    let poses = if of_poses {
        let columns = &bundle.columns;
        let starts = (0..columns.frame_sets).map(|frame_set| frame_set * columns.block());
        let ranges: Vec<Range<usize>> = starts.map(|start| start..start + Columns::POSE).collect();
        let found = factor.covariances(&ranges)?;
        found.iter().map(|matrix| PoseCovariance(Matrix6::from_column_slice(matrix.as_slice()))).collect()
    } else {
        Vec::new()
    };
    Some(Covariances { border, poses })
}
