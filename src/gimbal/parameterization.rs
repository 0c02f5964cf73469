use std::fmt;
use std::str::FromStr;

use thiserror::Error;

use crate::text::Named;

/// Parameterization of a chain; all but `Classical` have 4N + 6 columns.
///
/// Minimal parameterizations start with `Rx·Ry·T(tx, ty, 0)` (Eq. 20), or with `Ry·Rx·…` where the name has
/// `Yx`. They end with a link extended by a rotation and a translation: `DH·Ry(β)·Ty(y)` (Eq. 19 with the
/// corrected Eq. 18), or `Rz·Tz·Tx·Ty(y)·Ry(β)·Rx(α)` where the name has `Swapped`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Parameterization {
    /// Eqs. 5–6: rigid transforms before and after the links, 12 + 4N columns, six of them redundant.
    Classical,
    /// Eqs. 18–20, corrected. Singular when the first axis is parallel to the IMU's x or the last one to the
    /// camera's y.
    Minimal,
    /// The other base order: singular when the first axis is parallel to the IMU's y.
    MinimalYx,
    /// The other end block: singular when the last axis is parallel to the camera's x.
    MinimalSwapped,
    /// The other base order and the other end block.
    MinimalSwappedYx,
    /// `X0·Rz·X1·Rz ⋯ XN` with local updates: no singularity, but values without a direct meaning.
    Poe,
}

impl Named for Parameterization {
    const NAMES: &'static [(Self, &'static str)] = &[
        (Self::Classical, "classical"),
        (Self::Minimal, "minimal"),
        (Self::MinimalYx, "minimal-yx"),
        (Self::MinimalSwapped, "minimal-swapped"),
        (Self::MinimalSwappedYx, "minimal-swapped-yx"),
        (Self::Poe, "poe"),
    ];
}

impl Parameterization {
    /// Returns the minimal parameterization with this base order and end block.
    pub fn minimal(yx: bool, swapped: bool) -> Self {
        match (yx, swapped) {
            (false, false) => Self::Minimal,
            (true, false) => Self::MinimalYx,
            (false, true) => Self::MinimalSwapped,
            (true, true) => Self::MinimalSwappedYx,
        }
    }

    /// True if the base rotates about y first.
    pub(super) fn base_yx(self) -> bool {
        matches!(self, Self::MinimalYx | Self::MinimalSwappedYx)
    }

    /// True if beta and y precede alpha in the end block.
    pub(super) fn end_swapped(self) -> bool {
        matches!(self, Self::MinimalSwapped | Self::MinimalSwappedYx)
    }
}

impl fmt::Display for Parameterization {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("unknown parameterization '{0}': expected one of {names}", names = Parameterization::names())]
pub struct UnknownParameterization(pub String);

impl FromStr for Parameterization {
    type Err = UnknownParameterization;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::from_name(name).ok_or_else(|| UnknownParameterization(name.to_owned()))
    }
}
