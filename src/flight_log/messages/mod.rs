//! ROS messages of a flight log, decoded from CDR.

mod attitudes;
pub(crate) mod cdr;
pub(crate) mod protobuf;
mod px4;
mod video_codec;

pub(crate) use self::px4::AttitudeLayout;
pub(crate) use self::video_codec::VideoCodec;
pub(crate) use attitudes::{bare_name, read_gimbal_attitude, read_transforms, read_vehicle_attitude};

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use self::cdr::{CdrError, CdrReader};
use self::protobuf::{ProtobufReader, ProtobufValue};
use crate::geometry::RigidTransform;
use crate::text::Named;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum MessageKind {
    Imu,
    Image,
    CompressedImage,
    CompressedVideo,
    CompressedVideoProtobuf,
    FfmpegPacket,
    CameraInfo,
    JointState,
    Odometry,
    PoseStamped,
    TransformStamped,
    QuaternionStamped,
    Vector3Stamped,
    Transforms,
    MavrosGimbalAttitude,
    Px4GimbalAttitude,
    Px4VehicleAttitude,
}

impl Named for MessageKind {
    const NAMES: &'static [(Self, &'static str)] = &[
        (Self::Imu, "sensor_msgs/msg/Imu"),
        (Self::Image, "sensor_msgs/msg/Image"),
        (Self::CompressedImage, "sensor_msgs/msg/CompressedImage"),
        (Self::CompressedVideo, "foxglove_msgs/msg/CompressedVideo"),
        (Self::CompressedVideoProtobuf, "foxglove.CompressedVideo"),
        (Self::FfmpegPacket, "ffmpeg_image_transport_msgs/msg/FFMPEGPacket"),
        (Self::CameraInfo, "sensor_msgs/msg/CameraInfo"),
        (Self::JointState, "sensor_msgs/msg/JointState"),
        (Self::Odometry, "nav_msgs/msg/Odometry"),
        (Self::PoseStamped, "geometry_msgs/msg/PoseStamped"),
        (Self::TransformStamped, "geometry_msgs/msg/TransformStamped"),
        (Self::QuaternionStamped, "geometry_msgs/msg/QuaternionStamped"),
        (Self::Vector3Stamped, "geometry_msgs/msg/Vector3Stamped"),
        (Self::Transforms, "tf2_msgs/msg/TFMessage"),
        (Self::MavrosGimbalAttitude, "mavros_msgs/msg/GimbalDeviceAttitudeStatus"),
        (Self::Px4GimbalAttitude, "px4_msgs/msg/GimbalDeviceAttitudeStatus"),
        (Self::Px4VehicleAttitude, "px4_msgs/msg/VehicleAttitude"),
    ];
}

impl MessageKind {
    /// Name of the schema in the log.
    pub fn schema_name(self) -> &'static str {
        self.name()
    }

    /// Kind with this schema name; `sensor_msgs/Imu` equals `sensor_msgs/msg/Imu`.
    pub fn from_schema_name(name: &str) -> Option<Self> {
        Self::all().find(|kind| {
            let full = kind.schema_name();
            name == full || name == full.replace("/msg/", "/")
        })
    }

    /// Kind of a channel with this schema name, `None` if its encoding is not the kind's.
    pub fn of_channel(schema_name: &str, encoding: &str) -> Option<Self> {
        Self::from_schema_name(schema_name).filter(|kind| kind.encoding() == encoding)
    }

    pub fn encoding(self) -> &'static str {
        if self == Self::CompressedVideoProtobuf { "protobuf" } else { "cdr" }
    }

    /// Kinds whose messages are images or video frames.
    pub const IMAGES: [Self; 5] =
        [Self::Image, Self::CompressedImage, Self::CompressedVideo, Self::CompressedVideoProtobuf, Self::FfmpegPacket];

    /// True if the messages are images or video frames.
    pub fn is_image(self) -> bool {
        Self::IMAGES.contains(&self)
    }

    /// True if the messages are video frames, which depend on earlier ones.
    pub fn is_video(self) -> bool {
        matches!(self, Self::CompressedVideo | Self::CompressedVideoProtobuf | Self::FfmpegPacket)
    }

    /// True if the messages are attitudes of a gimbal or of the vehicle. Robots record such messages for many purposes,
    /// with stamps of other times (static transforms) and clocks (PX4), so that they do not define the start of a log.
    pub fn is_attitude(self) -> bool {
        matches!(self, Self::QuaternionStamped | Self::Vector3Stamped | Self::Transforms | Self::MavrosGimbalAttitude)
            || self.counts_since_boot()
    }

    /// True if the stamps are in microseconds, by default of PX4's clock, which counts from its start.
    pub fn counts_since_boot(self) -> bool {
        matches!(self, Self::Px4GimbalAttitude | Self::Px4VehicleAttitude)
    }
}

/// Header of a message, `std_msgs/msg/Header`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Header<'a> {
    /// Nanoseconds since the epoch.
    pub(crate) stamp_ns: i64,
    pub(crate) frame_id: &'a str,
}

pub(in crate::flight_log) fn read_header<'a>(reader: &mut CdrReader<'a>) -> Result<Header<'a>, CdrError> {
    let seconds = i64::from(reader.read_i32()?);
    let nanoseconds = i64::from(reader.read_u32()?);
    let frame_id = reader.read_string()?;
    Ok(Header { stamp_ns: seconds * 1_000_000_000 + nanoseconds, frame_id })
}

/// Stamp in nanoseconds from one in microseconds.
fn read_px4_stamp(reader: &mut CdrReader<'_>) -> Result<i64, CdrError> {
    let microseconds = i64::try_from(reader.read_u64()?).unwrap_or(i64::MAX);
    Ok(microseconds.saturating_mul(1000))
}

/// Header stamp of any message that starts with a header, in nanoseconds since the epoch.
pub(crate) fn stamp_ns(kind: MessageKind, message: &[u8]) -> Result<i64, CdrError> {
    if kind == MessageKind::CompressedVideoProtobuf {
        return read_compressed_video_protobuf(message).map(|packet| packet.stamp_ns);
    }
    let mut reader = CdrReader::new(message)?;
    if kind.counts_since_boot() {
        return read_px4_stamp(&mut reader);
    }
    if kind == MessageKind::Transforms && reader.read_u32()? == 0 {
        return Err(CdrError { what: "no transform".into(), offset: 4 });
    }
    Ok(read_header(&mut reader)?.stamp_ns)
}

/// `sensor_msgs/msg/Imu` without orientation and covariances.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ImuMessage {
    pub(crate) stamp_ns: i64,
    pub(crate) angular_velocity_rad_per_s: Vector3<f64>,
    pub(crate) specific_force_m_per_s2: Vector3<f64>,
}

pub(crate) fn read_imu(message: &[u8]) -> Result<ImuMessage, CdrError> {
    let mut reader = CdrReader::new(message)?;
    let header = read_header(&mut reader)?;
    reader.read_f64s::<4>()?; // orientation
    reader.read_f64s::<9>()?;
    let angular_velocity = reader.read_f64s::<3>()?;
    reader.read_f64s::<9>()?;
    let specific_force = reader.read_f64s::<3>()?;
    Ok(ImuMessage {
        stamp_ns: header.stamp_ns,
        angular_velocity_rad_per_s: Vector3::from(angular_velocity),
        specific_force_m_per_s2: Vector3::from(specific_force),
    })
}

/// `sensor_msgs/msg/Image` with borrowed pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ImageMessage<'a> {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) encoding: &'a str,
    pub(crate) big_endian: bool,
    /// Number of bytes per row.
    pub(crate) step: usize,
    pub(crate) data: &'a [u8],
}

pub(crate) fn read_image(message: &[u8]) -> Result<ImageMessage<'_>, CdrError> {
    let mut reader = CdrReader::new(message)?;
    read_header(&mut reader)?;
    let height = reader.read_u32()? as usize;
    let width = reader.read_u32()? as usize;
    let encoding = reader.read_string()?;
    let big_endian = reader.read_u8()? != 0;
    let step = reader.read_u32()? as usize;
    let data = reader.read_bytes()?;
    Ok(ImageMessage { width, height, encoding, big_endian, step, data })
}

/// Returns format and bytes of a `sensor_msgs/msg/CompressedImage`, borrowed.
pub(crate) fn read_compressed_image(message: &[u8]) -> Result<(&str, &[u8]), CdrError> {
    let mut reader = CdrReader::new(message)?;
    read_header(&mut reader)?;
    let format = reader.read_string()?;
    Ok((format, reader.read_bytes()?))
}

/// Message of a video topic with one frame, borrowed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct VideoPacket<'a> {
    /// Nanoseconds since the epoch.
    pub(crate) stamp_ns: i64,
    pub(crate) frame_id: &'a str,
    /// Name of the compression, supported or not.
    pub(crate) format: &'a str,
    /// Encoded frame as an Annex B byte stream.
    pub(crate) data: &'a [u8],
}

impl VideoPacket<'_> {
    /// Returns the codec, or a description of an unsupported one.
    pub(crate) fn codec(&self) -> Result<VideoCodec, String> {
        VideoCodec::from_name(self.format)
            .ok_or_else(|| format!("video of format {:?} is not read, expected h264 or h265", self.format))
    }

    /// True if the frame depends on frames before the keyframe that it follows.
    pub(crate) fn is_leading(&self) -> bool {
        self.codec().is_ok_and(|codec| codec.is_leading(self.data))
    }

    /// True if decoding can start with the frame.
    pub(crate) fn is_keyframe(&self) -> bool {
        self.codec().is_ok_and(|codec| codec.is_keyframe(self.data))
    }
}

pub(crate) fn read_video_packet(kind: MessageKind, message: &[u8]) -> Result<VideoPacket<'_>, CdrError> {
    match kind {
        MessageKind::CompressedVideoProtobuf => read_compressed_video_protobuf(message),
        MessageKind::FfmpegPacket => {
            let mut reader = CdrReader::new(message)?;
            let Header { stamp_ns, frame_id } = read_header(&mut reader)?;
            let _width = reader.read_u32()?;
            let _height = reader.read_u32()?;
            let format = reader.read_string()?;
            let _presentation_time = reader.read_u64()?;
            let _flags = reader.read_u8()?;
            let _is_big_endian = reader.read_u8()?;
            Ok(VideoPacket { stamp_ns, frame_id, format, data: reader.read_bytes()? })
        }
        _ => {
            let mut reader = CdrReader::new(message)?;
            let Header { stamp_ns, frame_id } = read_header(&mut reader)?;
            let data = reader.read_bytes()?;
            Ok(VideoPacket { stamp_ns, frame_id, format: reader.read_string()?, data })
        }
    }
}

/// `foxglove.CompressedVideo`: timestamp (1), frame (2), data (3), format (4).
fn read_compressed_video_protobuf(message: &[u8]) -> Result<VideoPacket<'_>, CdrError> {
    let (mut stamp_ns, mut frame_id, mut format, mut data) = (0, "", "", &[][..]);
    let mut reader = ProtobufReader::new(message);
    while let Some(field) = reader.next_field()? {
        match field {
            (1, ProtobufValue::Bytes(timestamp)) => stamp_ns = read_protobuf_timestamp(timestamp)?,
            (2, ProtobufValue::Bytes(bytes)) => frame_id = reader.text(bytes)?,
            (3, ProtobufValue::Bytes(bytes)) => data = bytes,
            (4, ProtobufValue::Bytes(bytes)) => format = reader.text(bytes)?,
            _ => {}
        }
    }
    Ok(VideoPacket { stamp_ns, frame_id, format, data })
}

/// `google.protobuf.Timestamp`: seconds (1), nanoseconds (2).
fn read_protobuf_timestamp(message: &[u8]) -> Result<i64, CdrError> {
    let (mut seconds, mut nanoseconds) = (0, 0);
    let mut reader = ProtobufReader::new(message);
    while let Some(field) = reader.next_field()? {
        match field {
            (1, ProtobufValue::Number(value)) => seconds = value.cast_signed(),
            (2, ProtobufValue::Number(value)) => nanoseconds = value.cast_signed(),
            _ => {}
        }
    }
    Ok(seconds.saturating_mul(1_000_000_000).saturating_add(nanoseconds))
}

/// `sensor_msgs/msg/CameraInfo`: resolution, distortion and intrinsics of a sensor, and the part of it in an image.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CameraInfoMessage {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Name of the model: `plumb_bob`, `equidistant`, ….
    pub(crate) distortion_model: String,
    pub(crate) distortion: Vec<f64>,
    /// `K`, row by row.
    pub(crate) intrinsic_matrix: [f64; 9],
    /// Width and height of the pixels joined to one; 0 and 1 mean none.
    pub(crate) binning_px: [usize; 2],
    /// Column and row of the first pixel of the region of interest.
    pub(crate) region_offset_px: [usize; 2],
    /// Width and height of the region of interest before binning, 0 for the whole sensor.
    pub(crate) region_size_px: [usize; 2],
}

pub(crate) fn read_camera_info(message: &[u8]) -> Result<CameraInfoMessage, CdrError> {
    let mut reader = CdrReader::new(message)?;
    read_header(&mut reader)?;
    let height = reader.read_u32()? as usize;
    let width = reader.read_u32()? as usize;
    let distortion_model = reader.read_string()?.to_owned();
    let distortion = reader.read_f64_sequence()?;
    let intrinsic_matrix = reader.read_f64s::<9>()?;
    reader.read_f64s::<9>()?; // rectification
    reader.read_f64s::<12>()?; // projection
    let mut pixels = || reader.read_u32().map(|count| count as usize);
    let binning_px = [pixels()?, pixels()?];
    let region_offset_px = [pixels()?, pixels()?];
    let [region_height, region_width] = [pixels()?, pixels()?];
    Ok(CameraInfoMessage {
        width,
        height,
        distortion_model,
        distortion,
        intrinsic_matrix,
        binning_px,
        region_offset_px,
        region_size_px: [region_width, region_height],
    })
}

/// `sensor_msgs/msg/JointState`, of whose velocities and efforts only the numbers are kept.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct JointMessage<'a> {
    pub(crate) stamp_ns: i64,
    pub(crate) names: Vec<&'a str>,
    pub(crate) positions_rad: Vec<f64>,
    velocities: usize,
    efforts: usize,
}

impl JointMessage<'_> {
    /// True if a joint has no position.
    pub(crate) fn lacks_positions(&self) -> bool {
        self.positions_rad.len() < self.names.len()
    }

    /// Content of a message without any position: `velocities`, `efforts` or both, else `names`.
    pub(crate) fn content_without_positions(&self) -> Option<&'static str> {
        let content = match (self.velocities > 0, self.efforts > 0) {
            (true, true) => "velocities and efforts",
            (true, false) => "velocities",
            (false, true) => "efforts",
            (false, false) => "names",
        };
        (self.positions_rad.is_empty() && !self.names.is_empty()).then_some(content)
    }

    /// Description of a message in which the numbers of names and positions differ.
    pub(crate) fn length_problem(&self) -> String {
        if let Some(content) = self.content_without_positions() {
            return format!("it has {content} of {} joints but no positions", self.names.len());
        }
        format!("it names {} joints and has {} positions", self.names.len(), self.positions_rad.len())
    }
}

pub(crate) fn read_joint_state(message: &[u8]) -> Result<JointMessage<'_>, CdrError> {
    let mut reader = CdrReader::new(message)?;
    let header = read_header(&mut reader)?;
    let names = reader.read_strings()?;
    let positions_rad = reader.read_f64_sequence()?;
    // A message that is cut behind its positions is still used.
    let velocities = reader.read_f64_sequence().map_or(0, |values| values.len());
    let efforts = reader.read_f64_sequence().map_or(0, |values| values.len());
    Ok(JointMessage { stamp_ns: header.stamp_ns, names, positions_rad, velocities, efforts })
}

/// Pose of any of the pose messages, `None` for numbers that are not finite or a zero quaternion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PoseMessage {
    pub(crate) stamp_ns: i64,
    pub(crate) pose: Option<RigidTransform>,
}

pub(crate) fn read_pose(kind: MessageKind, message: &[u8]) -> Result<PoseMessage, CdrError> {
    let mut reader = CdrReader::new(message)?;
    let header = read_header(&mut reader)?;
    if matches!(kind, MessageKind::Odometry | MessageKind::TransformStamped) {
        reader.read_string()?; // child_frame_id
    }
    let position_m = reader.read_f64s::<3>()?;
    let [x, y, z, w] = reader.read_f64s::<4>()?;
    let quaternion = Quaternion::new(w, x, y, z);
    let norm = quaternion.norm();
    let usable = norm.is_finite() && norm > 0.5 && position_m.iter().all(|value| value.is_finite());
    let pose =
        usable.then(|| RigidTransform::new(UnitQuaternion::new_normalize(quaternion), Vector3::from(position_m)));
    Ok(PoseMessage { stamp_ns: header.stamp_ns, pose })
}

/// Frame in the header of a message and a checksum of what follows the header; of images, of their data alone. `None`
/// for a message that cannot be decoded, and for transforms, which have several headers.
pub(crate) fn frame_and_checksum(kind: MessageKind, message: &[u8]) -> Option<(&str, u32)> {
    let (frame_id, content) = match kind {
        MessageKind::Transforms => return None,
        MessageKind::CompressedVideo | MessageKind::CompressedVideoProtobuf | MessageKind::FfmpegPacket => {
            let packet = read_video_packet(kind, message).ok()?;
            (packet.frame_id, packet.data)
        }
        kind if kind.counts_since_boot() => {
            let mut reader = CdrReader::new(message).ok()?;
            reader.read_u64().ok()?;
            ("", reader.rest())
        }
        _ => {
            let mut reader = CdrReader::new(message).ok()?;
            let frame_id = read_header(&mut reader).ok()?.frame_id;
            let content = match kind {
                MessageKind::Image => read_image(message).ok()?.data,
                MessageKind::CompressedImage => read_compressed_image(message).ok()?.1,
                _ => reader.rest(),
            };
            (frame_id, content)
        }
    };
    Some((frame_id, crc32fast::hash(content)))
}
