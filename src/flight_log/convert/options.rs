use std::path::PathBuf;

use serde::Serialize;

use super::super::LogLimits;

/// Options of a conversion.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ConvertOptions {
    /// Limits on what is read of the source.
    pub limits: LogLimits,
    /// The autopilot's log of the flight that a video shows.
    pub autopilot: Option<AutopilotLog>,
    /// Where a video lies in the autopilot's log; without it, by the times that both recorded, else both start together.
    pub video_clock: Option<VideoClock>,
}

/// Kind of an autopilot's log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AutopilotLogKind {
    /// `ULog` of PX4.
    Ulog,
    /// `DataFlash` of `ArduPilot`.
    DataFlash,
    /// `MAVLink` telemetry log of a ground station.
    Tlog,
}

impl AutopilotLogKind {
    /// Its name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ulog => "PX4 ULog",
            Self::DataFlash => "ArduPilot DataFlash log",
            Self::Tlog => "MAVLink telemetry log",
        }
    }
}

/// An autopilot's log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AutopilotLog {
    /// Its kind.
    pub kind: AutopilotLogKind,
    /// The file.
    pub path: PathBuf,
}

/// The clock of a video against the clock of an autopilot's log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct VideoClock {
    /// Start of the video minus the first IMU sample of the autopilot's log, in seconds of the log.
    pub offset_s: f64,
    /// Seconds of the log in a second of the video, minus 1, in 1e-6.
    pub drift_ppm: f64,
}
