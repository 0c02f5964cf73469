use crate::geometry::RigidTransform;

/// A ground-truth pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseSample {
    /// Header stamp in nanoseconds since the log began.
    pub stamp_ns: i64,
    /// Pose of the IMU in the world.
    pub world_from_imu: RigidTransform,
}
