//! Protobuf messages of Foxglove, which Foxglove and Rerun both decode, with their definitions as a `FileDescriptorSet`.
//!
//! Field numbers: <https://github.com/foxglove/foxglove-sdk/tree/main/schemas/proto/foxglove>, and
//! `google/protobuf/descriptor.proto`.

use crate::geometry::RigidTransform;

/// Type of a field in a descriptor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum FieldType {
    Double,
    Int64,
    Int32,
    Text,
    Bytes,
    /// Another message by its full name, and whether the field is repeated.
    Message(&'static str, bool),
}

impl FieldType {
    /// Number of the type in `FieldDescriptorProto.Type`.
    fn number(self) -> u64 {
        match self {
            Self::Double => 1,
            Self::Int64 => 3,
            Self::Int32 => 5,
            Self::Text => 9,
            Self::Message(..) => 11,
            Self::Bytes => 12,
        }
    }
}

/// A message in a file of its own: package, name, and its fields in the order of their numbers from 1.
struct Descriptor {
    package: &'static str,
    name: &'static str,
    fields: &'static [(&'static str, FieldType)],
}

const TIMESTAMP: Descriptor = Descriptor {
    package: "google.protobuf",
    name: "Timestamp",
    fields: &[("seconds", FieldType::Int64), ("nanos", FieldType::Int32)],
};
const VECTOR3: Descriptor = Descriptor {
    package: "foxglove",
    name: "Vector3",
    fields: &[("x", FieldType::Double), ("y", FieldType::Double), ("z", FieldType::Double)],
};
const QUATERNION: Descriptor = Descriptor {
    package: "foxglove",
    name: "Quaternion",
    fields: &[("x", FieldType::Double), ("y", FieldType::Double), ("z", FieldType::Double), ("w", FieldType::Double)],
};
const POSE: Descriptor = Descriptor {
    package: "foxglove",
    name: "Pose",
    fields: &[
        ("position", FieldType::Message(".foxglove.Vector3", false)),
        ("orientation", FieldType::Message(".foxglove.Quaternion", false)),
    ],
};
const COMPRESSED_VIDEO: Descriptor = Descriptor {
    package: "foxglove",
    name: "CompressedVideo",
    fields: &[
        ("timestamp", FieldType::Message(".google.protobuf.Timestamp", false)),
        ("frame_id", FieldType::Text),
        ("data", FieldType::Bytes),
        ("format", FieldType::Text),
    ],
};
const POSES_IN_FRAME: Descriptor = Descriptor {
    package: "foxglove",
    name: "PosesInFrame",
    fields: &[
        ("timestamp", FieldType::Message(".google.protobuf.Timestamp", false)),
        ("frame_id", FieldType::Text),
        ("poses", FieldType::Message(".foxglove.Pose", true)),
    ],
};

/// Name of the type of a path.
pub(super) const POSES_TYPE: &str = "foxglove.PosesInFrame";

/// Bytes of a message under construction.
#[derive(Default)]
struct ProtobufWriter(Vec<u8>);

impl ProtobufWriter {
    fn varint(&mut self, mut number: u64) {
        while number >= 0x80 {
            self.0.push(number as u8 | 0x80);
            number >>= 7;
        }
        self.0.push(number as u8);
    }

    /// A number; zero is the default and not written.
    fn number(&mut self, field: u64, number: u64) {
        if number != 0 {
            self.varint(field << 3);
            self.varint(number);
        }
    }

    fn double(&mut self, field: u64, number: f64) {
        self.varint(field << 3 | 1);
        self.0.extend_from_slice(&number.to_le_bytes());
    }

    fn bytes(&mut self, field: u64, bytes: &[u8]) {
        self.varint(field << 3 | 2);
        self.varint(bytes.len() as u64);
        self.0.extend_from_slice(bytes);
    }

    fn message(&mut self, field: u64, write: impl FnOnce(&mut Self)) {
        let mut inner = Self::default();
        write(&mut inner);
        self.bytes(field, &inner.0);
    }
}

impl Descriptor {
    /// Path of the file, such as `foxglove/Pose.proto`; Google's has the name of its content.
    fn file(&self) -> String {
        let name = if self.package == "foxglove" { self.name.to_owned() } else { self.name.to_lowercase() };
        format!("{}/{name}.proto", self.package.replace('.', "/"))
    }

    /// `FileDescriptorProto`: name 1, package 2, dependency 3, `message_type` 4, syntax 12.
    fn write(&self, out: &mut ProtobufWriter, needed: &[Self]) {
        out.bytes(1, self.file().as_bytes());
        out.bytes(2, self.package.as_bytes());
        for other in needed {
            let full = format!(".{}.{}", other.package, other.name);
            if self.fields.iter().any(|(_, kind)| matches!(kind, FieldType::Message(name, _) if *name == full)) {
                out.bytes(3, other.file().as_bytes());
            }
        }
        out.message(4, |message| {
            message.bytes(1, self.name.as_bytes());
            for (number, (name, kind)) in self.fields.iter().enumerate() {
                // `FieldDescriptorProto`: name 1, number 3, label 4 (1 optional, 3 repeated), type 5, `type_name` 6.
                message.message(2, |field| {
                    field.bytes(1, name.as_bytes());
                    field.number(3, number as u64 + 1);
                    field.number(4, if matches!(kind, FieldType::Message(_, true)) { 3 } else { 1 });
                    field.number(5, kind.number());
                    if let FieldType::Message(name, _) = kind {
                        field.bytes(6, name.as_bytes());
                    }
                });
            }
        });
        out.bytes(12, b"proto3");
    }
}

/// `FileDescriptorSet` of a message, the files that it needs first.
fn descriptor_set(descriptor: &Descriptor, needed: &[Descriptor]) -> Vec<u8> {
    let mut out = ProtobufWriter::default();
    for file in needed.iter().chain([descriptor]) {
        out.message(1, |out| file.write(out, needed));
    }
    out.0
}

pub(super) fn compressed_video_definition() -> Vec<u8> {
    descriptor_set(&COMPRESSED_VIDEO, &[TIMESTAMP])
}

pub(super) fn poses_definition() -> Vec<u8> {
    descriptor_set(&POSES_IN_FRAME, &[TIMESTAMP, VECTOR3, QUATERNION, POSE])
}

fn timestamp(out: &mut ProtobufWriter, stamp_ns: i64) {
    const NS: i64 = 1_000_000_000;
    out.message(1, |time| {
        // A negative number is written as 64 bits in two's complement.
        time.number(1, stamp_ns.div_euclid(NS) as u64);
        time.number(2, stamp_ns.rem_euclid(NS) as u64);
    });
}

/// `foxglove.CompressedVideo`: one frame in Annex B; `format` is `h264` or `h265`.
pub(super) fn compressed_video(stamp_ns: i64, frame_id: &str, format: &str, data: &[u8]) -> Vec<u8> {
    let mut out = ProtobufWriter(Vec::with_capacity(data.len() + frame_id.len() + 64));
    timestamp(&mut out, stamp_ns);
    out.bytes(2, frame_id.as_bytes());
    out.bytes(3, data);
    out.bytes(4, format.as_bytes());
    out.0
}

/// `foxglove.PosesInFrame`: poses in `frame_id`, positions in metres.
pub(super) fn poses_in_frame<'a>(
    stamp_ns: i64,
    frame_id: &str,
    poses: impl Iterator<Item = &'a RigidTransform>,
) -> Vec<u8> {
    let mut out = ProtobufWriter::default();
    timestamp(&mut out, stamp_ns);
    out.bytes(2, frame_id.as_bytes());
    for pose in poses {
        out.message(3, |out| {
            let numbers = |field: u64, values: &[f64], out: &mut ProtobufWriter| {
                out.message(field, |out| {
                    for (number, value) in values.iter().enumerate() {
                        out.double(number as u64 + 1, *value);
                    }
                });
            };
            numbers(1, pose.translation_m.as_slice(), out);
            // The coordinates of a quaternion are x, y, z, w.
            numbers(2, pose.rotation.coords.as_slice(), out);
        });
    }
    out.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight_log::messages::protobuf::{ProtobufReader, ProtobufValue};

    /// Fields with bytes of a message, by their numbers.
    fn fields(message: &[u8]) -> Vec<(u64, Vec<u8>)> {
        let mut reader = ProtobufReader::new(message);
        let mut found = Vec::new();
        while let Some((number, value)) = reader.next_field().unwrap() {
            match value {
                ProtobufValue::Bytes(bytes) => found.push((number, bytes.to_vec())),
                ProtobufValue::Number(value) => found.push((number, value.to_le_bytes().to_vec())),
            }
        }
        found
    }

    #[test]
    fn a_definition_names_its_files_before_they_are_needed() {
        let files = fields(&poses_definition());
        let names: Vec<String> = files
            .iter()
            .map(|(number, file)| {
                assert_eq!(*number, 1);
                String::from_utf8(fields(file)[0].1.clone()).unwrap()
            })
            .collect();
        let expected = ["google/protobuf/timestamp", "foxglove/Vector3", "foxglove/Quaternion", "foxglove/Pose"];
        let expected = expected.into_iter().chain(["foxglove/PosesInFrame"]).map(|name| format!("{name}.proto"));
        assert!(names.iter().cloned().eq(expected), "{names:?}");
        for (index, (_, file)) in files.iter().enumerate() {
            let needed = fields(file).into_iter().filter(|(number, _)| *number == 3);
            for (_, name) in needed {
                let name = String::from_utf8(name).unwrap();
                assert!(names[..index].contains(&name), "{name} comes before {}", names[index]);
            }
        }
    }

    #[test]
    fn a_path_has_its_poses() {
        let pose = RigidTransform::new(
            nalgebra::UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3),
            nalgebra::Vector3::new(1.0, -2.0, 0.0),
        );
        let message = poses_in_frame(1_500_000_002, "world", [pose, pose].iter());
        let found = fields(&message);
        assert_eq!(found.iter().map(|(number, _)| *number).collect::<Vec<_>>(), [1, 2, 3, 3]);
        assert_eq!(found[1].1, b"world");
        let parts = fields(&found[2].1);
        let doubles = |message: &[u8]| -> Vec<f64> {
            fields(message).iter().map(|(_, bytes)| f64::from_le_bytes(bytes[..8].try_into().unwrap())).collect()
        };
        assert_eq!(doubles(&parts[0].1), [1.0, -2.0, 0.0]);
        assert_eq!(doubles(&parts[1].1), pose.rotation.coords.as_slice());
        let time: Vec<(u64, Vec<u8>)> = fields(&found[0].1);
        assert_eq!((time[0].1[0], time[1].1[..4].to_vec()), (1, 500_000_002_u32.to_le_bytes().to_vec()));
    }
}
