//! Flight logs: MCAP in and out as typed events in time order, the rig of a log, and the logs of other recorders.
//!
//! Time is nanoseconds since the first message of the log (header stamps; the log time is kept too).

pub(crate) mod container;
pub mod convert;
mod error;
mod excerpt;
pub(crate) mod grey_levels;
pub(crate) mod images;
pub(crate) mod imu;
pub mod joints;
pub mod live;
pub(crate) mod log;
pub(crate) mod messages;
mod rig;
pub(crate) mod stamps;
pub(crate) mod stream;
#[cfg(test)]
pub(crate) mod tests;
mod trajectory;
pub(crate) mod video;
mod warning;
mod writer;

pub use self::error::LogError;
pub use self::excerpt::{ExcerptReport, write_excerpt};
pub use self::images::reader::ImageReader;
pub use self::log::FlightLog;
pub use self::log::following::{FollowOptions, LogEnd};
pub use self::log::topic_info::TopicInfo;
pub use self::messages::MessageKind;
pub use self::rig::template as rig_template;
pub use self::rig::{
    MissingSensors, RigCandidate, RigOfLog, is_imu_file_of, is_rig_name, missing_sensors, rig_candidates,
};
pub(crate) use self::stream::image_stamps;
pub use self::stream::{
    FrameStream, RecordedImage, SensorFrame, SensorSamples, ground_truth_poses, imu_samples, joint_samples,
    nominal_joint_sigma_rad, recorded_images,
};
pub use self::trajectory::geodesy::Geodetic;
pub use self::trajectory::{BATCH_REFERENCE, RecordedPose, is_batch_reference, read_trajectory_file};
pub use self::warning::{LogWarning, Magnitude, WarningKind};
pub use self::writer::{
    CircleAnnotation, LinesAnnotation, LogCompression, LogLevel, LogWriter, LogWriterOptions, MessageTimes,
    MessageType, NamedTransform, Odometry, Rgba,
};
