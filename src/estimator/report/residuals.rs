//! Residuals by kind of factor, and warnings about those that their noise model does not explain.

use std::fmt;

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

/// Residuals of a kind of factor that are larger than their noise model allows: a problem that did not stop the step.
#[derive(Clone, Debug, PartialEq)]
pub struct StepWarning {
    pub factor: FactorKind,
    /// First words of the text.
    pub inconsistency: &'static str,
    /// Mean squared whitened residual (χ²/dof) at the start of the warning.
    pub mean_square: f64,
    /// Limit of the mean.
    pub limit: f64,
    /// Averaging time of the mean, in seconds.
    pub averaged_s: f64,
    /// Possible causes, and the options that may remove them.
    pub cause: String,
}

impl fmt::Display for StepWarning {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { inconsistency, mean_square, limit, averaged_s, cause, .. } = self;
        write!(out, "{inconsistency} (χ²/dof {mean_square:.2} > {limit:.2} over {averaged_s:.0} s): {cause}")
    }
}
