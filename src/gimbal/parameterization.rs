use std::fmt;
use std::str::FromStr;

use thiserror::Error;

/// How a chain is written as numbers; all but `Classical` have 4N + 6 columns.
///
/// Minimal forms begin with `Rx·Ry·T(tx, ty, 0)` (Eq. 20), or `Ry·Rx·…` where the name says `Yx`, and end with a link
/// widened by a turn and a shift: `DH·Ry(β)·Ty(y)` (Eq. 19 with the corrected Eq. 18), or `Rz·Tz·Tx·Ty(y)·Ry(β)·Rx(α)`
/// where it says `Swapped`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Parameterization {
    /// Eqs. 5–6: two whole rigid transforms around the links, 12 + 4N columns, six of them redundant.
    Classical,
    /// Eqs. 18–20 as printed, corrected. Locks when the first axis is the IMU's x or the last one the camera's y.
    Minimal,
    /// The other base order: locks when the first axis is the IMU's y.
    MinimalYx,
    /// The other end block: locks when the last axis is the camera's x.
    MinimalSwapped,
    /// The other base order and the other end block.
    MinimalSwappedYx,
    /// `X0·Rz·X1·Rz ⋯ XN` with local updates: no lock, but no readable numbers either.
    Poe,
}

impl Parameterization {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Classical, Self::Minimal, Self::MinimalYx, Self::MinimalSwapped, Self::MinimalSwappedYx, Self::Poe];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Classical => "classical",
            Self::Minimal => "minimal",
            Self::MinimalYx => "minimal-yx",
            Self::MinimalSwapped => "minimal-swapped",
            Self::MinimalSwappedYx => "minimal-swapped-yx",
            Self::Poe => "poe",
        }
    }

    /// The minimal form in one of its four charts.
    pub fn minimal(yx: bool, swapped: bool) -> Self {
        match (yx, swapped) {
            (false, false) => Self::Minimal,
            (true, false) => Self::MinimalYx,
            (false, true) => Self::MinimalSwapped,
            (true, true) => Self::MinimalSwappedYx,
        }
    }

    /// Whether it is one of the four charts of the minimal form.
    pub fn is_minimal(self) -> bool {
        !matches!(self, Self::Classical | Self::Poe)
    }

    /// Whether the base is turned about y first.
    pub(super) fn base_yx(self) -> bool {
        matches!(self, Self::MinimalYx | Self::MinimalSwappedYx)
    }

    /// Whether the end block has beta and y before alpha.
    pub(super) fn end_swapped(self) -> bool {
        matches!(self, Self::MinimalSwapped | Self::MinimalSwappedYx)
    }
}

impl fmt::Display for Parameterization {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

/// A name that no parameterization has.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error(
    "unknown parameterization '{0}': expected one of classical, minimal, minimal-yx, minimal-swapped, minimal-swapped-yx, poe"
)]
pub struct UnknownParameterization(pub String);

impl FromStr for Parameterization {
    type Err = UnknownParameterization;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::ALL.into_iter().find(|it| it.name() == name).ok_or_else(|| UnknownParameterization(name.to_owned()))
    }
}
