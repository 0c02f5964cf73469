//! Residuals by kind of factor, and the solver iterations.

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FactorKind {
    /// Reprojections of features.
    Visual,
    /// Preintegrated IMU samples between two frames.
    Imu,
    /// Encoder readings of the joint angles.
    Encoder,
    /// Rig's prior on the calibration.
    CalibrationPrior,
    /// Marginalization prior, or the prior at the start.
    MarginalizationPrior,
    /// Zero-velocity update of a stationary vehicle.
    ZeroVelocity,
}

impl FactorKind {
    pub const ALL: [Self; 6] = [
        Self::Visual,
        Self::Imu,
        Self::Encoder,
        Self::CalibrationPrior,
        Self::MarginalizationPrior,
        Self::ZeroVelocity,
    ];

    /// Label for display.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Visual => "visual",
            Self::Imu => "IMU",
            Self::Encoder => "encoder",
            Self::CalibrationPrior => "calibration prior",
            Self::MarginalizationPrior => "marginalization prior",
            Self::ZeroVelocity => "zero velocity",
        }
    }

    /// Key in tables and conditions, without spaces.
    pub const fn key(self) -> &'static str {
        match self {
            Self::Imu => "imu",
            Self::CalibrationPrior => "calibration_prior",
            Self::MarginalizationPrior => "marginalization_prior",
            Self::ZeroVelocity => "standstill",
            _ => self.name(),
        }
    }
}

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

/// One iteration of the solver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IterationReport {
    pub cost_before: f64,
    pub cost_after: f64,
    /// Levenberg–Marquardt damping.
    pub damping: f64,
    pub step_norm: f64,
    /// True if the step was accepted.
    pub accepted: bool,
}
