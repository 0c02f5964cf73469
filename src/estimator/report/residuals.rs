//! Residuals by kind of factor, and the solver iterations.

use crate::estimator::factors::FactorKind;
/// Sum of squared whitened residuals of one kind of factor, and their number.
#[derive(Clone, Debug, PartialEq)]
pub struct ResidualSummary {
    pub factor: FactorKind,
    pub count: usize,
    pub chi2_before: f64,
    pub chi2_after: f64,
}

impl ResidualSummary {
    /// Mean of the squared whitened residuals after the solve; `None` without residuals.
    pub fn mean_square(&self) -> Option<f64> {
        (self.count > 0).then(|| self.chi2_after / self.count as f64)
    }
}
