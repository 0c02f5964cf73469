use std::sync::Arc;

use crate::geometry::RigidTransform;
use crate::sensors::{GrayImage, ImuSample, JointAngles};

/// Something wrong with the log that did not stop the work.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogWarning {
    /// When, in nanoseconds since the log began.
    pub stamp_ns: i64,
    /// What was wrong, where, and what was done about it.
    pub message: String,
}

/// Everything that one image of one camera brings with it: what a front end and an estimator take in one step.
#[derive(Clone, Debug)]
pub struct SensorFrame {
    /// Number of this image in its camera's stream, from 0, over the whole log; images that are left out keep theirs, so
    /// that it depends neither on where a replay starts nor on what was wrong before.
    pub index: usize,
    /// Header stamp of the image since the log began, on the camera's clock.
    pub stamp_ns: i64,
    /// Log time of the image since the log began.
    pub log_time_ns: i64,
    /// The image as grey values.
    pub image: Arc<GrayImage>,
    /// IMU samples from the previous frame's stamp to this one's, both ends included: the first and the last are
    /// interpolated to the very stamps (shifted by the rig's `timeshift_cam_imu`).
    /// The first frame has the samples before it, as far as they go back (at most 2 s).
    pub imu: Vec<ImuSample>,
    /// Encoder angles at the stamp, from all readings around it; `None` without encoders or when none lies within 0.1 s.
    pub joint_angles: Option<JointAngles>,
    /// Ground truth interpolated at the stamp: for comparison and drawing only, never for estimating.
    pub truth: Option<RigidTransform>,
    /// What was wrong with the log since the frame before.
    pub warnings: Vec<LogWarning>,
}
