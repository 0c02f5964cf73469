//! Flight logs: MCAP in and out as typed events in time order, the rigs that describe their sensors, and the logs of
//! other recorders.
//!
//! Time is nanoseconds since the first message of the log (header stamps; the log time is kept too).

pub(crate) mod attitude;
mod cdr;
pub(crate) mod container;
pub mod convert;
pub mod csv_writer;
mod error;
mod excerpt;
mod file;
mod foreign;
mod geodesy;
pub(crate) mod grey_levels;
pub(crate) mod grey_sampling;
pub(crate) mod image_copies;
pub(crate) mod image_decoding;
mod image_problem;
mod image_reader;
pub(crate) mod imu_filter;
pub(crate) mod imu_merge;
pub(crate) mod joint_merge;
mod limits;
pub(crate) mod log;
pub(crate) mod message_content;
pub(crate) mod messages;
pub mod output;
mod protobuf;
mod raw_encoding;
pub(crate) mod rig;
mod sensor_frame;
pub(crate) mod spacing;
pub(crate) mod stamp_clock;
mod stamp_text;
mod stills;
pub(crate) mod stream;
#[cfg(test)]
pub(crate) mod tests;
mod text;
pub(crate) mod topic_info;
mod trajectory;
pub mod urdf;
pub(crate) mod video;
mod warning;
mod writer;
pub(crate) mod yaml;

pub use error::LogError;
pub use excerpt::{ExcerptReport, write_excerpt};
pub use image_reader::ImageReader;
pub use limits::{LimitExceeded, LimitKind, LimitSetting, LogLimits};
pub use log::FlightLog;
pub use messages::MessageKind;
pub use rig::template as rig_template;
pub use rig::{MissingSensors, RigCandidate, is_imu_file_of, is_rig_name, missing_sensors, rig_candidates};
pub use sensor_frame::SensorFrame;
pub use stills::{read_stills, read_stills_chain};
pub use stream::{
    FrameStream, RecordedImage, SensorSamples, ground_truth_poses, imu_samples, joint_samples, nominal_joint_sigma_rad,
    recorded_images,
};
pub use text::{edit_distance, log_name, nearest_name, printable, printable_lines, shortened, without_signed_zeros};
pub use topic_info::TopicInfo;
pub use trajectory::{BATCH_REFERENCE, RecordedPose, is_batch_reference, read_trajectory_file};
pub use warning::{LogWarning, Magnitude, WarningKind};
pub use writer::{
    CircleAnnotation, LinesAnnotation, LogCompression, LogLevel, LogWriter, LogWriterOptions, MessageTimes,
    MessageType, NamedTransform, Odometry, Rgba,
};
