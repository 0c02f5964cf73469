//! Encoders of log messages as CDR.

use nalgebra::{Matrix6, UnitQuaternion, Vector3};

use crate::camera::{CameraModel, Distortion};
use crate::flight_log::messages::cdr::CdrWriter;
use crate::geometry::RigidTransform;

/// Starts a message with a header.
pub(super) fn with_header(stamp_ns: i64, frame_id: &str) -> CdrWriter {
    let mut out = CdrWriter::new();
    out.i32(stamp_ns.div_euclid(1_000_000_000) as i32);
    out.u32(stamp_ns.rem_euclid(1_000_000_000) as u32);
    out.string(frame_id);
    out
}

pub(super) fn put_rotation(out: &mut CdrWriter, rotation: &UnitQuaternion<f64>) {
    out.f64s(&[rotation.i, rotation.j, rotation.k, rotation.w]);
}

/// `sensor_msgs/msg/Imu` without an orientation (the first entry of its covariance is −1).
pub(in super::super) fn imu(
    stamp_ns: i64,
    frame_id: &str,
    angular_velocity_rad_per_s: &Vector3<f64>,
    specific_force_m_per_s2: &Vector3<f64>,
) -> Vec<u8> {
    let mut out = with_header(stamp_ns, frame_id);
    put_rotation(&mut out, &UnitQuaternion::identity());
    out.f64s(&[-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    out.f64s(angular_velocity_rad_per_s.as_slice());
    out.f64s(&[0.0; 9]);
    out.f64s(specific_force_m_per_s2.as_slice());
    out.f64s(&[0.0; 9]);
    out.finish()
}

/// `sensor_msgs/msg/Image` of any encoding, rows without padding.
pub(in super::super) fn image(
    stamp_ns: i64,
    frame_id: &str,
    [width, height]: [usize; 2],
    encoding: &str,
    data: &[u8],
) -> Vec<u8> {
    let mut out = with_header(stamp_ns, frame_id);
    out.u32(height as u32);
    out.u32(width as u32);
    out.string(encoding);
    out.u8(0);
    out.u32(data.len().checked_div(height).unwrap_or(0) as u32);
    out.bytes(data);
    out.finish()
}

/// `foxglove_msgs/msg/CompressedVideo` of other writers: one frame in Annex B.
#[cfg(test)]
pub(in super::super) fn compressed_video(stamp_ns: i64, frame_id: &str, format: &str, data: &[u8]) -> Vec<u8> {
    let mut out = with_header(stamp_ns, frame_id);
    out.bytes(data);
    out.string(format);
    out.finish()
}

/// Message `sensor_msgs/msg/CompressedImage` in CDR.
pub(in super::super) fn compressed_image(stamp_ns: i64, frame_id: &str, format: &str, data: &[u8]) -> Vec<u8> {
    let mut out = with_header(stamp_ns, frame_id);
    out.string(format);
    out.bytes(data);
    out.finish()
}

/// `sensor_msgs/msg/CameraInfo` of a pinhole camera (for other projections K alone does not describe it).
pub(in super::super) fn camera_info(stamp_ns: i64, frame_id: &str, model: &CameraModel) -> Vec<u8> {
    let mut out = with_header(stamp_ns, frame_id);
    let [width, height] = model.resolution_px;
    out.u32(height as u32);
    out.u32(width as u32);
    let (name, coefficients) = distortion(&model.distortion);
    out.string(name);
    out.f64_sequence(&coefficients);
    let [fx, fy, cx, cy] = model.intrinsics_px;
    out.f64s(&[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]);
    out.f64s(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    out.f64s(&[fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]);
    for _binning in 0..2 {
        out.u32(0);
    }
    for _region in 0..4 {
        out.u32(0);
    }
    out.u8(0);
    out.finish()
}

/// ROS name of a distortion model and its coefficients.
fn distortion(distortion: &Distortion) -> (&'static str, Vec<f64>) {
    match distortion {
        Distortion::None => ("plumb_bob", vec![0.0; 5]),
        Distortion::Radtan([k1, k2, p1, p2]) => ("plumb_bob", vec![*k1, *k2, *p1, *p2, 0.0]),
        Distortion::Rational(lens) if lens.is_polynomial() => ("plumb_bob", lens.coefficients()[..5].to_vec()),
        Distortion::Rational(lens) => ("rational_polynomial", lens.coefficients().to_vec()),
        Distortion::Equidistant(coefficients) => ("equidistant", coefficients.to_vec()),
        Distortion::Fov(angle_rad) => ("fov", vec![*angle_rad]),
    }
}

/// `sensor_msgs/msg/JointState` with positions only.
pub(in super::super) fn joint_state(stamp_ns: i64, names: &[String], positions_rad: &[f64]) -> Vec<u8> {
    let mut out = with_header(stamp_ns, "");
    out.strings(names);
    out.f64_sequence(positions_rad);
    out.f64_sequence(&[]);
    out.f64_sequence(&[]);
    out.finish()
}

/// Pose of a frame in another one with its velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Odometry<'a> {
    /// Frame in which the pose is given.
    pub frame_id: &'a str,
    /// Frame with this pose.
    pub child_frame_id: &'a str,
    /// Pose `frame_from_child` of the odometry.
    pub pose: RigidTransform,
    /// Covariance of the pose: position (m), then rotations about the axes of `frame_id` (rad); zero if unknown.
    pub pose_covariance: Matrix6<f64>,
    /// Velocity in the child frame, in m/s.
    pub linear_m_per_s: Vector3<f64>,
    /// Angular velocity in the child frame, in rad/s.
    pub angular_rad_per_s: Vector3<f64>,
}

impl<'a> Odometry<'a> {
    /// Stationary pose of unknown covariance.
    pub fn at_rest(frame_id: &'a str, child_frame_id: &'a str, pose: RigidTransform) -> Self {
        Self {
            frame_id,
            child_frame_id,
            pose,
            pose_covariance: Matrix6::zeros(),
            linear_m_per_s: Vector3::zeros(),
            angular_rad_per_s: Vector3::zeros(),
        }
    }
}

/// `nav_msgs/msg/Odometry` with a zero covariance of the velocities.
pub(in super::super) fn odometry(stamp_ns: i64, odometry: &Odometry<'_>) -> Vec<u8> {
    let mut out = with_header(stamp_ns, odometry.frame_id);
    out.string(odometry.child_frame_id);
    out.f64s(odometry.pose.translation_m.as_slice());
    put_rotation(&mut out, &odometry.pose.rotation);
    // The matrix is symmetric, so that the order of rows and columns is the same.
    out.f64s(odometry.pose_covariance.as_slice());
    out.f64s(odometry.linear_m_per_s.as_slice());
    out.f64s(odometry.angular_rad_per_s.as_slice());
    out.f64s(&[0.0; 36]);
    out.finish()
}

/// Message `geometry_msgs/msg/PoseStamped` in CDR.
pub(in super::super) fn pose_stamped(stamp_ns: i64, frame_id: &str, pose: &RigidTransform) -> Vec<u8> {
    let mut out = with_header(stamp_ns, frame_id);
    out.f64s(pose.translation_m.as_slice());
    put_rotation(&mut out, &pose.rotation);
    out.finish()
}

/// Message `geometry_msgs/msg/TransformStamped` in CDR.
pub(in super::super) fn transform_stamped(
    stamp_ns: i64,
    frame_id: &str,
    child_frame_id: &str,
    pose: &RigidTransform,
) -> Vec<u8> {
    let mut out = with_header(stamp_ns, frame_id);
    out.string(child_frame_id);
    out.f64s(pose.translation_m.as_slice());
    put_rotation(&mut out, &pose.rotation);
    out.finish()
}

/// Message `geometry_msgs/msg/QuaternionStamped` in CDR.
pub(in super::super) fn quaternion_stamped(stamp_ns: i64, frame_id: &str, rotation: &UnitQuaternion<f64>) -> Vec<u8> {
    let mut out = with_header(stamp_ns, frame_id);
    put_rotation(&mut out, rotation);
    out.finish()
}
