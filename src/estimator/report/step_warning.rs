use std::fmt;

use crate::estimator::factors::FactorKind;

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
