//! Messages for display in viewers (Foxglove, Rerun, RViz): paths, transform trees, point clouds, image annotations,
//! log lines, and rows of named numbers.

use nalgebra::{Vector2, Vector3};

use super::super::LogError;
use super::schemas::{self, compose};
use super::{LogWriter, MessageTimes, MessageType, encode, protobuf};
use crate::flight_log::messages::cdr::CdrWriter;
use crate::geometry::RigidTransform;

/// Pose of a frame in its parent frame.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedTransform {
    pub parent: String,
    pub child: String,
    /// Transform `parent_from_child` of the frames.
    pub pose: RigidTransform,
}

/// Red, green, blue and opacity, each from 0 to 1.
pub type Rgba = [f64; 4];

/// Circular keypoint marker in an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CircleAnnotation {
    /// Centre in pixels, pixel centres at whole numbers.
    pub center_px: Vector2<f64>,
    pub diameter_px: f64,
    pub color: Rgba,
}

/// Separate straight lines in an image, in one colour.
#[derive(Clone, Debug, PartialEq)]
pub struct LinesAnnotation {
    /// Both ends of each line in pixels, pixel centres at whole numbers.
    pub lines_px: Vec<[Vector2<f64>; 2]>,
    pub color: Rgba,
}

/// Severity of a log line, with the numbers of ROS 2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LogLevel {
    Debug = 10,
    Info = 20,
    /// Problem that did not stop the run.
    Warning = 30,
    /// Problem that stopped the run.
    Error = 40,
}

/// Line width of annotations in pixels.
const THICKNESS_PX: f64 = 1.0;
/// `LINE_LIST` of Foxglove's points annotation.
const LINE_LIST: u8 = 4;
/// Offset of pixel coordinates: viewers count from the corner of the first pixel, this program from its centre.
const PIXEL_CENTER: f64 = 0.5;
/// `FLOAT32` and `UINT32` of `sensor_msgs/msg/PointField`.
const FLOAT32: u8 = 7;
const UINT32: u8 = 6;

fn put_time(out: &mut CdrWriter, stamp_ns: i64) {
    out.i32(stamp_ns.div_euclid(1_000_000_000) as i32);
    out.u32(stamp_ns.rem_euclid(1_000_000_000) as u32);
}

fn put_pose(out: &mut CdrWriter, pose: &RigidTransform) {
    out.f64s(pose.translation_m.as_slice());
    encode::put_rotation(out, &pose.rotation);
}

fn put_point(out: &mut CdrWriter, point_px: &Vector2<f64>) {
    out.f64s(&[point_px.x + PIXEL_CENTER, point_px.y + PIXEL_CENTER]);
}

impl LogWriter {
    /// Writes poses in one frame as `foxglove.PosesInFrame` in protobuf.
    pub fn write_poses<'a>(
        &mut self,
        topic: &str,
        frame_id: &str,
        times: MessageTimes,
        poses: impl Iterator<Item = &'a RigidTransform>,
    ) -> Result<(), LogError> {
        let message_type = MessageType::protobuf(protobuf::POSES_TYPE, protobuf::poses_definition());
        self.write_typed(topic, &message_type, times, &protobuf::poses_in_frame(times.stamp_ns, frame_id, poses))
    }

    /// Writes poses in one frame as `nav_msgs/msg/Path`, each with its stamp.
    pub fn write_path(
        &mut self,
        topic: &str,
        frame_id: &str,
        times: MessageTimes,
        poses: &[(i64, RigidTransform)],
    ) -> Result<(), LogError> {
        let mut out = encode::with_header(times.stamp_ns, frame_id);
        out.u32(poses.len() as u32);
        for (stamp_ns, pose) in poses {
            put_time(&mut out, *stamp_ns);
            out.string(frame_id);
            put_pose(&mut out, pose);
        }
        let message_type = MessageType::ros2("nav_msgs/msg/Path", compose(&schemas::PATH));
        self.write_typed(topic, &message_type, times, &out.finish())
    }

    /// Writes a tree of frames as `tf2_msgs/msg/TFMessage`.
    pub fn write_transforms(
        &mut self,
        topic: &str,
        times: MessageTimes,
        transforms: &[NamedTransform],
    ) -> Result<(), LogError> {
        let mut out = CdrWriter::new();
        out.u32(transforms.len() as u32);
        for transform in transforms {
            put_time(&mut out, times.stamp_ns);
            out.string(&transform.parent);
            out.string(&transform.child);
            put_pose(&mut out, &transform.pose);
        }
        let message_type = MessageType::ros2("tf2_msgs/msg/TFMessage", compose(&schemas::TRANSFORMS));
        self.write_typed(topic, &message_type, times, &out.finish())
    }

    /// Writes points with ids as `sensor_msgs/msg/PointCloud2` (x, y, z as 4-byte floats, id as integer).
    pub fn write_points(
        &mut self,
        topic: &str,
        frame_id: &str,
        times: MessageTimes,
        points: &[(u32, Vector3<f64>)],
    ) -> Result<(), LogError> {
        const POINT_BYTES: u32 = 16;
        let mut out = encode::with_header(times.stamp_ns, frame_id);
        out.u32(1); // height: not organized
        out.u32(points.len() as u32);
        let fields = [("x", FLOAT32), ("y", FLOAT32), ("z", FLOAT32), ("id", UINT32)];
        out.u32(fields.len() as u32);
        for (index, (name, datatype)) in fields.into_iter().enumerate() {
            out.string(name);
            out.u32(4 * index as u32);
            out.u8(datatype);
            out.u32(1);
        }
        out.u8(0); // little-endian
        out.u32(POINT_BYTES);
        out.u32(POINT_BYTES * points.len() as u32);
        let mut data = Vec::with_capacity(POINT_BYTES as usize * points.len());
        for (id, point) in points {
            data.extend(point.iter().flat_map(|value| (*value as f32).to_le_bytes()));
            data.extend(id.to_le_bytes());
        }
        out.bytes(&data);
        out.u8(1); // dense: no invalid points
        let message_type = MessageType::ros2("sensor_msgs/msg/PointCloud2", compose(&schemas::POINT_CLOUD));
        self.write_typed(topic, &message_type, times, &out.finish())
    }

    /// Writes circles and lines over the image with the same stamp as `foxglove_msgs/msg/ImageAnnotations`.
    pub fn write_annotations(
        &mut self,
        topic: &str,
        times: MessageTimes,
        circles: &[CircleAnnotation],
        lines: &[LinesAnnotation],
    ) -> Result<(), LogError> {
        const TRANSPARENT: Rgba = [0.0; 4];
        let mut out = CdrWriter::new();
        out.u32(circles.len() as u32);
        for circle in circles {
            put_time(&mut out, times.stamp_ns);
            put_point(&mut out, &circle.center_px);
            out.f64s(&[circle.diameter_px, THICKNESS_PX]);
            out.f64s(&TRANSPARENT);
            out.f64s(&circle.color);
        }
        out.u32(lines.len() as u32);
        for group in lines {
            put_time(&mut out, times.stamp_ns);
            out.u8(LINE_LIST);
            out.u32(2 * group.lines_px.len() as u32);
            group.lines_px.iter().flatten().for_each(|point_px| put_point(&mut out, point_px));
            out.f64s(&group.color);
            out.u32(0); // no separate colours
            out.f64s(&TRANSPARENT);
            out.f64s(&[THICKNESS_PX]);
        }
        out.u32(0); // no texts
        let message_type =
            MessageType::ros2("foxglove_msgs/msg/ImageAnnotations", compose(&schemas::IMAGE_ANNOTATIONS));
        self.write_typed(topic, &message_type, times, &out.finish())
    }

    /// Writes a log line as `rcl_interfaces/msg/Log`.
    pub fn write_log_line(
        &mut self,
        topic: &str,
        times: MessageTimes,
        level: LogLevel,
        name: &str,
        text: &str,
    ) -> Result<(), LogError> {
        let mut out = CdrWriter::new();
        put_time(&mut out, times.stamp_ns);
        out.u8(level as u8);
        for text in [name, text, "", ""] {
            out.string(text);
        }
        out.u32(0);
        let message_type = MessageType::ros2("rcl_interfaces/msg/Log", compose(&schemas::LOG_LINE));
        self.write_typed(topic, &message_type, times, &out.finish())
    }

    /// Writes named numbers as a message with a field for each, so that viewers plot them by name.
    ///
    /// `type_name` is `package/msg/Name`; all messages of a topic have the same names in the same order.
    pub fn write_row(
        &mut self,
        topic: &str,
        type_name: &str,
        times: MessageTimes,
        row: &[(&str, f64)],
    ) -> Result<(), LogError> {
        let mut out = encode::with_header(times.stamp_ns, "");
        for (_, value) in row {
            out.f64s(&[*value]);
        }
        let fields = field_names(row.iter().map(|(name, _)| *name));
        let fields: Vec<String> = fields.iter().map(|field| ["\nfloat64 ", field].concat()).collect();
        let definition = ["std_msgs/Header header", &fields.concat()].concat();
        let message_type = MessageType::ros2(type_name, schemas::compose(&(&definition, schemas::HEADER_NEEDS)));
        self.write_typed(topic, &message_type, times, &out.finish())
    }
}

/// Converts names to valid ROS 2 field names (lower case, digits, single underscores, a letter first), each once.
fn field_names<'a>(names: impl Iterator<Item = &'a str>) -> Vec<String> {
    let mut fields: Vec<String> = Vec::new();
    for name in names {
        let mut field = String::new();
        for letter in name.chars().map(|letter| letter.to_ascii_lowercase()) {
            if letter.is_ascii_alphanumeric() {
                field.push(letter);
            } else if !field.is_empty() && !field.ends_with('_') {
                field.push('_');
            }
        }
        let field = field.trim_end_matches('_');
        let field = if field.starts_with(|first: char| first.is_ascii_alphabetic()) {
            field.to_owned()
        } else {
            format!("field_{field}").trim_end_matches('_').to_owned()
        };
        let mut unique = field.clone();
        let mut number = 2;
        while fields.contains(&unique) {
            unique = format!("{field}_{number}");
            number += 1;
        }
        fields.push(unique);
    }
    fields
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_fields_that_ros_allows() {
        let names = ["yaw.alpha_rad", "IB.rx", "IB RX", "1st", "  ", "Größe", "a__b."];
        let expected = ["yaw_alpha_rad", "ib_rx", "ib_rx_2", "field_1st", "field", "gr_e", "a_b"];
        assert_eq!(field_names(names.into_iter()), expected);
    }
}
