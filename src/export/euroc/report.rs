//! Result of writing a log as a EuRoC folder.

use std::fmt::{Display, Formatter, Result};
use std::path::{Path, PathBuf};

use serde::{Serialize, Serializer};

use crate::flight_log::FlightLog;
use crate::geometry::seconds_from_ns;
use crate::text::{counted, printable};

/// Camera of the folder.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct EurocCamera {
    /// Name in the folder, such as `cam0`.
    pub folder: String,
    /// Key in the rig.
    pub key: String,
    pub topic: String,
    /// Number of images written.
    pub images: u64,
    /// Number of images that cannot be decoded.
    pub left: u64,
    /// Number of images with extrinsics, for a camera on a gimbal.
    pub moving_extrinsics: Option<u64>,
}

/// Content of the folder.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EurocReport {
    #[serde(serialize_with = "as_text")]
    pub source: PathBuf,
    #[serde(serialize_with = "as_text")]
    pub folder: PathBuf,
    /// Length of the log in seconds.
    pub duration_s: f64,
    pub cameras: Vec<EurocCamera>,
    pub imu_samples: u64,
    pub ground_truth_poses: u64,
    pub joint_readings: u64,
    /// Properties that the format lacks, and problems of the log.
    pub notes: Vec<String>,
}

impl EurocReport {
    pub(super) fn new(log: &FlightLog, folder: PathBuf) -> Self {
        Self {
            source: log.path().to_owned(),
            folder,
            duration_s: seconds_from_ns(log.duration_ns()),
            cameras: Vec::new(),
            imu_samples: 0,
            ground_truth_poses: 0,
            joint_readings: 0,
            notes: Vec::new(),
        }
    }
}

/// Serializes a path, which need not be UTF-8, as text.
fn as_text<S: Serializer>(path: &Path, serializer: S) -> std::result::Result<S::Ok, S::Error> {
    path.to_string_lossy().serialize(serializer)
}

/// A line per sensor, then the notes and the folder.
impl Display for EurocReport {
    fn fmt(&self, out: &mut Formatter<'_>) -> Result {
        writeln!(out, "{}: {:.3} s", self.source.display(), self.duration_s)?;
        for camera in &self.cameras {
            write!(
                out,
                "  {}: {} ({}), {}",
                camera.folder,
                camera.key,
                camera.topic,
                counted(camera.images as usize, "image")
            )?;
            if camera.left > 0 {
                write!(out, ", {} left", camera.left)?;
            }
            if let Some(poses) = camera.moving_extrinsics {
                write!(out, ", {poses} with extrinsics of the gimbal")?;
            }
            writeln!(out)?;
        }
        writeln!(out, "  imu0: {}", counted(self.imu_samples as usize, "sample"))?;
        if self.ground_truth_poses > 0 {
            writeln!(out, "  ground truth: {}", counted(self.ground_truth_poses as usize, "pose"))?;
        }
        if self.joint_readings > 0 {
            writeln!(out, "  gimbal0: {}", counted(self.joint_readings as usize, "joint reading"))?;
        }
        for note in &self.notes {
            writeln!(out, "  note: {}", printable(note))?;
        }
        writeln!(out, "{}", self.folder.display())
    }
}
