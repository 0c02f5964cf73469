//! Attitudes of gimbals and vehicles.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::cdr::{CdrError, CdrReader};
use super::{AttitudeLayout, MessageKind, read_header, read_px4_stamp};
use crate::sensors::AttitudeValue;

/// Largest number of transforms in a message; robots publish some dozens.
const MAX_TRANSFORMS: usize = 4096;

/// Message with an attitude; `None` for numbers that are not finite or a zero quaternion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StampedRotation<T> {
    /// Nanoseconds since the epoch, or since PX4 started.
    pub(crate) stamp_ns: i64,
    pub(crate) content: Option<T>,
}

/// Rotation of a quaternion, `None` if its norm differs from 1 by more than rounding (32-bit numbers).
fn rotation([x, y, z, w]: [f64; 4]) -> Option<UnitQuaternion<f64>> {
    let quaternion = Quaternion::new(w, x, y, z);
    let norm = quaternion.norm();
    (norm.is_finite() && norm > 0.5).then(|| UnitQuaternion::new_normalize(quaternion))
}

/// Reads a quaternion of PX4, which begins with w.
fn read_px4_rotation(
    layout: AttitudeLayout,
    reader: &mut CdrReader<'_>,
) -> Result<Option<UnitQuaternion<f64>>, CdrError> {
    reader.go_to(layout.rotation);
    let [w, x, y, z] = reader.read_f32s::<4>()?.map(f64::from);
    Ok(rotation([x, y, z, w]))
}

/// Skips to the orientation of a message with a header and reads it.
fn read_stamped_rotation(
    layout: AttitudeLayout,
    reader: &mut CdrReader<'_>,
) -> Result<(i64, Option<UnitQuaternion<f64>>), CdrError> {
    let kind = layout.kind;
    if kind == MessageKind::Px4VehicleAttitude {
        return Ok((read_px4_stamp(reader)?, read_px4_rotation(layout, reader)?));
    }
    let header = read_header(reader)?;
    if matches!(kind, MessageKind::Odometry | MessageKind::TransformStamped) {
        reader.read_string()?; // child_frame_id
    }
    if !matches!(kind, MessageKind::QuaternionStamped | MessageKind::Imu) {
        reader.read_f64s::<3>()?; // position
    }
    Ok((header.stamp_ns, rotation(reader.read_f64s::<4>()?)))
}

/// Reads the attitude of a gimbal from a message of any kind but `Transforms`.
pub(crate) fn read_gimbal_attitude(
    layout: AttitudeLayout,
    message: &[u8],
) -> Result<StampedRotation<AttitudeValue>, CdrError> {
    let mut reader = CdrReader::new(message)?;
    let reader = &mut reader;
    let (stamp_ns, content) = match layout.kind {
        MessageKind::Vector3Stamped => {
            let header = read_header(reader)?;
            let vector = Vector3::from(reader.read_f64s::<3>()?);
            let finite = vector.iter().all(|value| value.is_finite());
            (header.stamp_ns, finite.then_some(AttitudeValue::Vector(vector)))
        }
        MessageKind::Px4GimbalAttitude => {
            let stamp_ns = read_px4_stamp(reader)?;
            reader.go_to(layout.flags);
            let flags = reader.read_u16()?;
            let rotation = read_px4_rotation(layout, reader)?;
            (stamp_ns, rotation.map(|rotation| AttitudeValue::Flagged(rotation, flags)))
        }
        MessageKind::MavrosGimbalAttitude => {
            let header = read_header(reader)?;
            reader.read_u8()?; // target_system
            reader.read_u8()?; // target_component
            let flags = reader.read_u16()?;
            let rotation = rotation(reader.read_f64s::<4>()?);
            (header.stamp_ns, rotation.map(|rotation| AttitudeValue::Flagged(rotation, flags)))
        }
        _ => {
            let (stamp_ns, rotation) = read_stamped_rotation(layout, reader)?;
            (stamp_ns, rotation.map(AttitudeValue::Rotation))
        }
    };
    Ok(StampedRotation { stamp_ns, content })
}

/// Reads the attitude of a vehicle, `earth_from_vehicle`, from a message of any kind with an orientation.
pub(crate) fn read_vehicle_attitude(
    layout: AttitudeLayout,
    message: &[u8],
) -> Result<StampedRotation<UnitQuaternion<f64>>, CdrError> {
    let mut reader = CdrReader::new(message)?;
    let (stamp_ns, mut content) = read_stamped_rotation(layout, &mut reader)?;
    if layout.kind == MessageKind::Imu {
        // A first covariance of −1 means that there is no orientation.
        let [first, ..] = reader.read_f64s::<9>()?;
        content = content.filter(|_| first >= 0.0);
    }
    Ok(StampedRotation { stamp_ns, content })
}

/// Transform of a `tf2_msgs/msg/TFMessage`; without a rotation if its numbers are invalid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TransformEntry<'a> {
    pub(crate) stamp_ns: i64,
    pub(crate) parent: &'a str,
    pub(crate) child: &'a str,
    /// Rotation `parent_from_child`; `None` for an invalid quaternion.
    pub(crate) rotation: Option<UnitQuaternion<f64>>,
}

/// Reads the transforms of a message; a leading slash of frame names is removed.
pub(crate) fn read_transforms(message: &[u8]) -> Result<Vec<TransformEntry<'_>>, CdrError> {
    let mut reader = CdrReader::new(message)?;
    let count = reader.read_u32()? as usize;
    let mut entries = Vec::with_capacity(count.min(MAX_TRANSFORMS));
    for _ in 0..count.min(MAX_TRANSFORMS) {
        let header = read_header(&mut reader)?;
        let child = reader.read_string()?;
        reader.read_f64s::<3>()?; // translation
        let rotation = rotation(reader.read_f64s::<4>()?);
        entries.push(TransformEntry {
            stamp_ns: header.stamp_ns,
            parent: bare_name(header.frame_id),
            child: bare_name(child),
            rotation,
        });
    }
    Ok(entries)
}

/// Frame name without the leading slash of early ROS 1.
pub(crate) fn bare_name(frame: &str) -> &str {
    frame.strip_prefix('/').unwrap_or(frame)
}
