//! Chain of a gimbal that is described by the order of its axes.

use std::str::FromStr;

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::TemplateError;
use crate::geometry::RigidTransform;
use crate::gimbal::{ClassicalChain, DhLink, JointAxis};
use crate::sensors::{BodyAxes, Joint};

const MAX_AXES: usize = 8;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GimbalAxis {
    /// About the vertical of the level vehicle.
    Yaw,
    /// About the forward axis.
    Roll,
    /// About the lateral axis.
    Pitch,
}

impl GimbalAxis {
    /// Name of the axis and of its joint.
    pub fn name(self) -> &'static str {
        match self {
            Self::Yaw => "yaw",
            Self::Roll => "roll",
            Self::Pitch => "pitch",
        }
    }

    /// Rotation axis suggested by the joint's name ('pan' → z).
    pub fn of_joint(name: &str) -> Option<Self> {
        let name = name.to_ascii_lowercase();
        let names: [(Self, &[&str]); 3] = [
            (Self::Yaw, &["yaw", "pan", "azimuth"]),
            (Self::Roll, &["roll", "bank"]),
            (Self::Pitch, &["pitch", "tilt", "elevation"]),
        ];
        names.into_iter().find(|(_, words)| words.iter().any(|word| name.contains(word))).map(|(axis, _)| axis)
    }

    /// Direction in the vehicle (x forward, y left, z up) at angle zero.
    fn direction(self, positive: BodyAxes) -> Vector3<f64> {
        let direction = match self {
            Self::Yaw => Vector3::z(),
            Self::Roll => Vector3::x(),
            Self::Pitch => Vector3::y(),
        };
        if self != Self::Roll && positive == BodyAxes::Frd { -direction } else { direction }
    }

    /// Usual range in radians: gimbals roll little, and look down further than up. Pitch is positive upwards, or
    /// downwards.
    fn limits_rad(self, positive: BodyAxes) -> (f64, f64) {
        let degrees = |low: f64, high: f64| (low.to_radians(), high.to_radians());
        match (self, positive) {
            (Self::Yaw, _) => (-std::f64::consts::PI, std::f64::consts::PI),
            (Self::Roll, _) => degrees(-60.0, 60.0),
            (Self::Pitch, BodyAxes::Frd) => degrees(-135.0, 60.0),
            (Self::Pitch, BodyAxes::Flu) => degrees(-60.0, 135.0),
        }
    }
}

/// Axes of a gimbal from the vehicle to the camera; empty for a rigid camera.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MechanismAxes(pub Vec<GimbalAxis>);

impl FromStr for MechanismAxes {
    type Err = TemplateError;

    /// Parses axes between hyphens, such as `yaw-roll-pitch`, or `rigid`.
    fn from_str(text: &str) -> Result<Self, TemplateError> {
        let unknown = || TemplateError::UnknownMechanism { given: text.to_owned() };
        if text.eq_ignore_ascii_case("rigid") {
            return Ok(Self(Vec::new()));
        }
        let axis = |word: &str| match word.to_ascii_lowercase().as_str() {
            "yaw" | "pan" => Some(GimbalAxis::Yaw),
            "roll" => Some(GimbalAxis::Roll),
            "pitch" | "tilt" => Some(GimbalAxis::Pitch),
            _ => None,
        };
        let axes: Vec<GimbalAxis> = text.split('-').map(axis).collect::<Option<_>>().ok_or_else(unknown)?;
        let repeats = axes.windows(2).any(|pair| pair[0] == pair[1]);
        if repeats || axes.len() > MAX_AXES {
            return Err(unknown());
        }
        Ok(Self(axes))
    }
}

impl std::fmt::Display for MechanismAxes {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.0.is_empty() {
            return out.write_str("rigid");
        }
        out.write_str(&self.0.iter().map(|axis| axis.name()).collect::<Vec<_>>().join("-"))
    }
}

impl MechanismAxes {
    /// Chain whose axes meet at right angles at `position_m` (forward, left and up of the IMU), with the camera at the
    /// same position; it looks forward, level, at angles zero.
    pub(super) fn chain(&self, positive: BodyAxes, imu: BodyAxes, position_m: Vector3<f64>) -> ClassicalChain {
        let imu_from_vehicle = imu.flu_from_axes().inverse();
        let position_in_imu_m = imu_from_vehicle * position_m;
        let axis =
            |axis: &GimbalAxis| -> JointAxis { (imu_from_vehicle * axis.direction(positive), position_in_imu_m) };
        let axes: Vec<JointAxis> = self.0.iter().map(axis).collect();
        let camera = RigidTransform::new(imu_from_vehicle * optical(), position_in_imu_m);
        let last = DhLink { alpha_rad: -std::f64::consts::FRAC_PI_2, ..DhLink::default() };
        ClassicalChain::from_axes(&axes, last, &camera)
    }

    pub(super) fn joints(&self, names: &[String], positive: BodyAxes) -> Vec<Joint> {
        let joint =
            |(name, axis): (&String, &GimbalAxis)| Joint { name: name.clone(), limits_rad: axis.limits_rad(positive) };
        names.iter().zip(&self.0).map(joint).collect()
    }

    /// Default names of joints: the names of the axes, numbered if an axis occurs more than once.
    pub fn default_names(&self) -> Vec<String> {
        let name = |(place, axis): (usize, &GimbalAxis)| {
            let earlier = self.0[..place].iter().filter(|other| *other == axis).count();
            if earlier == 0 { axis.name().to_owned() } else { format!("{}{}", axis.name(), earlier + 1) }
        };
        self.0.iter().enumerate().map(name).collect()
    }
}

/// Orientation of the optical frame (x right, y down, z forward) of a camera that looks forward, in forward-left-up
/// axes.
fn optical() -> UnitQuaternion<f64> {
    let matrix = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix))
}
