//! A frame before the window runs.

use crate::frontend::TrackedFeature;
use crate::geometry::RigidTransform;
use crate::sensors::{ImuSample, JointAngles};

/// A frame kept until the initialization succeeds.
#[derive(Clone, Debug)]
pub(super) struct WaitingFrame {
    pub(super) index: usize,
    pub(super) stamp_ns: i64,
    /// By camera.
    pub(super) features: Vec<Vec<TrackedFeature>>,
    pub(super) encoder: Option<JointAngles>,
    /// Of the leading camera.
    pub(super) imu_from_camera: RigidTransform,
    pub(super) imu: Vec<ImuSample>,
    /// From the stamp on.
    pub(super) imu_after: Vec<ImuSample>,
}

impl WaitingFrame {
    /// The encoder angles, zeros without encoders.
    pub(super) fn initial_joints_rad(&self, joints: usize) -> Vec<f64> {
        initial_joints_rad(self.encoder.as_ref(), joints)
    }

    /// Bytes that it takes, with what it holds on the heap.
    pub(super) fn bytes(&self) -> usize {
        let features: usize = self.features.iter().map(|seen| seen.capacity() * size_of::<TrackedFeature>()).sum();
        let encoder = self.encoder.as_ref().map_or(0, JointAngles::heap_bytes);
        size_of::<Self>()
            + features
            + encoder
            + (self.imu.capacity() + self.imu_after.capacity()) * size_of::<ImuSample>()
    }
}

/// The encoder angles, zeros without encoders.
pub(super) fn initial_joints_rad(encoder: Option<&JointAngles>, joints: usize) -> Vec<f64> {
    encoder.map_or_else(|| vec![0.0; joints], |encoder| encoder.angles_rad.clone())
}
