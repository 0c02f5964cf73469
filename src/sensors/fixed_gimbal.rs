//! Rig with a fixed gimbal, for programs with static extrinsics.

use nalgebra::UnitQuaternion;

use super::{CameraMount, Rig};
use crate::geometry::RigidTransform;

impl Rig {
    /// Neutral joint angles in radians, one per joint: encoder angle 0, or the limit nearest to it. Empty
    /// without a gimbal.
    pub fn neutral_joint_angles_rad(&self) -> Vec<f64> {
        let joints = self.gimbal.iter().flat_map(|gimbal| &gimbal.joints);
        joints.map(|joint| 0.0_f64.clamp(joint.limits_rad.0, joint.limits_rad.1)).collect()
    }

    /// Returns the rig with its gimbal fixed at encoder angles in radians, one per joint: its cameras are static and
    /// there is no gimbal. `None` if the number of angles differs from the number of joints.
    pub fn at_joint_angles(&self, angles_rad: &[f64]) -> Option<Self> {
        let mut rig = self.clone();
        let Some(gimbal) = rig.gimbal.take() else { return angles_rad.is_empty().then_some(rig) };
        if gimbal.chain.joint_count() != angles_rad.len() {
            return None;
        }
        let imu_from_camera = gimbal.chain.imu_from_camera(angles_rad);
        for camera in rig.cameras.iter_mut().filter(|camera| camera.mount == CameraMount::Gimbal) {
            camera.mount = CameraMount::Static { imu_from_camera };
        }
        rig.assumed.retain(|assumed| !assumed.field.starts_with("gimbal"));
        Some(rig)
    }

    /// Returns the rig with static cameras and IMU in Kalibr's IMU frame, in which the accelerometer's matrix is lower
    /// triangular, and `kalibr_from_imu`. If the matrix is lower triangular already (as for a calibrated IMU), that is
    /// the identity and all values keep their bits. Cameras on a gimbal are unchanged.
    pub fn in_kalibr_imu_frame(&self) -> (Self, UnitQuaternion<f64>) {
        let (kalibr_from_imu, intrinsics) = self.imu.intrinsics.in_lower_triangular_frame();
        let mut rig = self.clone();
        if kalibr_from_imu == UnitQuaternion::identity() {
            return (rig, kalibr_from_imu);
        }
        rig.imu.intrinsics = intrinsics;
        let rotation = RigidTransform { rotation: kalibr_from_imu, ..RigidTransform::identity() };
        for camera in &mut rig.cameras {
            if let CameraMount::Static { imu_from_camera } = &mut camera.mount {
                *imu_from_camera = rotation * *imu_from_camera;
            }
        }
        (rig, kalibr_from_imu)
    }
}
