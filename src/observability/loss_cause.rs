//! Causes for which a flight does not determine a parameter.

use serde::{Serialize, Serializer};

use crate::text::Named;

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
