use crate::geometry::RigidTransform;

use super::frame::{Axis, Frame};

/// One Denavit–Hartenberg link, `Rz(θ + theta_offset)·Tz(d)·Tx(a)·Rx(α)` (Eq. 2).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DhLink {
    /// Static offset added to the encoder's angle.
    pub theta_offset_rad: f64,
    /// Shift along the joint's axis.
    pub d_m: f64,
    /// Shift along the link.
    pub a_m: f64,
    /// Twist about the link.
    pub alpha_rad: f64,
}

impl DhLink {
    /// The link at an encoder angle, `joint_l_from_joint_l+1`.
    pub fn transform(&self, joint_angle_rad: f64) -> RigidTransform {
        let mut frame = Frame::identity();
        self.extend(&mut frame, joint_angle_rad);
        frame.to_transform()
    }

    pub(super) fn extend(&self, frame: &mut Frame, joint_angle_rad: f64) {
        frame.rotate(Axis::Z, joint_angle_rad + self.theta_offset_rad);
        frame.translate(Axis::Z, self.d_m);
        frame.translate(Axis::X, self.a_m);
        frame.rotate(Axis::X, self.alpha_rad);
    }
}

/// The chain of Eqs. 5–6 as rigs write it; without links it is a rigid camera.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ClassicalChain {
    /// `T^{I:B}`.
    pub imu_from_base: RigidTransform,
    /// The links in order.
    pub links: Vec<DhLink>,
    /// `T^{E:C}`.
    pub effector_from_camera: RigidTransform,
}

impl ClassicalChain {
    /// Number of joints.
    pub fn joint_count(&self) -> usize {
        self.links.len()
    }

    /// Forward kinematics at the encoder angles, one per joint.
    ///
    /// # Panics
    /// When the number of angles is not the number of joints.
    pub fn imu_from_camera(&self, joint_angles_rad: &[f64]) -> RigidTransform {
        assert_eq!(joint_angles_rad.len(), self.links.len(), "one angle per joint");
        let mut frame = Frame::of(&self.imu_from_base);
        for (link, angle) in self.links.iter().zip(joint_angles_rad) {
            link.extend(&mut frame, *angle);
        }
        frame.then(&self.effector_from_camera);
        frame.to_transform()
    }

    /// Every frame of the chain in the IMU frame, for drawing: base (the first joint), the joints after it, the
    /// effector, the camera; N + 2 of them.
    ///
    /// # Panics
    /// When the number of angles is not the number of joints.
    pub fn frames_in_imu(&self, joint_angles_rad: &[f64]) -> Vec<RigidTransform> {
        assert_eq!(joint_angles_rad.len(), self.links.len(), "one angle per joint");
        let mut frame = Frame::of(&self.imu_from_base);
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
