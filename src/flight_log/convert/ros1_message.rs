//! Conversion of messages from ROS 1 serialization to CDR.
//!
//! ROS 1 writes little-endian fields without padding; strings have no terminating zero, headers have a sequence number,
//! and stamps are unsigned. Otherwise the supported message types have the same fields in the same order in both.

use super::super::MessageKind;
use crate::flight_log::messages::cdr::CdrWriter;

/// Field, or several fields of one kind.
#[derive(Clone, Copy, Debug)]
enum Field {
    Header,
    U8,
    U16,
    U32,
    F32s(usize),
    Text,
    Texts,
    Bytes,
    F64s(usize),
    F64Sequence,
    /// Sequence of `geometry_msgs/TransformStamped`, as in a `TFMessage`.
    Transforms,
}

/// Child frame, translation and rotation.
const TRANSFORM: &[Field] = &[Field::Header, Field::Text, Field::F64s(7)];

/// Fields of a type in order, `None` if ROS 1 has other fields.
fn layout(kind: MessageKind) -> Option<&'static [Field]> {
    use Field::{Bytes, F32s, F64Sequence, F64s, Header, Text, Texts, Transforms, U8, U16, U32};
    Some(match kind {
        // Orientation, angular velocity, specific force, each with its covariance.
        MessageKind::Imu => &[Header, F64s(4 + 9 + 3 + 9 + 3 + 9)],
        // Height, width, encoding, is_bigendian, step, data.
        MessageKind::Image => &[Header, U32, U32, Text, U8, U32, Bytes],
        MessageKind::CompressedImage => &[Header, Text, Bytes],
        // Height, width, distortion, D, K R P, binning twice, region (x, y, height, width, rectify).
        MessageKind::CameraInfo => {
            &[Header, U32, U32, Text, F64Sequence, F64s(9 + 9 + 12), U32, U32, U32, U32, U32, U32, U8]
        }
        MessageKind::JointState => &[Header, Texts, F64Sequence, F64Sequence, F64Sequence],
        // Child frame, pose with covariance, twist with covariance.
        MessageKind::Odometry => &[Header, Text, F64s(7 + 36 + 6 + 36)],
        MessageKind::PoseStamped => &[Header, F64s(7)],
        MessageKind::TransformStamped => TRANSFORM,
        MessageKind::QuaternionStamped => &[Header, F64s(4)],
        MessageKind::Vector3Stamped => &[Header, F64s(3)],
        MessageKind::Transforms => &[Transforms],
        // Target, flags, quaternion, angular velocity, failures.
        MessageKind::MavrosGimbalAttitude => &[Header, U8, U8, U16, F64s(4), F32s(3), U32],
        MessageKind::CompressedVideo
        | MessageKind::CompressedVideoProtobuf
        | MessageKind::FfmpegPacket
        | MessageKind::Px4GimbalAttitude
        | MessageKind::Px4VehicleAttitude => return None,
    })
}

/// Converts a message in ROS 1 serialization to CDR, or returns a description of the problem.
pub(super) fn cdr_from_ros1(kind: MessageKind, message: &[u8]) -> Result<Vec<u8>, String> {
    let mut reader = Ros1Reader { message, position: 0 };
    let mut out = CdrWriter::new();
    let fields = layout(kind).ok_or("such messages of ROS 1 are not read: convert the bag to ROS 2 or MCAP")?;
    copy_fields(fields, &mut reader, &mut out)?;
    let rest = message.len() - reader.position;
    if rest > 0 {
        return Err(format!("{rest} bytes more than a {} has", kind.schema_name()));
    }
    Ok(out.finish())
}

fn copy_fields(fields: &[Field], reader: &mut Ros1Reader<'_>, out: &mut CdrWriter) -> Result<(), String> {
    for field in fields {
        match *field {
            Field::Header => {
                reader.u32()?; // sequence number, absent in ROS 2
                let seconds = reader.u32()?;
                let seconds =
                    i32::try_from(seconds).map_err(|_too_late| format!("a stamp of {seconds} s, after 2038"))?;
                out.i32(seconds);
                out.u32(reader.u32()?);
                out.string(reader.text()?);
            }
            Field::U8 => out.u8(reader.take(1)?[0]),
            Field::U16 => {
                let mut bytes = [0; 2];
                bytes.copy_from_slice(reader.take(2)?);
                out.u16(u16::from_le_bytes(bytes));
            }
            Field::F32s(count) => {
                for _ in 0..count {
                    out.f32(f32::from_bits(reader.u32()?));
                }
            }
            Field::Transforms => {
                let count = reader.length(4)?;
                out.u32(count as u32);
                for _ in 0..count {
                    copy_fields(TRANSFORM, reader, out)?;
                }
            }
            Field::U32 => out.u32(reader.u32()?),
            Field::Text => out.string(reader.text()?),
            Field::Texts => {
                let count = reader.length(4)?;
                let texts: Vec<String> =
                    (0..count).map(|_| reader.text().map(str::to_owned)).collect::<Result<_, _>>()?;
                out.strings(&texts);
            }
            Field::Bytes => {
                let count = reader.length(1)?;
                out.bytes(reader.take(count)?);
            }
            Field::F64s(count) => out.f64s(&reader.f64s(count)?),
            Field::F64Sequence => {
                let count = reader.length(8)?;
                out.f64_sequence(&reader.f64s(count)?);
            }
        }
    }
    Ok(())
}

/// Reads fields in order with bounds checks.
struct Ros1Reader<'a> {
    message: &'a [u8],
    position: usize,
}

impl<'a> Ros1Reader<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        let end = self.position.checked_add(count);
        let bytes = end.and_then(|end| self.message.get(self.position..end));
        let bytes = bytes.ok_or_else(|| {
            format!("the message ends at byte {} inside a field of {count} bytes", self.message.len())
        })?;
        self.position += count;
        Ok(bytes)
    }

    fn u32(&mut self) -> Result<u32, String> {
        let mut bytes = [0; 4];
        bytes.copy_from_slice(self.take(4)?);
        Ok(u32::from_le_bytes(bytes))
    }

    /// Reads the length of a sequence; an error if the remaining message is too short for it.
    fn length(&mut self, element_size: usize) -> Result<usize, String> {
        let count = self.u32()? as usize;
        if count.saturating_mul(element_size) > self.message.len() - self.position {
            return Err(format!("{count} elements in a message of {} bytes", self.message.len()));
        }
        Ok(count)
    }

    fn text(&mut self) -> Result<&'a str, String> {
        let count = self.length(1)?;
        std::str::from_utf8(self.take(count)?).map_err(|error| format!("a text is not UTF-8 ({error})"))
    }

    fn f64s(&mut self, count: usize) -> Result<Vec<f64>, String> {
        let bytes = self.take(count.saturating_mul(8))?;
        let number = |bytes: &[u8]| bytes.iter().rev().fold(0, |bits, byte| bits << 8 | u64::from(*byte));
        Ok(bytes.chunks_exact(8).map(|bytes| f64::from_bits(number(bytes))).collect())
    }
}
