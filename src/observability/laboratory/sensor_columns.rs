//! Sets of sensor columns of an experiment, in addition to the columns of the chain.

use std::fmt;
use std::str::FromStr;

use thiserror::Error;

use crate::gimbal::{ParameterId, ParameterPart, Quantity};

/// Sets of sensor columns of an experiment; the chain's columns are always present.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SensorColumns {
    /// Readout time of the camera's rolling shutter.
    pub readout: bool,
    /// Time offset of the camera, and of the encoders if there are any.
    pub timeshift: bool,
    /// `fx fy cx cy k1 k2`, those that the camera has.
    pub intrinsics: bool,
    /// Scale and misalignment of gyroscope and accelerometer, and the gyroscope's rotation relative to the accelerometer.
    pub imu_intrinsics: bool,
}

/// Error: unknown name of a set of columns.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("unknown columns '{given}': expected chain or some of {}, separated by commas", SensorColumns::NAMES.join(", "))]
pub struct UnknownColumns {
    pub given: String,
}

impl SensorColumns {
    pub const NAMES: [&'static str; 4] = ["readout", "timeshift", "intrinsics", "imu-intrinsics"];
    /// No columns but the chain's.
    pub const NONE: Self = Self { readout: false, timeshift: false, intrinsics: false, imu_intrinsics: false };
    pub const ALL: Self = Self { readout: true, timeshift: true, intrinsics: true, imu_intrinsics: true };

    /// True if there is any sensor column.
    pub fn any(self) -> bool {
        self != Self::NONE
    }

    const fn flags(self) -> [bool; 4] {
        [self.readout, self.timeshift, self.intrinsics, self.imu_intrinsics]
    }

    /// True if a sensor parameter belongs to one of the sets.
    pub fn has(self, parameter: ParameterId) -> bool {
        match (parameter.part, parameter.quantity) {
            (ParameterPart::GimbalImu, _) => false,
            (_, Quantity::Readout) => self.readout,
            (_, Quantity::Timeshift) => self.timeshift,
            (ParameterPart::Camera(_), _) => self.intrinsics,
            (ParameterPart::Gyroscope | ParameterPart::Accelerometer, _) => self.imu_intrinsics,
            _ => false,
        }
    }
}

impl FromStr for SensorColumns {
    type Err = UnknownColumns;

    fn from_str(names: &str) -> Result<Self, Self::Err> {
        let mut columns = Self::NONE;
        for name in names.split(',').map(str::trim) {
            match name {
                "chain" => {}
                "readout" => columns.readout = true,
                "timeshift" => columns.timeshift = true,
                "intrinsics" => columns.intrinsics = true,
                "imu-intrinsics" => columns.imu_intrinsics = true,
                "all" => columns = Self::ALL,
                _ => return Err(UnknownColumns { given: name.to_owned() }),
            }
        }
        Ok(columns)
    }
}

impl fmt::Display for SensorColumns {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = Self::NAMES.into_iter().zip(self.flags());
        let names: Vec<&str> = ["chain"].into_iter().chain(names.filter(|it| it.1).map(|it| it.0)).collect();
        out.write_str(&names.join(","))
    }
}
