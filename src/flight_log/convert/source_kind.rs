//! Kinds of recordings, recognized by their first bytes.

use std::fs;
use std::io::Read as _;
use std::path::Path;

use super::super::log::lfs_pointer;
use super::error::ConvertError;
use super::options::AutopilotLogKind;
use super::{euroc, recording, ros1_bag, ros2_bag};
use crate::files::LogLimits;
use crate::flight_log::container::file::{LogFile, ZSTD_MAGIC, kind_of, unpacked_name};
use crate::flight_log::log::foreign;
use crate::text::log_name;

/// Kind of a recording that `dcvins convert` reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SourceKind {
    Euroc,
    Ros1Bag,
    Ros2Bag,
    Sqlite,
    /// SQLite compressed with Zstandard.
    PackedSqlite,
    Mcap,
    Video,
    Autopilot(AutopilotLogKind),
}

impl SourceKind {
    pub fn name(self) -> &'static str {
        match self {
            Self::Euroc => "EuRoC folder",
            Self::Ros1Bag => "ROS 1 bag",
            Self::Ros2Bag => "ROS 2 bag",
            Self::Sqlite | Self::PackedSqlite => "ROS 2 bag (one SQLite file)",
            Self::Mcap => "MCAP",
            Self::Video => "MP4 video",
            Self::Autopilot(kind) => kind.name(),
        }
    }
}

/// Number of bytes at the start that identify the kind of a source.
const START_BYTES: usize = 512;

/// Kind of a recording by its first bytes, or of a folder by its content.
///
/// # Errors
/// When it cannot be read or is of no known kind; the message says what it is.
pub fn source_kind(source: &Path, limits: &LogLimits) -> Result<SourceKind, ConvertError> {
    let metadata = fs::metadata(source).map_err(ConvertError::io("open the source", source))?;
    let unknown = |found: String| ConvertError::UnknownSource { found, path: source.to_owned() };
    if metadata.is_dir() {
        return if euroc::root(source).is_some() {
            Ok(SourceKind::Euroc)
        } else if ros2_bag::is_bag(source) {
            Ok(SourceKind::Ros2Bag)
        } else {
            Err(unknown(
                "a folder without mav0/imu0/data.csv and without metadata.yaml, .db3 or .mcap files".to_owned(),
            ))
        };
    }
    if !metadata.is_file() {
        return Err(unknown(kind_of(&metadata).to_owned()));
    }
    let mut start = Vec::new();
    let file = fs::File::open(source).map_err(ConvertError::io("open the source", source))?;
    file.take(START_BYTES as u64).read_to_end(&mut start).map_err(ConvertError::io("read the source", source))?;
    let packed = start.starts_with(&ZSTD_MAGIC);
    if packed {
        // The name gives the kind of the content, so that it is not decompressed twice.
        let name = unpacked_name(source);
        let ending = name.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
        match ending.as_deref() {
            Some("db3") => return Ok(SourceKind::PackedSqlite),
            Some("mcap") => return Ok(SourceKind::Mcap),
            Some("bag") => return Ok(SourceKind::Ros1Bag),
            _ => {
                let plain = LogFile::open(source, limits)?;
                start = plain
                    .read(0..plain.len().min(START_BYTES))
                    .map_err(|problem| ConvertError::unreadable(problem, source))?;
            }
        }
    }
    if start.starts_with(mcap::MAGIC) {
        Ok(SourceKind::Mcap)
    } else if start.starts_with(ros1_bag::MAGIC) {
        Ok(SourceKind::Ros1Bag)
    } else if start.starts_with(b"#ROSBAG") {
        let version = String::from_utf8_lossy(&start[1..]).lines().next().unwrap_or_default().to_owned();
        Err(unknown(format!("a bag of version {version:?}; only ROSBAG V2.0 is read ('rosbag fix' makes one)")))
    } else if start.starts_with(b"SQLite format 3") {
        Ok(if packed { SourceKind::PackedSqlite } else { SourceKind::Sqlite })
    } else if recording::is_movie(&start) {
        Ok(SourceKind::Video)
    } else if let Some(kind) = recording::autopilot_log_kind(&start) {
        Ok(SourceKind::Autopilot(kind))
    } else if let Some(found) = foreign::without_imu(&start, &log_name(source)) {
        Err(ConvertError::WithoutImu { found, path: source.to_owned() })
    } else if start.is_empty() {
        Err(unknown("an empty file".to_owned()))
    } else if let Some(bytes) = lfs_pointer(&start) {
        let problem =
            format!("a Git LFS pointer in place of the file ({bytes} bytes): fetch the file with `git lfs pull`");
        Err(ConvertError::unreadable(problem, source))
    } else {
        let bytes: Vec<String> = start.iter().take(8).map(|byte| format!("{byte:02x}")).collect();
        Err(unknown(format!("a file that begins with the bytes {}", bytes.join(" "))))
    }
}
