//! Kinds of factors.

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
