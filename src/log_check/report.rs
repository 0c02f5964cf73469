//! Findings of a check and the report that holds them.

use nalgebra::UnitQuaternion;
use serde::Serialize;

use crate::frontend::readout::RowTrack;
use crate::sensors::ImageMask;

/// Severity of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Checked without a problem.
    Good,
    /// For information.
    Note,
    /// Degrades results or delays initialization.
    Warning,
    /// Makes results invalid until it is corrected.
    Error,
}

/// Subject of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Area {
    /// The file and its topics.
    Log,
    /// Time bases, rates, gaps and order of stamps.
    Time,
    /// Units, gravity, biases, noise and saturation of the IMU.
    #[serde(rename = "inertial")]
    Imu,
    /// Stationary and hovering periods, fast rotation.
    Motion,
    /// Joint angles and their limits.
    Encoders,
    /// Size, blur, exposure and texture.
    Images,
    /// Camera models and lenses.
    Intrinsics,
    /// Poses of the cameras relative to the IMU.
    Extrinsics,
}

/// One result of the check.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// Its severity.
    pub severity: Severity,
    /// The checked subject.
    pub area: Area,
    /// The finding in one sentence.
    pub title: String,
    /// The measured values, with units.
    pub evidence: String,
    /// What to do; empty when nothing needs to be done.
    pub remedy: String,
}

/// One topic of the log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TopicReport {
    /// Topic name.
    pub topic: String,
    /// Message type, such as `sensor_msgs/msg/Imu`.
    pub schema: String,
    /// Its use: `imu0`, `cam0`, `gimbal`, `ground truth`, `not in the rig`, or `ignored`.
    pub role: String,
    /// Number of messages.
    pub count: u64,
    /// Mean rate over its log times, in Hz.
    pub rate_hz: f64,
    /// First header stamp since the log began, in seconds; log time for an ignored topic.
    pub first_s: f64,
    /// Last header stamp, likewise.
    pub last_s: f64,
    /// Median of log time minus header stamp in seconds, `None` for an ignored topic.
    pub latency_s: Option<f64>,
}

/// Rotation between two images of one camera, measured from the images alone.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageRotation {
    /// Key of the camera.
    pub camera_key: String,
    /// Header stamp of the first image since the log began.
    pub from_ns: i64,
    /// Header stamp of the second image.
    pub to_ns: i64,
    /// Rotates vectors from the camera frame of the first image to that of the second.
    pub second_from_first: UnitQuaternion<f64>,
    /// The features of both images, for the readout; may be empty.
    pub tracks: Vec<RowTrack>,
}

/// Result of [`check`](super::check).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CheckReport {
    /// Path of the log.
    pub log: String,
    /// Name of the rig, `None` without a readable one.
    pub rig: Option<String>,
    /// Absolute header stamp of the log's start, in nanoseconds.
    pub epoch_ns: i64,
    /// Length of the log.
    pub duration_s: f64,
    /// All topics in the order of their names.
    pub topics: Vec<TopicReport>,
    /// Most severe first, then by area.
    pub findings: Vec<Finding>,
    /// Masks for cameras that see the vehicle.
    #[serde(skip)]
    pub proposed_masks: Vec<ProposedMask>,
}

/// A mask for what never moves in the images of a camera.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProposedMask {
    /// Key of the camera.
    pub camera_key: String,
    /// The mask, that of the rig not included.
    pub mask: ImageMask,
}

impl CheckReport {
    /// The worst severity among the findings.
    pub fn worst(&self) -> Severity {
        self.findings.iter().map(|finding| finding.severity).max().unwrap_or(Severity::Good)
    }
}

/// Findings in the order of the checks.
#[derive(Debug, Default)]
pub(super) struct Findings {
    pub(super) list: Vec<Finding>,
}

impl Findings {
    pub(super) fn add(
        &mut self,
        severity: Severity,
        area: Area,
        title: impl Into<String>,
        evidence: impl Into<String>,
        remedy: impl Into<String>,
    ) {
        let (title, evidence, remedy) = (title.into(), evidence.into(), remedy.into());
        self.list.push(Finding { severity, area, title, evidence, remedy });
    }

    pub(super) fn good(&mut self, area: Area, title: impl Into<String>, evidence: impl Into<String>) {
        self.add(Severity::Good, area, title, evidence, "");
    }
}
