use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::ConvertError;
use crate::files::LogLimits;

#[derive(Clone, Debug, Default, PartialEq)]
pub struct ConvertOptions {
    /// Limits on reading the source.
    pub limits: LogLimits,
    /// Bags that continue a ROS 1 bag, in the order of time, as `rosbag record --split` writes them.
    pub splits: Vec<PathBuf>,
    /// Autopilot's log of the flight in a video.
    pub autopilot: Option<AutopilotLog>,
    /// Relation of the video's clock to the autopilot's log; if not given, by the recorded times of both, else both
    /// start together.
    pub video_clock: Option<VideoClock>,
    /// Names of records that are taken in place of those that the conversion chooses, as reports name them; `system N`
    /// for a vehicle of a telemetry log.
    pub take: Vec<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AutopilotLogKind {
    /// `ULog`, the log of PX4.
    Ulog,
    /// `DataFlash`, the log of `ArduPilot`.
    DataFlash,
    /// `MAVLink` telemetry log of a ground station.
    Tlog,
}

impl AutopilotLogKind {
    pub fn name(self) -> &'static str {
        match self {
            Self::Ulog => "PX4 ULog",
            Self::DataFlash => "ArduPilot DataFlash log",
            Self::Tlog => "MAVLink telemetry log",
        }
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AutopilotLog {
    pub kind: AutopilotLogKind,
    pub path: PathBuf,
}

/// Agreement of the specific forces of an autopilot and of a camera, whose magnitudes do not depend on a gimbal between
/// them, at the offset of their clocks at which it is best.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ForceAgreement {
    /// Correlation coefficient of the magnitudes.
    pub correlation: f64,
    /// Standard deviation of the offset.
    pub offset_sigma_s: f64,
}

/// Offset and drift of a video's clock relative to the clock of an autopilot's log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct VideoClock {
    /// Start of the video minus the first IMU sample of the autopilot's log, in seconds of the log.
    pub offset_s: f64,
    /// Log seconds per video second, minus 1, in 1e-6.
    pub drift_ppm: f64,
}

/// Names of wanted records, and the records that a source has.
#[derive(Debug, Default)]
pub(super) struct TakenRecords {
    wanted: Vec<String>,
    available: BTreeSet<String>,
}

impl TakenRecords {
    pub(super) fn new(wanted: Vec<String>) -> Self {
        Self { wanted, available: BTreeSet::new() }
    }

    /// True if a record is wanted.
    pub(super) fn wants(&self, record: &str) -> bool {
        self.wanted.iter().any(|wanted| wanted == record)
    }

    /// Adds a record of the source that can be taken.
    pub(super) fn offer(&mut self, record: &str) {
        self.available.insert(record.to_owned());
    }

    /// Returns an error if the source lacks a wanted record.
    pub(super) fn require_all(&self, source: &Path) -> Result<(), ConvertError> {
        let Some(missing) = self.wanted.iter().find(|wanted| !self.available.contains(*wanted)) else { return Ok(()) };
        Err(ConvertError::NoSuchRecord {
            record: missing.clone(),
            available: self.available.iter().cloned().collect::<Vec<_>>().join(", "),
            path: source.to_owned(),
        })
    }
}
