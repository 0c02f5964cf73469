//! Sensors that comparisons of sources leave as the cause of a misfit.

use crate::faults::{Fault, Sensor};

/// Sensor that may be wrong.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::log_check) struct Suspect {
    pub(in crate::log_check) sensor: Sensor,
    /// Its only wrong joint, if it is known.
    pub(in crate::log_check) joint: Option<String>,
}

/// Sensors that may be the cause of the misfit of a camera; `None` if all may be.
#[derive(Clone, Debug, Default, PartialEq)]
pub(in crate::log_check) struct Suspects(Option<Vec<Suspect>>);

impl Suspects {
    pub(in crate::log_check) fn only(suspects: Vec<Suspect>) -> Self {
        Self(Some(suspects))
    }

    /// True unless only other sensors are wrong.
    pub(in crate::log_check) fn include(&self, sensor: Sensor) -> bool {
        self.0.as_ref().is_none_or(|suspects| suspects.iter().any(|suspect| suspect.sensor == sensor))
    }

    /// True if this sensor alone is wrong.
    pub(in crate::log_check) fn are_only(&self, sensor: Sensor) -> bool {
        self.0.as_ref().is_some_and(|suspects| suspects.iter().all(|suspect| suspect.sensor == sensor))
    }

    /// True for a fault of a sensor that may be wrong.
    pub(in crate::log_check) fn allow(&self, fault: &Fault) -> bool {
        let sensor = fault.kind.row().sensor;
        let is_of = |suspect: &Suspect| {
            let has_joint = |joint: &String| fault.joints.is_empty() || fault.joints.contains(joint);
            suspect.sensor == sensor && suspect.joint.as_ref().is_none_or(has_joint)
        };
        self.0.as_ref().is_none_or(|suspects| suspects.iter().any(is_of))
    }
}
