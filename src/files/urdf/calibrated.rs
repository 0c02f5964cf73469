//! A calibrated chain written back into the text of a robot description.

use nalgebra::{Quaternion, Unit, UnitQuaternion, Vector3};

use super::path::{OriginFactor, PathRotation};
use super::{LinkPath, OriginPlace, UrdfError, UrdfJointType, roll_pitch_yaw};
use crate::geometry::RigidTransform;
use crate::gimbal::ClassicalChain;

/// Largest change of an origin, in metres and in entries of its rotation matrix, that counts as rounding.
const ROUNDING: f64 = 1e-13;

/// Origin that the calibration changes.
#[derive(Clone, Debug, PartialEq)]
pub struct ChangedOrigin {
    pub joint: String,
    pub before: RigidTransform,
    pub after: RigidTransform,
}

impl LinkPath<'_> {
    /// The text of the robot description with the origins of a calibrated chain, and those origins. The rest of the text
    /// is the same to the byte; the axes of the joints stay.
    ///
    /// Origins are determined up to a rotation about and a shift along the axis of each joint, for which the frame of
    /// the joint stays as near as possible to the described one.
    ///
    /// # Errors
    /// If the joints differ from the joints of the chain, or a link at an end of the chain has no fixed joint.
    pub fn with_calibration(
        &self,
        joints: &[String],
        chain: &ClassicalChain,
    ) -> Result<(String, Vec<ChangedOrigin>), UrdfError> {
        let own: Vec<String> = self.joints().map(|joint| joint.name.clone()).collect();
        if own != joints || chain.joint_count() != joints.len() {
            let (rig, path) = (joints.to_vec(), self.model.source.clone());
            return Err(UrdfError::OtherJoints { rig, urdf: own, path });
        }
        let mut changes = Vec::new();
        for (place, wanted) in self.wanted_constants(chain).into_iter().enumerate() {
            let factors = &self.constants[place];
            let difference = self.product(factors).minus(&wanted).norm();
            if difference <= ROUNDING {
                continue;
            }
            let changed = self.adjustable(place).ok_or_else(|| self.nothing_to_change(place))?;
            let (before, behind) = (self.product(&factors[..changed]), self.product(&factors[changed + 1..]));
            let factor = before.inverse() * wanted * behind.inverse();
            let OriginFactor { joint, inverse } = factors[changed];
            let after = if inverse { factor.inverse() } else { factor };
            changes.push((joint, after));
        }
        Ok((self.patched(&changes), self.changed_origins(&changes)))
    }

    /// Constants `A₀` to `Aₙ` with the kinematics of a chain, the joint frames nearest to the described ones.
    fn wanted_constants(&self, chain: &ClassicalChain) -> Vec<RigidTransform> {
        let angles_rad = vec![0.0; chain.joint_count()];
        let camera = chain.imu_from_camera(&angles_rad) * self.camera_axes.link_from_camera().inverse();
        let frames = self.joint_frames();
        let mut previous = RigidTransform::identity();
        let mut constants = Vec::with_capacity(frames.len() + 1);
        for ((frame, rotation), axis_frame) in frames.iter().zip(&self.rotations).zip(axis_frames(chain)) {
            let wanted = nearest_frame(frame, self.axis(*rotation), &axis_frame);
            constants.push(previous.inverse() * wanted);
            previous = wanted;
        }
        constants.push(previous.inverse() * camera);
        constants
    }

    /// Index of the factor of a constant that takes the change: the origin of the calibrated joint, at the ends of the
    /// chain the fixed joint nearest to the IMU or to the camera.
    fn adjustable(&self, place: usize) -> Option<usize> {
        let factors = &self.constants[place];
        let of = |rotation: &PathRotation, inverse: bool| {
            factors.iter().position(|it| it.joint == rotation.joint && it.inverse == inverse)
        };
        let is_fixed = |it: &OriginFactor| self.model.joints[it.joint].joint_type == UrdfJointType::Fixed;
        if place == self.rotations.len() {
            let before = self.rotations.last().and_then(|rotation| of(rotation, true));
            return factors.iter().rposition(is_fixed).or(before);
        }
        let next = of(&self.rotations[place], false);
        let before = place.checked_sub(1).and_then(|before| of(&self.rotations[before], true));
        next.or(before).or_else(|| factors.iter().position(is_fixed))
    }

    fn nothing_to_change(&self, place: usize) -> UrdfError {
        let at_camera = place == self.rotations.len();
        let rotation = if at_camera { self.rotations.last() } else { self.rotations.get(place) };
        let joint = rotation.map(|rotation| self.model.joints[rotation.joint].name.clone()).unwrap_or_default();
        let link = if at_camera { self.to.clone() } else { self.from.clone() };
        UrdfError::NothingToChange { link, joint, path: self.model.source.clone() }
    }

    fn changed_origins(&self, changes: &[(usize, RigidTransform)]) -> Vec<ChangedOrigin> {
        let described = |(joint, after): &(usize, RigidTransform)| {
            let joint = &self.model.joints[*joint];
            ChangedOrigin { joint: joint.name.clone(), before: joint.origin, after: *after }
        };
        changes.iter().map(described).collect()
    }

    /// The text with new origins.
    fn patched(&self, changes: &[(usize, RigidTransform)]) -> String {
        let mut edits: Vec<(std::ops::Range<usize>, String)> = Vec::new();
        for (joint, origin) in changes {
            let (xyz, rpy) = (numbers(origin.translation_m.as_slice()), numbers(&roll_pitch_yaw(&origin.rotation)));
            match &self.model.joints[*joint].place {
                OriginPlace::Attributes { xyz: of_xyz, rpy: of_rpy, end } => {
                    let mut added = String::new();
                    for (name, text, range) in [("xyz", xyz, of_xyz), ("rpy", rpy, of_rpy)] {
                        match range {
                            Some(range) => edits.push((range.clone(), text)),
                            None => added.extend([" ", name, "=\"", text.as_str(), "\""]),
                        }
                    }
                    if !added.is_empty() {
                        edits.push((*end..*end, added));
                    }
                }
                OriginPlace::Missing(at) => {
                    edits.push((*at..*at, format!("<origin xyz=\"{xyz}\" rpy=\"{rpy}\"/>")));
                }
            }
        }
        edits.sort_by_key(|(range, _)| range.start);
        let mut text = self.model.text().to_owned();
        for (range, new) in edits.into_iter().rev() {
            text.replace_range(range, &new);
        }
        text
    }
}

/// Frames of the joints in the IMU frame at angles zero, each with its axis along z.
fn axis_frames(chain: &ClassicalChain) -> Vec<RigidTransform> {
    let mut pose = chain.imu_from_base;
    chain
        .links
        .iter()
        .map(|link| {
            let frame = pose;
            pose = pose * link.transform(0.0);
            frame
        })
        .collect()
}

/// Frame nearest to `frame` whose `axis` lies on the z axis of `axis_frame`: rotated by the smallest angle, and shifted
/// at a right angle to the axis.
fn nearest_frame(frame: &RigidTransform, axis: Vector3<f64>, axis_frame: &RigidTransform) -> RigidTransform {
    let (direction, point) = (axis_frame.rotation * Vector3::z(), axis_frame.translation_m);
    let described = frame.rotation * axis;
    let turn = smallest_rotation(&described, &direction);
    let along = direction.dot(&(frame.translation_m - point));
    RigidTransform::new(turn * frame.rotation, point + direction * along)
}

/// Rotation by the smallest angle that maps one unit vector to another: the quaternion `(1 + a·b, a×b)`, normalized,
/// which is exact for nearly equal vectors, too. Opposite vectors have no such rotation; one by 180° is taken.
fn smallest_rotation(from: &Vector3<f64>, to: &Vector3<f64>) -> UnitQuaternion<f64> {
    let (cosine, cross) = (from.dot(to), from.cross(to));
    if 1.0 + cosine > 1e-9 {
        return UnitQuaternion::new_normalize(Quaternion::from_parts(1.0 + cosine, cross));
    }
    let helper = if from.x.abs() < 0.9 { Vector3::x_axis() } else { Vector3::y_axis() };
    UnitQuaternion::from_axis_angle(&Unit::new_normalize(from.cross(&helper)), std::f64::consts::PI)
}

/// Numbers as attributes: the shortest texts that give the same values.
pub(super) fn numbers(values: &[f64]) -> String {
    // Adding zero converts −0 to 0.
    values.iter().map(|value| format!("{}", value + 0.0)).collect::<Vec<_>>().join(" ")
}
