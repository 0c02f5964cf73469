//! Residuals by kind of factor, and the iterations of the solver that lowered them.

use crate::estimator::factors::FactorKind;
/// Sum of squared whitened residuals of one kind of factor, and how many there are.
#[derive(Clone, Debug, PartialEq)]
pub struct ResidualSummary {
    /// Kind of factor.
    pub factor: FactorKind,
    /// Number of scalar residuals.
    pub count: usize,
    /// χ² before the solve.
    pub chi2_before: f64,
    /// χ² after the solve.
    pub chi2_after: f64,
}

impl ResidualSummary {
    /// Mean of the squared whitened residuals after the solve; `None` without residuals.
    pub fn mean_square(&self) -> Option<f64> {
        (self.count > 0).then(|| self.chi2_after / self.count as f64)
    }
}
