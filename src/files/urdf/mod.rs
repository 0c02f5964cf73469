//! Robot descriptions (URDF): links, joints and the chain between two links.
//!
//! Format: <https://wiki.ros.org/urdf/XML>. A joint maps its child link to its parent link by
//! `origin · rotation(axis, angle)`; the rotation of an origin is `Rz(yaw) Ry(pitch) Rx(roll)`, in radians.

mod calibrated;
mod error;
mod parse;
mod path;
#[cfg(test)]
mod tests;

use std::fs::File;
use std::io::Read as _;
use std::ops::Range;
use std::path::{Path, PathBuf};

use nalgebra::{UnitQuaternion, Vector3};

pub use self::calibrated::ChangedOrigin;
pub use self::error::UrdfError;
pub use self::path::{CameraAxes, DescribedChain, LinkPath};
use crate::geometry::RigidTransform;
use crate::text::Named;

/// Largest file in bytes; descriptions of humanoid robots have some hundred kilobytes.
const MAX_BYTES: u64 = 16 << 20;
/// Type of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UrdfJointType {
    Revolute,
    Continuous,
    Fixed,
    Prismatic,
    Floating,
    Planar,
}

/// Names in the file.
impl Named for UrdfJointType {
    const NAMES: &'static [(Self, &'static str)] = &[
        (Self::Revolute, "revolute"),
        (Self::Continuous, "continuous"),
        (Self::Fixed, "fixed"),
        (Self::Prismatic, "prismatic"),
        (Self::Floating, "floating"),
        (Self::Planar, "planar"),
    ];
}

/// Relation of a joint to the one that it follows: `angle = multiplier · other + offset`.
#[derive(Clone, Debug, PartialEq)]
pub struct UrdfMimic {
    pub joint: String,
    pub multiplier: f64,
    pub offset_rad: f64,
}

/// Places of the attributes of an origin in the text, in bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum OriginPlace {
    /// Values of `xyz` and `rpy`, where they are given, and the place for further attributes.
    Attributes { xyz: Option<Range<usize>>, rpy: Option<Range<usize>>, end: usize },
    /// Place for a new element, behind the start tag of the joint.
    Missing(usize),
}

#[derive(Clone, Debug, PartialEq)]
pub struct UrdfJoint {
    pub name: String,
    pub joint_type: UrdfJointType,
    pub parent: String,
    pub child: String,
    /// `parent_from_child` at angle zero.
    pub origin: RigidTransform,
    /// Unit vector in the frame of the child.
    pub axis: Vector3<f64>,
    /// Lower and upper limit of the angle in radians; ±π for a joint without limits.
    pub limits_rad: (f64, f64),
    pub mimic: Option<UrdfMimic>,
    pub(super) place: OriginPlace,
}

/// A parsed robot description with its text.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotModel {
    pub name: String,
    pub links: Vec<String>,
    pub joints: Vec<UrdfJoint>,
    /// Path of the file, or name of the topic.
    pub source: PathBuf,
    text: String,
}

impl RobotModel {
    /// Reads a robot description from a file.
    ///
    /// # Errors
    /// When it cannot be read, is no URDF, or contains macros of xacro.
    pub fn read(path: &Path) -> Result<Self, UrdfError> {
        let failed = |source| UrdfError::Read { source, path: path.to_owned() };
        let mut bytes = Vec::new();
        File::open(path).map_err(failed)?.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(failed)?;
        if bytes.len() as u64 > MAX_BYTES {
            let problem = format!("more than {MAX_BYTES} bytes");
            return Err(UrdfError::Syntax { problem, path: path.to_owned() });
        }
        let text = String::from_utf8(bytes).map_err(|error| {
            let problem = format!("byte {} is not UTF-8", error.utf8_error().valid_up_to());
            UrdfError::Syntax { problem, path: path.to_owned() }
        })?;
        Self::parse(text, path)
    }

    /// The text from which it was parsed.
    pub fn text(&self) -> &str {
        &self.text
    }

    pub fn joint(&self, name: &str) -> Option<&UrdfJoint> {
        self.joints.iter().find(|joint| joint.name == name)
    }
}

/// Angles roll, pitch and yaw of `Rz(yaw) Ry(pitch) Rx(roll)`, in radians.
///
/// The rotation is taken apart one angle after another, so that the product of the three agrees with it to rounding also
/// where pitch is ±90° and roll and yaw alone are undetermined.
pub fn roll_pitch_yaw(rotation: &UnitQuaternion<f64>) -> [f64; 3] {
    let matrix = rotation.to_rotation_matrix().into_inner();
    let yaw = if matrix[(1, 0)] == 0.0 && matrix[(0, 0)] == 0.0 { 0.0 } else { matrix[(1, 0)].atan2(matrix[(0, 0)]) };
    let rest = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), -yaw).into_inner() * matrix;
    let pitch = (-rest[(2, 0)]).atan2(rest[(0, 0)]);
    let roll = (-rest[(1, 2)]).atan2(rest[(1, 1)]);
    [roll, pitch, yaw]
}
