//! Residuals by kind of factor, and the iterations of the solver that lowered them.

/// Sum of squared whitened residuals of one kind of factor, and how many there are.
#[derive(Clone, Debug, PartialEq)]
pub struct ResidualSummary {
    /// `visual`, `imu`, `encoder`, `calibration prior`, `marginalization prior`, and `standstill` where there is one.
    pub factor: &'static str,
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

/// One iteration of the solver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IterationReport {
    /// Cost before the step.
    pub cost_before: f64,
    /// Cost after it.
    pub cost_after: f64,
    /// Damping or trust radius in use.
    pub damping: f64,
    /// Norm of the step.
    pub step_norm: f64,
    /// Whether the step was taken.
    pub accepted: bool,
}
