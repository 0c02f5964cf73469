use std::sync::Arc;

use super::LogWarning;
use crate::geometry::RigidTransform;
use crate::sensors::{GrayImage, ImuSample, JointAngles};

/// Image of one camera with the measurements that belong to it: the input of front end and estimator in one step.
#[derive(Clone, Debug)]
pub struct SensorFrame {
    /// Number of the image in its camera's stream, from 0, over the entire log. Skipped images keep their number, so
    /// that it depends neither on the start of a replay nor on earlier damage.
    pub index: usize,
    /// Header stamp of the image since the start of the log, in camera time.
    pub stamp_ns: i64,
    /// Log time of the image since the start of the log.
    pub log_time_ns: i64,
    /// 8-bit gray values.
    pub image: Arc<GrayImage>,
    /// IMU samples from the previous frame's stamp to this one's, both ends included: the first and the last are
    /// interpolated exactly at the stamps (shifted by the rig's `timeshift_cam_imu`).
    /// The first frame has the samples of at most 2 s before it.
    pub imu: Vec<ImuSample>,
    /// IMU samples after the stamp, the first one at the stamp; empty unless requested from the stream.
    pub imu_after: Vec<ImuSample>,
    /// Samples of the IMU on the gimbal from the previous frame's stamp to this one's, both ends included and
    /// interpolated, on the clock of `imu`; empty without such an IMU or where its samples are missing.
    pub gimbal_imu: Vec<ImuSample>,
    /// Encoder angles at the stamp, from all readings around it; `None` without encoders or if none lies within 0.1 s.
    pub joint_angles: Option<JointAngles>,
    /// Ground truth `world_from_imu` interpolated at the stamp: for comparison and display only, never for estimation.
    pub ground_truth: Option<RigidTransform>,
    /// Problems of the log since the previous frame.
    pub warnings: Vec<LogWarning>,
}
