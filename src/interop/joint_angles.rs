//! Joint angles at which a gimbal is fixed, and the notes about them in the files.

use std::sync::Arc;

use super::ConfigurationError;
use crate::flight_log::{FlightLog, FrameStream};
use crate::geometry::seconds_from_ns;
use crate::sensors::{CameraMount, Rig};

/// Search range in seconds after the requested time for an image with joint angles.
const SEARCHED_S: f64 = 1.0;

#[derive(Clone, Debug, PartialEq)]
pub enum AngleOrigin {
    Neutral,
    /// Given by the user, neutral for the other joints.
    Given,
    Measured {
        log: String,
        /// In seconds since the log began.
        time_s: f64,
    },
}

/// Encoder angles of all joints, at which the gimbal is assumed fixed.
#[derive(Clone, Debug, PartialEq)]
pub struct FixedJointAngles {
    /// One per joint, in radians; empty without a gimbal.
    pub angles_rad: Vec<f64>,
    pub origin: AngleOrigin,
}

impl FixedJointAngles {
    /// The neutral angles of a rig, see [`Rig::neutral_joint_angles_rad`].
    pub fn neutral(rig: &Rig) -> Self {
        Self { angles_rad: rig.neutral_joint_angles_rad(), origin: AngleOrigin::Neutral }
    }

    /// The angles in degrees of the named joints, neutral for the others.
    ///
    /// # Errors
    /// If a joint is unknown, named twice, or an angle lies beyond its limits.
    pub fn given(rig: &Rig, named_deg: &[(String, f64)]) -> Result<Self, ConfigurationError> {
        let mut angles = Self { origin: AngleOrigin::Given, ..Self::neutral(rig) };
        let joints: Vec<_> = rig.gimbal.iter().flat_map(|gimbal| &gimbal.joints).collect();
        for (index, (name, angle_deg)) in named_deg.iter().enumerate() {
            let place = joints.iter().position(|joint| joint.name == *name);
            let place = place
                .ok_or_else(|| ConfigurationError::UnknownJoint { name: name.clone(), available: rig.joint_names() })?;
            if named_deg[..index].iter().any(|(earlier, _)| earlier == name) {
                return Err(ConfigurationError::JointTwice { name: name.clone() });
            }
            let (lower, upper) = joints[place].limits_rad;
            let angle_rad = angle_deg.to_radians();
            if !(lower..=upper).contains(&angle_rad) {
                let limits_deg = (lower.to_degrees(), upper.to_degrees());
                return Err(ConfigurationError::BeyondLimits { name: name.clone(), angle_deg: *angle_deg, limits_deg });
            }
            angles.angles_rad[place] = angle_rad;
        }
        Ok(angles)
    }

    /// The angles at the first image of the gimbal's camera at or after `time_s`, in seconds since the log began.
    ///
    /// # Errors
    /// If the rig has no camera on a gimbal, the log cannot be read, or it has no joint angles at that time.
    pub fn measured(log: &Arc<FlightLog>, rig: &Rig, time_s: f64) -> Result<Self, ConfigurationError> {
        let camera = rig.cameras.iter().find(|camera| camera.mount == CameraMount::Gimbal);
        let camera = camera.ok_or(ConfigurationError::NoGimbal)?;
        let frames = FrameStream::new(Arc::clone(log), rig, &camera.key, time_s, Some(SEARCHED_S));
        let mut frames = frames.map_err(|error| ConfigurationError::Log(error.to_string()))?;
        let measured = frames.find_map(|frame| frame.joint_angles.map(|angles| (frame.stamp_ns, angles.angles_rad)));
        let (stamp_ns, angles_rad) = measured.ok_or(ConfigurationError::NoAngles { time_s })?;
        let log = log.path().file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        Ok(Self { angles_rad, origin: AngleOrigin::Measured { log, time_s: seconds_from_ns(stamp_ns) } })
    }

    /// The rig with its gimbal fixed at these angles.
    pub(super) fn fix(&self, rig: &Rig) -> Result<Rig, ConfigurationError> {
        rig.at_joint_angles(&self.angles_rad).ok_or_else(|| ConfigurationError::AngleCount {
            given: self.angles_rad.len(),
            expected: rig.joint_names().len(),
        })
    }

    /// Notes about the validity of the extrinsics.
    pub(super) fn notes(&self, rig: &Rig) -> Vec<String> {
        let carried: Vec<&str> = rig
            .cameras
            .iter()
            .filter(|camera| camera.mount == CameraMount::Gimbal)
            .map(|camera| camera.key.as_str())
            .collect();
        if carried.is_empty() {
            return vec!["the cameras are rigid: the extrinsics hold at every angle of a gimbal".to_owned()];
        }
        let angles: Vec<String> = rig
            .joint_names()
            .iter()
            .zip(&self.angles_rad)
            .map(|(name, angle)| format!("{name} {:.3}°", angle.to_degrees() + 0.0))
            .collect();
        let origin = match &self.origin {
            AngleOrigin::Neutral => "its neutral angles".to_owned(),
            AngleOrigin::Given => "the given angles".to_owned(),
            AngleOrigin::Measured { log, time_s } => format!("those measured in {log} at {time_s:.3} s"),
        };
        let (keys, are) = (carried.join(" and "), if carried.len() == 1 { "is" } else { "are" });
        vec![format!(
            "the extrinsics are static: {keys} {are} carried by the gimbal, which is assumed fixed at {}, {origin}; at other \
             angles they are wrong by the rotation of the joints",
            angles.join(", ")
        )]
    }
}
