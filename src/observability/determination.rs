//! Scale of words for the quality of a calibration parameter after a flight, and the causes of a loss.

use serde::{Serialize, Serializer};

use crate::table::{Medium, Tone};
use crate::text::Named;

/// Largest ratio of a weakly determined parameter's σ and the required accuracy.
pub const WEAKLY_DETERMINED_RATIO: f64 = 3.0;

/// Verdict on a calibration parameter from its σ and the required accuracy, the same in window, report and files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Determination {
    /// The measurements of the flight alone reach the required accuracy; the prior of the rig has no effect.
    Determined,
    /// Measurements and prior together reach the required accuracy.
    Given,
    /// With the prior, σ is at most [`WEAKLY_DETERMINED_RATIO`] times the required accuracy.
    WeaklyDetermined,
    NotDetermined,
    /// The parameterization has other parameters for the same motion.
    Redundant,
    /// Not estimated: the value of the rig is kept.
    Fixed,
    /// Withheld: the run is not trusted.
    Unknown,
    /// Without a posterior: the run has not initialized.
    Initializing,
}

impl Named for Determination {
    const NAMES: &'static [(Self, &'static str)] = &[
        (Self::Determined, "determined"),
        (Self::Given, "given"),
        (Self::WeaklyDetermined, "weakly determined"),
        (Self::NotDetermined, "not determined"),
        (Self::Redundant, "redundant"),
        (Self::Fixed, "fixed"),
        (Self::Unknown, "unknown"),
        (Self::Initializing, "initializing"),
    ];
}

impl Serialize for Determination {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl Determination {
    /// The scale in words.
    pub const RULE: &'static str = "determined: the measurements of the flight alone reach the required accuracy; given: \
                                    only together with the rig's prior; weakly determined: together up to 3 times the \
                                    required accuracy; not determined: more; redundant: by the parameterization; unknown: \
                                    the run is not trusted";

    /// Verdict on the posterior σ, the σ by the measurements alone and the required accuracy of one unit; NaN before the
    /// first solve.
    pub fn of(sigma: f64, flight_sigma: f64, required: f64, redundant: bool) -> Self {
        if !sigma.is_finite() {
            Self::Initializing
        } else if redundant {
            Self::Redundant
        } else if flight_sigma <= required {
            Self::Determined
        } else if sigma <= required {
            Self::Given
        } else if sigma <= WEAKLY_DETERMINED_RATIO * required {
            Self::WeaklyDetermined
        } else {
            Self::NotDetermined
        }
    }

    /// True if the parameter is as accurate as required.
    pub fn is_met(self) -> bool {
        matches!(self, Self::Determined | Self::Given)
    }

    /// True if motion or further sensors can improve the parameter.
    pub fn is_improvable(self) -> bool {
        matches!(self, Self::WeaklyDetermined | Self::NotDetermined)
    }

    /// Severity of the verdict: largest for a parameter that is not determined.
    pub fn severity(self) -> u8 {
        match self {
            Self::NotDetermined => 7,
            Self::WeaklyDetermined => 6,
            Self::Unknown => 5,
            Self::Redundant => 4,
            Self::Given => 3,
            Self::Determined => 2,
            Self::Fixed => 1,
            Self::Initializing => 0,
        }
    }

    /// Symbol and emphasis on a screen; the symbol is unique without the emphasis.
    pub const fn look(self) -> (&'static str, Tone) {
        match self {
            Self::Determined => ("✔", Tone::Good),
            Self::Given => ("●", Tone::Accent),
            Self::WeaklyDetermined => ("⚠", Tone::Caution),
            Self::NotDetermined => ("✖", Tone::Bad),
            Self::Redundant => ("=", Tone::Weak),
            Self::Fixed => ("–", Tone::Weak),
            Self::Unknown => ("?", Tone::Weak),
            Self::Initializing => ("…", Tone::Weak),
        }
    }

    pub const fn tone(self) -> Tone {
        self.look().1
    }

    /// Name, on a screen after the symbol, on a page after `pass` or `fail` by the required accuracy.
    pub fn shown(self, medium: Medium) -> String {
        match medium {
            Medium::Screen => format!("{} {}", self.look().0, self.name()),
            Medium::Page if self.is_met() => format!("pass, {}", self.name()),
            Medium::Page if self.is_improvable() => format!("fail, {}", self.name()),
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
    fn the_flight_alone_determines_and_the_prior_gives() {
        let required = 0.002;
        let of = |ratio: f64, alone: f64| Determination::of(required * ratio, required * alone, required, false);
        assert_eq!(of(0.9, 0.99), Determination::Determined);
        assert_eq!(of(0.9, 1.01), Determination::Given);
        assert_eq!(of(0.9, f64::INFINITY), Determination::Given);
        assert_eq!(of(1.01, f64::INFINITY), Determination::WeaklyDetermined);
        assert_eq!(of(2.99, 3.5), Determination::WeaklyDetermined);
        assert_eq!(of(3.01, 3.5), Determination::NotDetermined);
        assert_eq!(Determination::of(0.001, f64::INFINITY, required, true), Determination::Redundant);
        assert_eq!(Determination::of(f64::NAN, 0.001, required, true), Determination::Initializing);
        assert!(Determination::RULE.contains(&format!("up to {WEAKLY_DETERMINED_RATIO} times")));
        let met = Determination::all().filter(|verdict| verdict.is_met());
        assert_eq!(met.collect::<Vec<_>>(), [Determination::Determined, Determination::Given]);
    }
}
