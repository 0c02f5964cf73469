//! Units other than radians in which drivers report joint angles.

use std::f64::consts::{PI, TAU};

/// Numbers of bits of absolute encoders.
const BITS: std::ops::RangeInclusive<u32> = 8..=20;

/// Unit of joint angles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointUnit {
    Degrees,
    /// Degrees over this number.
    DegreeParts(u32),
    Milliradians,
    /// Steps of an encoder with this number of bits per turn.
    Counts(u32),
    /// Radians that were multiplied by π/180.
    ConvertedTwice,
}

impl JointUnit {
    pub fn all() -> impl Iterator<Item = Self> {
        [Self::Degrees, Self::DegreeParts(10), Self::DegreeParts(100), Self::Milliradians, Self::ConvertedTwice]
            .into_iter()
            .chain(BITS.map(Self::Counts))
    }

    /// Size of the unit in radians.
    pub fn size_rad(self) -> f64 {
        match self {
            Self::Degrees => PI / 180.0,
            Self::DegreeParts(parts) => PI / 180.0 / f64::from(parts),
            Self::Milliradians => 1e-3,
            Self::Counts(bits) => TAU / f64::from(1_u32 << bits),
            Self::ConvertedTwice => 180.0 / PI,
        }
    }

    /// Unit of this size, up to 1 %.
    pub fn of_size(size_rad: f64) -> Option<Self> {
        Self::all().find(|unit| (unit.size_rad() / size_rad - 1.0).abs() < 0.01)
    }

    /// State of angles in this unit.
    pub fn describe(self) -> String {
        match self {
            Self::Degrees => "in degrees".to_owned(),
            Self::DegreeParts(parts) => format!("in 1/{parts} of a degree"),
            Self::Milliradians => "in milliradians".to_owned(),
            Self::Counts(bits) => format!("in encoder counts, {} per turn", 1_u32 << bits),
            Self::ConvertedTwice => "57 times too small: radians were converted as if they were degrees".to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_unit_is_found_by_its_size() {
        for unit in JointUnit::all() {
            assert_eq!(JointUnit::of_size(unit.size_rad()), Some(unit));
        }
        assert_eq!(JointUnit::of_size(1.0), None);
        assert_eq!(JointUnit::Counts(12).describe(), "in encoder counts, 4096 per turn");
    }
}
