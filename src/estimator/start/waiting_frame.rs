//! Frame kept during initialization.

use crate::frontend::TrackedFeature;
use crate::geometry::RigidTransform;
use crate::sensors::{ImuSample, JointAngles};

#[derive(Clone, Debug)]
pub(super) struct WaitingFrame {
    pub(super) index: usize,
    pub(super) stamp_ns: i64,
    pub(super) features: Vec<Vec<TrackedFeature>>,
    pub(super) encoder: Option<JointAngles>,
    /// Extrinsics of the leading camera.
    pub(super) imu_from_camera: RigidTransform,
    pub(super) imu: Vec<ImuSample>,
    /// IMU samples from the stamp on.
    pub(super) imu_after: Vec<ImuSample>,
    /// Samples of the IMU on the gimbal over the interval of `imu`.
    pub(super) gimbal_imu: Vec<ImuSample>,
}

impl WaitingFrame {
    /// Encoder angles; zeros without encoders.
    pub(super) fn initial_joints_rad(&self, joints: usize) -> Vec<f64> {
        initial_joints_rad(self.encoder.as_ref(), joints)
    }

    /// Memory use in bytes, heap included.
    pub(super) fn bytes(&self) -> usize {
        let features: usize = self.features.iter().map(|seen| seen.capacity() * size_of::<TrackedFeature>()).sum();
        let encoder = self.encoder.as_ref().map_or(0, JointAngles::heap_bytes);
        size_of::<Self>()
            + features
            + encoder
            + (self.imu.capacity() + self.imu_after.capacity() + self.gimbal_imu.capacity()) * size_of::<ImuSample>()
    }
}

/// Encoder angles; zeros without encoders.
pub(super) fn initial_joints_rad(encoder: Option<&JointAngles>, joints: usize) -> Vec<f64> {
    encoder.map_or_else(|| vec![0.0; joints], |encoder| encoder.angles_rad.clone())
}
