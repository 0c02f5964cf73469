use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::frame::{Axis, ChainFrame};
use crate::geometry::RigidTransform;

/// Denavit–Hartenberg link, `Rz(θ + theta_offset)·Tz(d)·Tx(a)·Rx(α)` (Eq. 2).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DhLink {
    /// Static joint offset θ, added to the encoder angle.
    pub theta_offset_rad: f64,
    /// Link offset d along the joint axis.
    pub d_m: f64,
    /// Length `a` of the link, in metres.
    pub a_m: f64,
    /// Twist `α` of the link, in radians.
    pub alpha_rad: f64,
}

impl DhLink {
    /// Returns `joint_l_from_joint_l+1` at an encoder angle (Eq. 2).
    pub fn transform(&self, joint_angle_rad: f64) -> RigidTransform {
        let mut frame = ChainFrame::identity();
        self.extend(&mut frame, joint_angle_rad);
        frame.to_transform()
    }

    pub(super) fn extend(&self, frame: &mut ChainFrame, joint_angle_rad: f64) {
        frame.rotate(Axis::Z, joint_angle_rad + self.theta_offset_rad);
        frame.translate(Axis::Z, self.d_m);
        frame.translate(Axis::X, self.a_m);
        frame.rotate(Axis::X, self.alpha_rad);
    }
}

/// Chain of Eqs. 5–6, the parameterization of rig files; without links the extrinsics of a rigid camera.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ClassicalChain {
    /// `T^{I:B}` of the paper.
    pub imu_from_base: RigidTransform,
    /// Links from base to end effector.
    pub links: Vec<DhLink>,
    /// `T^{E:C}` of the paper.
    pub effector_from_camera: RigidTransform,
}

impl ClassicalChain {
    pub fn joint_count(&self) -> usize {
        self.links.len()
    }

    /// The chain whose links have the values of this one by the modified convention (Craig, "Introduction to Robotics", 2005,
    /// Eq. 3.6): a link begins with `a` along and `α` about the x axis, then turns about its joint.
    #[must_use]
    pub fn read_as_modified(&self) -> Self {
        let along_x = |link: &DhLink| {
            let rotation = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), link.alpha_rad);
            RigidTransform::new(rotation, Vector3::new(link.a_m, 0.0, 0.0))
        };
        let imu_from_base = self.links.first().map_or(self.imu_from_base, |first| self.imu_from_base * along_x(first));
        let next = |number: usize| self.links.get(number + 1).map_or((0.0, 0.0), |link| (link.a_m, link.alpha_rad));
        let link = |(number, link): (usize, &DhLink)| {
            let (a_m, alpha_rad) = next(number);
            DhLink { a_m, alpha_rad, ..*link }
        };
        Self { imu_from_base, links: self.links.iter().enumerate().map(link).collect(), ..self.clone() }
    }

    /// Returns `imu_from_camera` at the given encoder angles, one per joint (Eqs. 5–6).
    ///
    /// # Panics
    ///
    /// When the number of angles is not the number of joints.
    pub fn imu_from_camera(&self, joint_angles_rad: &[f64]) -> RigidTransform {
        assert_eq!(joint_angles_rad.len(), self.links.len(), "one angle per joint");
        let mut frame = ChainFrame::of(&self.imu_from_base);
        for (link, angle) in self.links.iter().zip(joint_angles_rad) {
            link.extend(&mut frame, *angle);
        }
        frame.then(&self.effector_from_camera);
        frame.to_transform()
    }

    /// Returns the N + 2 frames of the chain in the IMU frame, for drawing: base (the first joint), the following
    /// joints, end effector, camera.
    ///
    /// # Panics
    ///
    /// When the number of angles is not the number of joints.
    pub fn frames_in_imu(&self, joint_angles_rad: &[f64]) -> Vec<RigidTransform> {
        assert_eq!(joint_angles_rad.len(), self.links.len(), "one angle per joint");
        let mut frame = ChainFrame::of(&self.imu_from_base);
        let mut frames = vec![self.imu_from_base];
        for (link, angle) in self.links.iter().zip(joint_angles_rad) {
            link.extend(&mut frame, *angle);
            frames.push(frame.to_transform());
        }
        frame.then(&self.effector_from_camera);
        frames.push(frame.to_transform());
        frames
    }
}

/// Axis of a joint at angle zero, in the IMU frame: its direction and a point on it in metres.
pub type JointAxis = (Vector3<f64>, Vector3<f64>);

impl ClassicalChain {
    /// Returns the classical chain with these joint axes and this `imu_from_camera` at encoder angles zero.
    ///
    /// The axes do not determine the last link (the camera's pose on the effector compensates it): it is `last`.
    /// Without axes the chain is the extrinsics of a rigid camera.
    pub fn from_axes(axes: &[JointAxis], last: DhLink, imu_from_camera: &RigidTransform) -> Self {
        let Some(((first, first_point), rest)) = axes.split_first() else {
            return Self { imu_from_base: *imu_from_camera, ..Self::default() };
        };
        let mut frame = RigidTransform::new(frame_about(&across(first), first), *first_point);
        let imu_from_base = frame;
        let mut links = Vec::with_capacity(axes.len());
        for (next, next_point) in rest {
            let link = link_to(&frame, next, next_point);
            frame = frame * link.transform(0.0);
            links.push(link);
        }
        frame = frame * last.transform(0.0);
        links.push(last);
        Self { imu_from_base, links, effector_from_camera: frame.inverse() * *imu_from_camera }
    }
}

/// Link from a joint's frame to the next joint's axis, along their common normal.
fn link_to(frame: &RigidTransform, next: &Vector3<f64>, next_point: &Vector3<f64>) -> DhLink {
    let (x, z) = (frame.rotation * Vector3::x(), frame.rotation * Vector3::z());
    let origin = frame.translation_m;
    let between = next_point - origin;
    let (sine, cosine) = (z.cross(next).norm(), z.dot(next));
    let parallel = sine < 1e-9;
    let normal = if parallel {
        let apart = between - z * z.dot(&between);
        if apart.norm() < 1e-9 { x } else { apart.normalize() }
    } else {
        z.cross(next).normalize()
    };
    // Feet of the common normal; parallel axes use the given point.
    let d_m = if parallel { z.dot(&between) } else { next.cross(&normal).dot(&between) / next.cross(&normal).dot(&z) };
    DhLink {
        theta_offset_rad: x.cross(&normal).dot(&z).atan2(x.dot(&normal)),
        d_m,
        a_m: normal.dot(&between),
        alpha_rad: z.cross(next).dot(&normal).atan2(cosine),
    }
}

/// Unit vector orthogonal to the given one.
fn across(direction: &Vector3<f64>) -> Vector3<f64> {
    let helper = if direction.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    (helper - direction * direction.dot(&helper)).normalize()
}

/// Orientation with these x and z axes.
fn frame_about(x: &Vector3<f64>, z: &Vector3<f64>) -> UnitQuaternion<f64> {
    let z = z.normalize();
    let matrix = Matrix3::from_columns(&[*x, z.cross(x), z]);
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix))
}
