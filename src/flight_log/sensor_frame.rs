use std::sync::Arc;

use crate::geometry::RigidTransform;
use crate::sensors::{GrayImage, ImuSample, JointAngles};

/// A problem of the log that did not stop reading.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogWarning {
    /// Time of the problem, in nanoseconds since the log began.
    pub stamp_ns: i64,
    /// The problem, its place, and how it was handled.
    pub message: String,
}

/// One image of one camera with the measurements that belong to it: the input of front end and estimator in one step.
#[derive(Clone, Debug)]
pub struct SensorFrame {
    /// Number of this image in its camera's stream, from 0, over the entire log. Skipped images keep their number, so that
    /// it depends neither on where a replay starts nor on damage before.
    pub index: usize,
    /// Header stamp of the image since the log began, on the camera's clock.
    pub stamp_ns: i64,
    /// Log time of the image since the log began.
    pub log_time_ns: i64,
    /// 8-bit grey levels.
    pub image: Arc<GrayImage>,
    /// IMU samples from the previous frame's stamp to this one's, both ends included: the first and the last are
    /// interpolated to the very stamps (shifted by the rig's `timeshift_cam_imu`).
    /// The first frame has the samples before it, as far as they go back (at most 2 s).
    pub imu: Vec<ImuSample>,
    /// IMU samples from the stamp on, the first one at it, where the stream was asked for them; empty otherwise.
    pub imu_after: Vec<ImuSample>,
    /// Encoder angles at the stamp, from all readings around it; `None` without encoders or when none lies within 0.1 s.
    pub joint_angles: Option<JointAngles>,
    /// Ground truth `world_from_imu` interpolated at the stamp: for comparison and display only, never for estimation.
    pub ground_truth: Option<RigidTransform>,
    /// Problems of the log since the previous frame.
    pub warnings: Vec<LogWarning>,
}
