use std::sync::Arc;

use nalgebra::Vector3;

use crate::geometry::RigidTransform;

/// One inertial sample in the IMU frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuSample {
    /// Header stamp since the log began.
    pub stamp_ns: i64,
    /// Angular velocity.
    pub angular_velocity_rad_per_s: Vector3<f64>,
    /// Specific force: +g upwards at rest.
    pub specific_force_m_per_s2: Vector3<f64>,
}

/// The joint angles of one instant, in the order of the rig's links, without the static offsets.
#[derive(Clone, Debug, PartialEq)]
pub struct JointSample {
    /// Header stamp since the log began.
    pub stamp_ns: i64,
    /// One angle per joint in radians.
    pub angles_rad: Vec<f64>,
}

/// The joint angles at an image's stamp as the encoders tell them, in the order of the rig's links, without the static
/// offsets.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointAngles {
    /// One angle per joint in radians.
    pub angles_rad: Vec<f64>,
    /// Standard deviation of each in radians: less than the rig's for one reading where several could be averaged.
    pub sigmas_rad: Vec<f64>,
    /// The part of it that neighbouring images share, so that no average takes it away (zero for white noise).
    pub lasting_sigmas_rad: Vec<f64>,
    /// How fast each joint turns in rad/s, as far as the readings around the stamp tell it; zero where they do not.
    pub rates_rad_per_s: Vec<f64>,
}

impl JointAngles {
    /// Bytes on the heap.
    pub fn heap_bytes(&self) -> usize {
        let all = [&self.angles_rad, &self.sigmas_rad, &self.lasting_sigmas_rad, &self.rates_rad_per_s];
        all.iter().map(|numbers| numbers.capacity() * size_of::<f64>()).sum()
    }
}

/// A ground-truth pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseSample {
    /// Header stamp since the log began.
    pub stamp_ns: i64,
    /// Pose of the IMU in the world.
    pub world_from_imu: RigidTransform,
}

/// An 8-bit grey image, rows top to bottom without padding.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GrayImage {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width · height` grey values.
    pub pixels: Vec<u8>,
}

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
