//! Errors of an offline calibration against ground truth, by stage.

use serde::Serialize;

use super::calibrate::CalibrationRun;
use crate::calibration::ChainDistance;
use crate::geometry::RigidTransform;
use crate::gimbal::ClassicalChain;
use crate::sensors::CameraMount;

/// Errors of `imu_from_camera` against the ground truth; for a chain, over the joint angles of the log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CalibrationErrors {
    /// Static camera in the given rig.
    pub static_initial: ChainDistance,
    /// Static camera after the camera–IMU calibration of the static camera alone.
    pub static_camera_imu: ChainDistance,
    /// Static camera after the bundle adjustment of both cameras.
    pub static_final: ChainDistance,
    /// Chain in the given rig.
    pub chain_initial: ChainDistance,
    /// Chain after the pose loops.
    pub chain_pose_loop: ChainDistance,
    /// Chain after the bundle adjustment of both cameras.
    pub chain_final: ChainDistance,
}

impl CalibrationRun {
    /// Errors against ground truth; `None` without a ground-truth rig with this static camera and a gimbal of as many
    /// joints.
    pub fn errors(&self) -> Option<CalibrationErrors> {
        let outcome = &self.outcome;
        let extrinsics = self.true_extrinsics()?;
        let chain = &self.ground_truth_rig.as_ref()?.gimbal.as_ref()?.chain;
        if chain.joint_count() != outcome.chain.joint_count() {
            return None;
        }
        let of_extrinsics = |found: &RigidTransform| ChainDistance::of_extrinsics(found, &extrinsics);
        let of_chain = |found: &ClassicalChain| ChainDistance::over(found, chain, &outcome.visited_rad);
        Some(CalibrationErrors {
            static_initial: of_extrinsics(&outcome.extrinsics.initial),
            static_camera_imu: of_extrinsics(&outcome.static_camera_imu.imu_from_camera),
            static_final: of_extrinsics(&outcome.extrinsics.imu_from_camera),
            chain_initial: of_chain(&outcome.given_chain)?,
            chain_pose_loop: of_chain(&outcome.pose_loop.chain)?,
            chain_final: of_chain(&outcome.chain)?,
        })
    }

    /// `imu_from_camera` of the static camera in the ground-truth rig; `None` without one.
    pub fn true_extrinsics(&self) -> Option<RigidTransform> {
        let cameras = &self.ground_truth_rig.as_ref()?.cameras;
        match cameras.iter().find(|camera| camera.key == self.static_camera)?.mount {
            CameraMount::Static { imu_from_camera } => Some(imu_from_camera),
            CameraMount::Gimbal => None,
        }
    }
}
