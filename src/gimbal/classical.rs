use crate::geometry::RigidTransform;

use super::frame::{Axis, ChainFrame};

/// Denavit–Hartenberg link, `Rz(θ + theta_offset)·Tz(d)·Tx(a)·Rx(α)` (Eq. 2).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DhLink {
    /// Static joint offset θ, added to the encoder angle.
    pub theta_offset_rad: f64,
    /// Link offset d along the joint axis.
    pub d_m: f64,
    /// Link length a.
    pub a_m: f64,
    /// Link twist α.
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
