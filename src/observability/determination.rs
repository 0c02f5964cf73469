//! Scale of words for the quality of a calibration parameter after a flight, and the causes of a loss.

use serde::{Serialize, Serializer};

use crate::table::{Medium, Tone};
use crate::text::Named;

/// Ratio of posterior and prior σ below which a parameter is determined: nine tenths of its information come from the
/// flight.
pub const DETERMINED_RATIO: f64 = 0.3;
/// Ratio from which a flight does not determine a parameter: it contributes less than a quarter of the prior's
/// information.
pub const NOT_DETERMINED_RATIO: f64 = 0.9;

/// Verdict on a calibration parameter from its posterior and prior σ, the same in window, report and files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Determination {
    /// The posterior σ is below [`DETERMINED_RATIO`] of the prior σ.
    Determined,
    /// The posterior σ is below [`NOT_DETERMINED_RATIO`] of the prior σ.
    WeaklyDetermined,
    /// The prior determines the value.
    NotDetermined,
    /// The parameterization has other parameters for the same motion, and σ is not below [`DETERMINED_RATIO`].
    Redundant,
    /// Not estimated: the value of the rig is kept.
    Fixed,
    /// Without a posterior: the run has not initialized.
    Initializing,
}

impl Named for Determination {
    const NAMES: &'static [(Self, &'static str)] = &[
        (Self::Determined, "determined"),
        (Self::WeaklyDetermined, "weakly determined"),
        (Self::NotDetermined, "not determined"),
        (Self::Redundant, "redundant"),
        (Self::Fixed, "fixed"),
        (Self::Initializing, "initializing"),
    ];
}

impl Serialize for Determination {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl Determination {
    /// Both numbers of the scale in words.
    pub const RULE: &'static str = "determined: σ below 0.3 of the prior σ; weakly determined: below 0.9; not determined: \
                                    from 0.9 on; redundant: by the parameterization";

    /// Verdict on a posterior σ and a prior σ of one unit; NaN before the first solve. A parameter without a finite prior
    /// is determined as soon as its σ is finite.
    pub fn of(sigma: f64, prior_sigma: f64, redundant: bool) -> Self {
        let ratio = sigma / prior_sigma;
        if !sigma.is_finite() {
            Self::Initializing
        } else if !prior_sigma.is_finite() || ratio < DETERMINED_RATIO {
            Self::Determined
        } else if redundant {
            Self::Redundant
        } else if ratio < NOT_DETERMINED_RATIO {
            Self::WeaklyDetermined
        } else {
            Self::NotDetermined
        }
    }

    /// True if motion or further sensors can improve the parameter.
    pub fn is_improvable(self) -> bool {
        matches!(self, Self::WeaklyDetermined | Self::NotDetermined)
    }

    /// Severity of the verdict: largest for a parameter that the flight does not determine.
    pub fn severity(self) -> u8 {
        match self {
            Self::NotDetermined => 5,
            Self::WeaklyDetermined => 4,
            Self::Redundant => 3,
            Self::Determined => 2,
            Self::Fixed => 1,
            Self::Initializing => 0,
        }
    }

    /// Symbol and emphasis on a screen; the symbol is unique without the emphasis.
    pub const fn look(self) -> (&'static str, Tone) {
        match self {
            Self::Determined => ("✔", Tone::Good),
            Self::WeaklyDetermined => ("⚠", Tone::Caution),
            Self::NotDetermined => ("✖", Tone::Bad),
            Self::Redundant => ("=", Tone::Weak),
            Self::Fixed => ("–", Tone::Weak),
            Self::Initializing => ("…", Tone::Weak),
        }
    }

    pub const fn tone(self) -> Tone {
        self.look().1
    }

    /// Name, on a screen after the symbol.
    pub fn shown(self, medium: Medium) -> String {
        match medium {
            Medium::Screen => format!("{} {}", self.look().0, self.name()),
            Medium::Page => self.name().to_owned(),
        }
    }
}

/// Cause for which a parameter is not determined, as in the rank deficit of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum LossCause {
    /// Redundant in the parameterization, or at its singularity.
    Parameterization,
    /// Joints that did not move in most windows.
    StationaryJoints,
    /// Unknown joint angles absorb the parameter in most windows.
    FreeJointAngles,
    /// Motion of vehicle and joints.
    Motion,
}

impl Named for LossCause {
    const NAMES: &'static [(Self, &'static str)] = &[
        (Self::Parameterization, "parameterization"),
        (Self::StationaryJoints, "stationary joints"),
        (Self::FreeJointAngles, "free joint angles"),
        (Self::Motion, "motion"),
    ];
}

impl Serialize for LossCause {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_ratios_separate_three_words() {
        let of = |ratio: f64, redundant| Determination::of(0.002 * ratio, 0.002, redundant);
        assert_eq!(of(0.299, false), Determination::Determined);
        assert_eq!(of(0.301, false), Determination::WeaklyDetermined);
        assert_eq!(of(0.899, false), Determination::WeaklyDetermined);
        assert_eq!(of(0.901, false), Determination::NotDetermined);
        assert_eq!(of(0.71, true), Determination::Redundant);
        assert_eq!(of(0.2, true), Determination::Determined);
        assert_eq!(of(f64::NAN, true), Determination::Initializing);
        assert_eq!(Determination::of(0.002, f64::NAN, false), Determination::Determined);
        for ratio in [DETERMINED_RATIO, NOT_DETERMINED_RATIO] {
            assert!(Determination::RULE.contains(&ratio.to_string()), "{ratio}");
        }
    }
}
