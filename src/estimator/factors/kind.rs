//! Kinds of factors, and the label of each factor of a window.

use crate::text::Named;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FactorKind {
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
    /// Preintegrated samples of the IMU on the gimbal between two frames.
    GimbalImu,
}

/// Keys in tables and conditions, without spaces.
impl Named for FactorKind {
    const NAMES: &'static [(Self, &'static str)] = &[
        (Self::Visual, "visual"),
        (Self::Imu, "imu"),
        (Self::Encoder, "encoder"),
        (Self::CalibrationPrior, "calibration_prior"),
        (Self::MarginalizationPrior, "marginalization_prior"),
        (Self::ZeroVelocity, "standstill"),
        (Self::GimbalImu, "gimbal_imu"),
    ];
}

impl FactorKind {
    pub const fn label(self) -> &'static str {
        match self {
            Self::Visual => "visual",
            Self::Imu => "IMU",
            Self::Encoder => "encoder",
            Self::CalibrationPrior => "calibration prior",
            Self::MarginalizationPrior => "marginalization prior",
            Self::ZeroVelocity => "zero velocity",
            Self::GimbalImu => "gimbal IMU",
        }
    }
}

/// Factor of a window without landmarks; its frame by slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FactorLabel {
    /// IMU samples that end at this slot.
    Imu(u16),
    /// Samples of the IMU on the gimbal that end at this slot.
    GimbalImu(u16),
    /// Encoder readings of the frame at this slot, with its joint rates and joint accelerations.
    Encoder(u16),
    ZeroVelocity,
    CalibrationPrior,
    /// Marginalization prior and prior at the start.
    MarginalizationPrior,
}

impl FactorLabel {
    pub(crate) const fn kind(self) -> FactorKind {
        match self {
            Self::Imu(_) => FactorKind::Imu,
            Self::GimbalImu(_) => FactorKind::GimbalImu,
            Self::Encoder(_) => FactorKind::Encoder,
            Self::ZeroVelocity => FactorKind::ZeroVelocity,
            Self::CalibrationPrior => FactorKind::CalibrationPrior,
            Self::MarginalizationPrior => FactorKind::MarginalizationPrior,
        }
    }
}
