//! Dense normal equations of a linearized problem and their solution.
//!
//! Rows `r + J δ` with weights `w` give `H = Σ w JᵀJ` and `g = Σ w Jᵀr`; the step solves `H δ = −g` (Gauss–Newton; Nocedal
//! and Wright, *Numerical Optimization*, 2006, Eq. 10.23) or, damped, `(H + λ diag H) δ = −g` (Marquardt, *An Algorithm for
//! Least-Squares Estimation of Nonlinear Parameters*, 1963).

use nalgebra::allocator::Allocator;
use nalgebra::{DMatrix, DefaultAllocator, Dim, Dyn, OMatrix, OVector, Storage};

use super::damped::DampedEquations;

/// Normal equations over `D` unknowns, a number known at compile time (`Const<N>`) or not (`Dyn`).
#[derive(Clone, Debug)]
pub struct NormalEquations<D: Dim>
where
    DefaultAllocator: Allocator<D> + Allocator<D, D>,
{
    /// `H` (n × n); only its lower triangle is read.
    pub hessian: OMatrix<f64, D, D>,
    /// `g` (n × 1).
    pub gradient: OVector<f64, D>,
}

impl<D: Dim> NormalEquations<D>
where
    DefaultAllocator: Allocator<D> + Allocator<D, D>,
{
    /// Equations before any row is added: H and g are zero.
    pub fn zeros(unknowns: D) -> Self {
        Self {
            hessian: OMatrix::zeros_generic(unknowns, unknowns),
            gradient: OVector::zeros_generic(unknowns, nalgebra::U1),
        }
    }

    /// Adds rows: `H += w JᵀJ`, `g += w Jᵀr`.
    pub fn add<R: Dim>(
        &mut self,
        residual: &nalgebra::Vector<f64, R, impl Storage<f64, R>>,
        jacobian: &nalgebra::Matrix<f64, R, D, impl Storage<f64, R, D>>,
        weight: f64,
    ) {
        self.hessian += jacobian.tr_mul(jacobian) * weight;
        self.gradient += jacobian.tr_mul(residual) * weight;
    }

    /// [`Self::add`] for rows whose Jacobian is zero but for some blocks, each with its first unknown.
    pub(crate) fn add_blocks<R: Dim>(
        &mut self,
        residual: &OVector<f64, R>,
        blocks: &[(usize, &OMatrix<f64, R, Dyn>)],
        weight: f64,
    ) where
        DefaultAllocator: Allocator<R> + Allocator<R, Dyn>,
    {
        for (row, left) in blocks {
            for (column, right) in blocks {
                let mut block = self.hessian.view_mut((*row, *column), (left.ncols(), right.ncols()));
                block += left.tr_mul(right) * weight;
            }
            let mut entries = self.gradient.rows_mut(*row, left.ncols());
            entries += left.tr_mul(residual) * weight;
        }
    }

    /// Removes an unknown: its step is zero.
    pub fn fix(&mut self, unknown: usize) {
        fix(&mut self.hessian, &mut self.gradient, unknown);
    }

    /// Adds the row of one unknown with residual `error` and information `1/σ²`.
    pub fn add_diagonal(&mut self, unknown: usize, error: f64, information: f64) {
        self.hessian[(unknown, unknown)] += information;
        self.gradient[unknown] += information * error;
    }

    /// Gauss–Newton step `δ = −H⁻¹ g`; `None` unless `H` is positive definite.
    pub fn step(self) -> Option<OVector<f64, D>> {
        Some(-self.hessian.cholesky()?.solve(&self.gradient))
    }
}

impl<D: Dim> DampedEquations for NormalEquations<D>
where
    DefaultAllocator: Allocator<D> + Allocator<D, D>,
{
    type Step = OVector<f64, D>;

    fn solve(&self, damping: f64) -> Option<Self::Step> {
        let mut damped = self.clone();
        damp(&mut damped.hessian, damping);
        damped.step()
    }
}

/// Removes an unknown from normal equations: its step is zero.
pub fn fix<D: Dim>(hessian: &mut OMatrix<f64, D, D>, gradient: &mut OVector<f64, D>, unknown: usize)
where
    DefaultAllocator: Allocator<D> + Allocator<D, D>,
{
    hessian.row_mut(unknown).fill(0.0);
    hessian.column_mut(unknown).fill(0.0);
    hessian[(unknown, unknown)] = 1.0;
    gradient[unknown] = 0.0;
}

/// `H ← H + λ diag H`.
pub fn damp<D: Dim>(hessian: &mut OMatrix<f64, D, D>, damping: f64)
where
    DefaultAllocator: Allocator<D, D>,
{
    for unknown in 0..hessian.nrows() {
        hessian[(unknown, unknown)] *= 1.0 + damping;
    }
}

/// `W` (n × n, lower triangular) with `WᵀW = C⁻¹`, which whitens residuals of covariance `C`: the inverse of its Cholesky
/// factor. `None` unless `C` is positive definite.
pub fn square_root_information<D: Dim>(covariance: OMatrix<f64, D, D>) -> Option<OMatrix<f64, D, D>>
where
    DefaultAllocator: Allocator<D> + Allocator<D, D>,
{
    let (rows, columns) = covariance.shape_generic();
    covariance.cholesky()?.unpack().solve_lower_triangular(&OMatrix::identity_generic(rows, columns))
}

/// Variance added to every unknown of a prior, so that its covariance stays regular when it fixes one.
pub const MIN_PRIOR_VARIANCE: f64 = 1e-12;

/// [`square_root_information`] of a prior with [`MIN_PRIOR_VARIANCE`]; of its diagonal alone if it is not positive definite.
pub fn prior_square_root_information(mut covariance: DMatrix<f64>) -> DMatrix<f64> {
    for unknown in 0..covariance.nrows() {
        covariance[(unknown, unknown)] += MIN_PRIOR_VARIANCE;
    }
    let weights = covariance.diagonal().map(|variance| 1.0 / variance.sqrt());
    square_root_information(covariance).unwrap_or_else(|| DMatrix::from_diagonal(&weights))
}

/// Gauss–Newton iterations: moves `estimate` by the steps `δ = −H⁻¹ g` of its normal equations, at most `iterations` of them.
///
/// `plus` moves the estimate on its manifold, `x ← x ⊞ δ`, and returns true after a step that is short enough to stop.
/// `None` if the equations are singular, a step is not finite, or `linearize` has no equations; the estimate is then the last
/// one before.
pub fn gauss_newton<E, D: Dim>(
    estimate: &mut E,
    iterations: usize,
    mut linearize: impl FnMut(&E) -> Option<NormalEquations<D>>,
    mut plus: impl FnMut(&mut E, &OVector<f64, D>) -> bool,
) -> Option<()>
where
    DefaultAllocator: Allocator<D> + Allocator<D, D>,
{
    for _ in 0..iterations {
        let step = linearize(estimate)?.step().filter(|step| step.iter().all(|entry| entry.is_finite()))?;
        if plus(estimate, &step) {
            break;
        }
    }
    Some(())
}
