//! The joints between two links, as a product of constant transforms and rotations.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Matrix3, Rotation3, Unit, UnitQuaternion, Vector3};

use super::{RobotModel, UrdfError, UrdfJoint, UrdfJointType};
use crate::geometry::RigidTransform;
use crate::gimbal::{ClassicalChain, DhLink, JointAxis};
use crate::sensors::Joint;
use crate::text::Named;

/// Chain from the IMU to the camera with known dimensions, for example from a robot description.
#[derive(Clone, Debug, PartialEq)]
pub struct DescribedChain {
    /// Without links for a rigid camera.
    pub chain: ClassicalChain,
    pub joints: Vec<Joint>,
    /// Origin of the dimensions and assumptions about them, as one sentence without a full stop.
    pub reason: String,
}

/// Axes of a camera link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CameraAxes {
    /// x right, y down, z forward (REP 103: frames whose name ends in `_optical`).
    Optical,
    /// x forward, y left, z up.
    Body,
}

/// Names on the command line.
impl Named for CameraAxes {
    const NAMES: &'static [(Self, &'static str)] = &[(Self::Optical, "optical"), (Self::Body, "flu")];
}

impl CameraAxes {
    /// Axes by the name of a link: optical if it contains that word.
    pub fn of_link(link: &str) -> Self {
        if link.to_ascii_lowercase().contains("optical") { Self::Optical } else { Self::Body }
    }

    /// `link_from_camera`, the camera with x right, y down, z forward.
    pub fn link_from_camera(self) -> RigidTransform {
        let rotation = match self {
            Self::Optical => UnitQuaternion::identity(),
            Self::Body => {
                let matrix = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
                UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix))
            }
        };
        RigidTransform::new(rotation, Vector3::zeros())
    }
}

/// Origin of a joint as a factor of a constant transform.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct OriginFactor {
    /// Index of the joint.
    pub(super) joint: usize,
    /// True on the way from a child to its parent.
    pub(super) inverse: bool,
}

/// Rotation of a joint on the path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PathRotation {
    pub(super) joint: usize,
    /// True on the way from a child to its parent: the rotation is by the negative angle.
    pub(super) reversed: bool,
}

/// Chain between two links: `from_from_to = A₀ R₁(q₁) A₁ … Rₙ(qₙ) Aₙ · link_from_camera`.
#[derive(Clone, Debug, PartialEq)]
pub struct LinkPath<'model> {
    pub(super) model: &'model RobotModel,
    pub(super) from: String,
    pub(super) to: String,
    pub(super) camera_axes: CameraAxes,
    /// Factors of `A₀` to `Aₙ`.
    pub(super) constants: Vec<Vec<OriginFactor>>,
    pub(super) rotations: Vec<PathRotation>,
}

impl RobotModel {
    /// Path from the IMU's link to the camera's link.
    ///
    /// # Errors
    /// When a link is unknown, the links are not connected, or a joint between them neither rotates nor is fixed.
    pub fn path(&self, imu: &str, camera: &str, camera_axes: CameraAxes) -> Result<LinkPath<'_>, UrdfError> {
        let (up, down) = (self.joints_to_root(imu)?, self.joints_to_root(camera)?);
        let root = |start: &str, joints: &[usize]| {
            joints.last().map_or_else(|| start.to_owned(), |joint| self.joints[*joint].parent.clone())
        };
        if root(imu, &up) != root(camera, &down) {
            let (from, to) = (imu.to_owned(), camera.to_owned());
            return Err(UrdfError::NotConnected { from, to, path: self.source.clone() });
        }
        // The common part of both ways to the root is not between the links.
        let common = up.iter().rev().zip(down.iter().rev()).take_while(|(a, b)| a == b).count();
        let mut path = LinkPath {
            model: self,
            from: imu.to_owned(),
            to: camera.to_owned(),
            camera_axes,
            constants: vec![Vec::new()],
            rotations: Vec::new(),
        };
        for joint in &up[..up.len() - common] {
            path.add_rotation(*joint, true)?;
            path.add_origin(*joint, true);
        }
        for joint in down[..down.len() - common].iter().rev() {
            path.add_origin(*joint, false);
            path.add_rotation(*joint, false)?;
        }
        Ok(path)
    }

    /// Indices of the joints from a link to the root.
    fn joints_to_root(&self, link: &str) -> Result<Vec<usize>, UrdfError> {
        if !self.links.iter().any(|known| known == link) {
            let (link, available) = (link.to_owned(), self.links.clone());
            return Err(UrdfError::NoLink { link, available, path: self.source.clone() });
        }
        let (mut joints, mut link) = (Vec::new(), link);
        while let Some(joint) = self.joints.iter().position(|joint| joint.child == link) {
            if joints.contains(&joint) {
                let problem = "is part of a closed loop".to_owned();
                let (joint, path) = (self.joints[joint].name.clone(), self.source.clone());
                return Err(UrdfError::Joint { joint, problem, path });
            }
            joints.push(joint);
            link = &self.joints[joint].parent;
        }
        Ok(joints)
    }
}

impl LinkPath<'_> {
    fn add_origin(&mut self, joint: usize, inverse: bool) {
        if let Some(last) = self.constants.last_mut() {
            last.push(OriginFactor { joint, inverse });
        }
    }

    fn add_rotation(&mut self, joint: usize, reversed: bool) -> Result<(), UrdfError> {
        let described = &self.model.joints[joint];
        match described.joint_type {
            UrdfJointType::Fixed => Ok(()),
            UrdfJointType::Revolute | UrdfJointType::Continuous => {
                self.rotations.push(PathRotation { joint, reversed });
                self.constants.push(Vec::new());
                Ok(())
            }
            other => Err(UrdfError::NotRotating {
                joint: described.name.clone(),
                joint_type: other.name(),
                from: self.from.clone(),
                to: self.to.clone(),
                path: self.model.source.clone(),
            }),
        }
    }

    /// Rotating joints in their order from the IMU to the camera.
    pub fn joints(&self) -> impl Iterator<Item = &UrdfJoint> {
        self.rotations.iter().map(|rotation| &self.model.joints[rotation.joint])
    }

    /// Joints of a rig: names and limits.
    pub fn rig_joints(&self) -> Vec<Joint> {
        self.joints().map(|joint| Joint { name: joint.name.clone(), limits_rad: joint.limits_rad }).collect()
    }

    /// Axis of a rotation in the frame in which it acts; positive angles rotate about it, right-handed.
    pub(super) fn axis(&self, rotation: PathRotation) -> Vector3<f64> {
        let axis = self.model.joints[rotation.joint].axis;
        if rotation.reversed { -axis } else { axis }
    }

    /// Product of the factors of a constant.
    pub(super) fn product(&self, factors: &[OriginFactor]) -> RigidTransform {
        factors.iter().fold(RigidTransform::identity(), |product, factor| {
            let origin = self.model.joints[factor.joint].origin;
            product * if factor.inverse { origin.inverse() } else { origin }
        })
    }

    /// `imu_from_camera` at these angles in radians, one per rotating joint; missing angles are zero.
    pub fn imu_from_camera(&self, angles_rad: &[f64]) -> RigidTransform {
        let mut pose = self.product(&self.constants[0]);
        for (place, rotation) in self.rotations.iter().enumerate() {
            let angle_rad = angles_rad.get(place).copied().unwrap_or(0.0);
            let turn = UnitQuaternion::from_axis_angle(&Unit::new_normalize(self.axis(*rotation)), angle_rad);
            pose = pose * RigidTransform::new(turn, Vector3::zeros()) * self.product(&self.constants[place + 1]);
        }
        pose * self.camera_axes.link_from_camera()
    }

    /// Frames in which the rotations act, in the IMU frame at angles zero.
    pub(super) fn joint_frames(&self) -> Vec<RigidTransform> {
        let mut pose = RigidTransform::identity();
        self.constants[..self.rotations.len()]
            .iter()
            .map(|factors| {
                pose = pose * self.product(factors);
                pose
            })
            .collect()
    }

    /// Chain and joints for a new rig; `known_axes` is true if a person has given the axes of the camera's link.
    pub fn described(&self, known_axes: bool) -> DescribedChain {
        let design = format!(
            "design values of the robot description '{}' from {} to {}, not calibrated",
            self.model.name, self.from, self.to
        );
        let axes = match self.camera_axes {
            CameraAxes::Optical => "x right, y down, z forward",
            CameraAxes::Body => "x forward, y left, z up",
        };
        let axes = (!known_axes).then(|| format!("{} is assumed to have the axes {axes}", self.to));
        let mimics = self.joints().filter_map(|joint| {
            let mimic = joint.mimic.as_ref()?;
            let offset = if mimic.offset_rad == 0.0 { String::new() } else { format!(" {:+}", mimic.offset_rad) };
            Some(format!(
                "{} mimics {} (angle = {} · {}{offset}): its own angle must be measured",
                joint.name, mimic.joint, mimic.multiplier, mimic.joint
            ))
        });
        let reason = std::iter::once(design).chain(axes).chain(mimics).collect::<Vec<_>>().join("; ");
        DescribedChain { chain: self.chain(), joints: self.rig_joints(), reason }
    }

    /// The same kinematics as a chain of Denavit–Hartenberg links.
    pub fn chain(&self) -> ClassicalChain {
        let frames = self.joint_frames();
        let axes: Vec<JointAxis> = frames
            .iter()
            .zip(&self.rotations)
            .map(|(frame, rotation)| (frame.rotation * self.axis(*rotation), frame.translation_m))
            .collect();
        let last = DhLink { alpha_rad: -FRAC_PI_2, ..DhLink::default() };
        ClassicalChain::from_axes(&axes, last, &self.imu_from_camera(&[]))
    }
}
