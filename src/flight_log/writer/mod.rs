//! Writer of flight logs: MCAP with CDR messages and their definitions, in the layout of ROS 2's recorder.

mod encode;
mod file;
pub(super) mod growing;
mod protobuf;
mod results;
mod schemas;

pub use encode::Odometry;
pub use file::MessageType;
pub use results::{CircleAnnotation, LinesAnnotation, LogLevel, NamedTransform, Rgba};

use std::collections::BTreeMap;
use std::path::Path;

use file::McapFile;
use mcap::{Compression, WriteOptions};
use nalgebra::{UnitQuaternion, Vector3};

use super::{LogError, MessageKind};
use crate::camera::CameraModel;
use crate::files::output::{OutputFile, StagedFile};
use crate::geometry::RigidTransform;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LogCompression {
    None,
    Lz4,
    Zstd,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogWriterOptions {
    pub compression: LogCompression,
    /// Maximum size of a chunk in bytes; `None` writes messages without chunks.
    pub chunk_bytes: Option<u64>,
    /// Write an index at the end of the file; without one every reader has to scan the entire file.
    pub indexed: bool,
}

impl Default for LogWriterOptions {
    /// Zstandard, 4 MiB, indexed.
    fn default() -> Self {
        Self { compression: LogCompression::Zstd, chunk_bytes: Some(4 << 20), indexed: true }
    }
}

/// Times of a message, both in nanoseconds since the epoch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MessageTimes {
    /// Header stamp, the time of measurement.
    pub stamp_ns: i64,
    /// Log time, the time of recording.
    pub log_time_ns: i64,
}

/// Writes a log, message by message in the order of log times.
pub struct LogWriter {
    file: McapFile<OutputFile>,
    /// Channel of each topic that has been written to.
    channels: BTreeMap<String, u16>,
}

impl std::fmt::Debug for LogWriter {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter
            .debug_struct("LogWriter")
            .field("path", &self.path())
            .field("channels", &self.channels)
            .finish_non_exhaustive()
    }
}

impl LogWriter {
    /// Starts a log under a temporary name; an older file stays until the log is finished.
    pub fn create(path: &Path, options: &LogWriterOptions) -> Result<Self, LogError> {
        let failed = |source| LogError::Io { action: "write the log", source, path: path.to_owned() };
        let file = OutputFile::create(path).map_err(failed)?;
        let compression = match options.compression {
            LogCompression::None => None,
            LogCompression::Lz4 => Some(Compression::Lz4),
            LogCompression::Zstd => Some(Compression::Zstd),
        };
        let write_options = WriteOptions::new()
            .compression(compression)
            .use_chunks(options.chunk_bytes.is_some())
            .chunk_size(options.chunk_bytes)
            .emit_summary_records(options.indexed)
            .emit_summary_offsets(options.indexed)
            .emit_message_indexes(options.indexed);
        Ok(Self { file: McapFile::start(file, path, write_options)?, channels: BTreeMap::new() })
    }

    pub(super) fn path(&self) -> &Path {
        self.file.path()
    }

    /// Writes an IMU sample: angular velocity in rad/s and specific force in m/s² (+g upwards while stationary), both in the
    /// IMU frame.
    pub fn write_imu(
        &mut self,
        topic: &str,
        frame_id: &str,
        times: MessageTimes,
        angular_velocity_rad_per_s: &Vector3<f64>,
        specific_force_m_per_s2: &Vector3<f64>,
    ) -> Result<(), LogError> {
        let message = encode::imu(times.stamp_ns, frame_id, angular_velocity_rad_per_s, specific_force_m_per_s2);
        self.write(topic, MessageKind::Imu, times, &message)
    }

    /// Writes a compressed image; `format` is `jpeg` or `png`.
    pub fn write_compressed_image(
        &mut self,
        topic: &str,
        frame_id: &str,
        times: MessageTimes,
        format: &str,
        data: &[u8],
    ) -> Result<(), LogError> {
        let message = encode::compressed_image(times.stamp_ns, frame_id, format, data);
        self.write(topic, MessageKind::CompressedImage, times, &message)
    }

    /// Writes one frame of a video, in Annex B, as `foxglove.CompressedVideo` in protobuf; `format` is `h264` or `h265`.
    pub fn write_compressed_video(
        &mut self,
        topic: &str,
        frame_id: &str,
        times: MessageTimes,
        format: &str,
        data: &[u8],
    ) -> Result<(), LogError> {
        let message = protobuf::compressed_video(times.stamp_ns, frame_id, format, data);
        self.write(topic, MessageKind::CompressedVideoProtobuf, times, &message)
    }

    /// Writes a raw image of any ROS encoding, rows without padding, multi-byte pixels little-endian.
    pub fn write_raw_image(
        &mut self,
        topic: &str,
        frame_id: &str,
        times: MessageTimes,
        resolution_px: [usize; 2],
        encoding: &str,
        data: &[u8],
    ) -> Result<(), LogError> {
        let message = encode::image(times.stamp_ns, frame_id, resolution_px, encoding, data);
        self.write(topic, MessageKind::Image, times, &message)
    }

    pub fn write_camera_info(
        &mut self,
        topic: &str,
        frame_id: &str,
        times: MessageTimes,
        model: &CameraModel,
    ) -> Result<(), LogError> {
        self.write(topic, MessageKind::CameraInfo, times, &encode::camera_info(times.stamp_ns, frame_id, model))
    }

    /// Writes joint angles in radians, one per name.
    pub fn write_joints(
        &mut self,
        topic: &str,
        times: MessageTimes,
        names: &[String],
        positions_rad: &[f64],
    ) -> Result<(), LogError> {
        self.write(topic, MessageKind::JointState, times, &encode::joint_state(times.stamp_ns, names, positions_rad))
    }

    /// Writes a pose with its covariance and velocity.
    pub fn write_odometry(
        &mut self,
        topic: &str,
        times: MessageTimes,
        odometry: &Odometry<'_>,
    ) -> Result<(), LogError> {
        self.write(topic, MessageKind::Odometry, times, &encode::odometry(times.stamp_ns, odometry))
    }

    /// Writes a pose alone, in `frame_id`.
    pub fn write_pose(
        &mut self,
        topic: &str,
        frame_id: &str,
        times: MessageTimes,
        pose: &RigidTransform,
    ) -> Result<(), LogError> {
        self.write(topic, MessageKind::PoseStamped, times, &encode::pose_stamped(times.stamp_ns, frame_id, pose))
    }

    /// Writes a pose of `child_frame_id` in `frame_id` as a transform.
    pub fn write_transform(
        &mut self,
        topic: &str,
        frame_id: &str,
        child_frame_id: &str,
        times: MessageTimes,
        pose: &RigidTransform,
    ) -> Result<(), LogError> {
        let message = encode::transform_stamped(times.stamp_ns, frame_id, child_frame_id, pose);
        self.write(topic, MessageKind::TransformStamped, times, &message)
    }

    /// Writes a rotation from a body's frame to `frame_id`.
    pub fn write_rotation(
        &mut self,
        topic: &str,
        frame_id: &str,
        times: MessageTimes,
        rotation: &UnitQuaternion<f64>,
    ) -> Result<(), LogError> {
        let message = encode::quaternion_stamped(times.stamp_ns, frame_id, rotation);
        self.write(topic, MessageKind::QuaternionStamped, times, &message)
    }

    /// Attaches a file, such as `city.rig.yaml` or the mask of a camera.
    pub fn attach(
        &mut self,
        name: &str,
        media_type: &str,
        content: &(impl AsRef<[u8]> + ?Sized),
        log_time_ns: i64,
    ) -> Result<(), LogError> {
        self.file.attach(name, media_type, content.as_ref(), log_time_ns.max(0) as u64)
    }

    /// Writes named texts about the log as metadata, such as the experiment and its seed.
    pub fn write_metadata(&mut self, name: &str, texts: BTreeMap<String, String>) -> Result<(), LogError> {
        self.file.write_metadata(name, texts)
    }

    /// Completes the file, replacing an older one.
    pub fn finish(self) -> Result<(), LogError> {
        let path = self.path().to_owned();
        let staged = self.finish_staged()?;
        staged.commit().map_err(|source| LogError::Io { action: "write the log", source, path })
    }

    /// Completes the file without the final rename, so that it can appear together with others.
    pub fn finish_staged(self) -> Result<StagedFile, LogError> {
        self.file.finish("write the log", OutputFile::stage)
    }

    /// Writes an encoded message.
    pub(super) fn write(
        &mut self,
        topic: &str,
        kind: MessageKind,
        times: MessageTimes,
        message: &[u8],
    ) -> Result<(), LogError> {
        if !self.channels.contains_key(topic) {
            let message_type = match kind {
                MessageKind::CompressedVideoProtobuf => MessageType::compressed_video(),
                kind => MessageType::ros2(kind.schema_name(), schemas::definition(kind)),
            };
            self.add_channel(topic, &message_type)?;
        }
        self.write_to_channel(topic, times, message)
    }

    /// Writes an encoded message of any type. A topic keeps the type of its first message.
    pub fn write_typed(
        &mut self,
        topic: &str,
        message_type: &MessageType<'_>,
        times: MessageTimes,
        message: &[u8],
    ) -> Result<(), LogError> {
        if !self.channels.contains_key(topic) {
            self.add_channel(topic, message_type)?;
        }
        self.write_to_channel(topic, times, message)
    }

    fn add_channel(&mut self, topic: &str, message_type: &MessageType<'_>) -> Result<(), LogError> {
        let id = self.file.channel(topic, message_type)?;
        self.channels.insert(topic.to_owned(), id);
        Ok(())
    }

    fn write_to_channel(&mut self, topic: &str, times: MessageTimes, message: &[u8]) -> Result<(), LogError> {
        let channel_id = *self.channels.entry(topic.to_owned()).or_default();
        self.file.write(channel_id, times.log_time_ns.max(0) as u64, message)
    }
}

/// Encoders for tests of the decoders.
#[cfg(test)]
pub(super) mod testing {
    pub(in super::super) use super::encode::*;
}
