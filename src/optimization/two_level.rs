//! Normal equations with unknowns of two levels: common ones, and groups that are coupled with the common ones only.
//!
//! ```text
//! [ H_cc  H_gcᵀ ] [ δc ]     [ g_c ]        (H_cc − Σ H_gcᵀ H_gg⁻¹ H_gc) δc = −(g_c − Σ H_gcᵀ H_gg⁻¹ g_g)
//! [ H_gc  H_gg  ] [ δg ] = − [ g_g ]   ⇒    δg = −H_gg⁻¹ (g_g + H_gc δc)
//! ```
//!
//! The sums are over the groups (Schur complement; Triggs et al., *Bundle Adjustment: A Modern Synthesis*, 2000, section 6.1).

use nalgebra::allocator::Allocator;
use nalgebra::{DMatrix, DVector, DefaultAllocator, Dim, Dyn, OMatrix, OVector};

use super::damped::DampedEquations;
use super::normal_equations::{NormalEquations, damp};

/// Unknowns of one group: `H_gg`, `g_g`, and their coupling with the common unknowns.
#[derive(Clone, Debug)]
pub(crate) struct GroupEquations {
    pub(crate) own: NormalEquations<Dyn>,
    /// `H_gc`: unknowns of the group (rows) by the common ones (columns).
    pub(crate) coupling: DMatrix<f64>,
}

#[derive(Clone, Debug)]
pub(crate) struct TwoLevelEquations {
    /// `H_cc` and `g_c` of the common unknowns.
    pub(crate) common: NormalEquations<Dyn>,
    pub(crate) groups: Vec<GroupEquations>,
}

/// Steps of the common unknowns and of the unknowns of each group.
#[derive(Clone, Debug)]
pub(crate) struct TwoLevelStep {
    pub(crate) common: DVector<f64>,
    pub(crate) groups: Vec<DVector<f64>>,
}

/// Posterior of the unknowns.
#[derive(Clone, Debug)]
pub(crate) struct TwoLevelPosterior {
    /// Covariance of the common unknowns.
    pub(crate) common: DMatrix<f64>,
    /// Variances of the unknowns of each group.
    pub(crate) groups: Vec<DVector<f64>>,
}

type Factor = nalgebra::linalg::Cholesky<f64, Dyn>;

impl TwoLevelEquations {
    /// Equations without rows for groups of these sizes.
    pub(crate) fn zeros(groups: &[usize], common: usize) -> Self {
        let group = |own: &usize| GroupEquations {
            own: NormalEquations::zeros(Dyn(*own)),
            coupling: DMatrix::zeros(*own, common),
        };
        Self { common: NormalEquations::zeros(Dyn(common)), groups: groups.iter().map(group).collect() }
    }

    /// Adds rows of one group with weight `w`: `own` and `common` are blocks of their Jacobian, each with its first column in
    /// the unknowns of the group or in the common ones.
    pub(crate) fn add<R: Dim>(
        &mut self,
        group: usize,
        residual: &OVector<f64, R>,
        own: &[(usize, &OMatrix<f64, R, Dyn>)],
        common: &[(usize, &OMatrix<f64, R, Dyn>)],
        weight: f64,
    ) where
        DefaultAllocator: Allocator<R> + Allocator<R, Dyn>,
    {
        let group = &mut self.groups[group];
        group.own.add_blocks(residual, own, weight);
        self.common.add_blocks(residual, common, weight);
        for (row, left) in own {
            for (column, right) in common {
                let mut block = group.coupling.view_mut((*row, *column), (left.ncols(), right.ncols()));
                block += left.tr_mul(right) * weight;
            }
        }
    }

    /// Factors of the groups with damping λ; `None` if one is singular.
    fn factors(&self, damping: f64) -> Option<Vec<Factor>> {
        let factor = |group: &GroupEquations| {
            let mut hessian = group.own.hessian.clone();
            damp(&mut hessian, damping);
            hessian.cholesky()
        };
        self.groups.iter().map(factor).collect()
    }

    /// Equations of the common unknowns with the groups eliminated, and the factors of the groups; `None` if one is singular.
    fn eliminate(&self, damping: f64) -> Option<(NormalEquations<Dyn>, Vec<Factor>)> {
        let mut reduced = self.common.clone();
        damp(&mut reduced.hessian, damping);
        let factors = self.factors(damping)?;
        for (group, factor) in self.groups.iter().zip(&factors) {
            reduced.hessian -= group.coupling.tr_mul(&factor.solve(&group.coupling));
            reduced.gradient -= group.coupling.tr_mul(&factor.solve(&group.own.gradient));
        }
        Some((reduced, factors))
    }

    /// Covariance of the common unknowns, the groups marginalized; `None` if the equations are singular.
    pub(crate) fn common_covariance(&self) -> Option<DMatrix<f64>> {
        Some(self.eliminate(0.0)?.0.hessian.cholesky()?.inverse())
    }

    /// Covariance of the common unknowns and variances of the others; the largest σ of each common unknown keeps
    /// directions without information finite. `None` if the equations are singular.
    pub(crate) fn posterior(&self, largest_sigmas: &DVector<f64>) -> Option<TwoLevelPosterior> {
        let mut reduced = self.common.hessian.clone();
        for (index, sigma) in largest_sigmas.iter().enumerate() {
            reduced[(index, index)] += sigma.powi(-2);
        }
        let mut parts = Vec::with_capacity(self.groups.len());
        for (group, factor) in self.groups.iter().zip(self.factors(0.0)?) {
            let solved = factor.solve(&group.coupling);
            reduced -= group.coupling.tr_mul(&solved);
            parts.push((factor.inverse(), solved));
        }
        let common = reduced.cholesky()?.inverse();
        let groups = parts.into_iter().map(|(inverse, solved)| {
            let through = &solved * &common;
            DVector::from_fn(inverse.nrows(), |row, _| inverse[(row, row)] + through.row(row).dot(&solved.row(row)))
        });
        Some(TwoLevelPosterior { groups: groups.collect(), common })
    }
}

impl DampedEquations for TwoLevelEquations {
    type Step = TwoLevelStep;

    fn solve(&self, damping: f64) -> Option<TwoLevelStep> {
        let (reduced, factors) = self.eliminate(damping)?;
        let common = reduced.step()?;
        let own = |(group, factor): (&GroupEquations, &Factor)| {
            -factor.solve(&(&group.own.gradient + &group.coupling * &common))
        };
        Some(TwoLevelStep { groups: self.groups.iter().zip(&factors).map(own).collect(), common })
    }
}
