//! Findings of a check and the report that holds them.

pub(super) mod agreement;
mod interval;
mod render;
pub(super) mod suspects;
pub(super) mod verdict;

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::UnitQuaternion;
use serde::ser::SerializeStruct as _;
use serde::{Deserialize, Serialize, Serializer};

use self::agreement::Agreement;
pub use self::interval::FindingInterval;
use crate::faults::Fault;
pub use crate::faults::{Area, Severity};
use crate::frontend::readout::RowTrack;
use crate::geometry::seconds_from_ns;
use crate::sensors::ImageMask;
use crate::text::without_signed_zeros;

/// Evidence on which a finding is based.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Basis {
    #[default]
    Measured,
    /// A value of the rig is only assumed, without a sign that it is wrong.
    Assumed,
    /// The measurements do not verify a value of the rig.
    Unverified,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    pub severity: Severity,
    pub area: Area,
    /// The finding in one sentence.
    pub title: String,
    /// Measured values with units.
    pub evidence: String,
    /// Instruction; empty if nothing needs to be done.
    pub remedy: String,
    #[serde(flatten)]
    pub interval: FindingInterval,
    #[serde(skip)]
    pub basis: Basis,
    /// Faults with their values, of which one changes the estimates of a run; empty if none is known.
    #[serde(skip)]
    pub faults: Vec<Fault>,
}

impl Finding {
    /// Time from which on its fault acts, in seconds since the log began; `None` for one that acts from the start.
    pub fn since_s(&self) -> Option<f64> {
        self.faults.first().and_then(|fault| fault.since_s)
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TopicReport {
    pub topic: String,
    /// Message type, such as `sensor_msgs/msg/Imu`.
    pub schema: String,
    /// `imu0`, `cam0`, `gimbal`, `ground truth`, `not in the rig`, or `ignored`.
    pub role: String,
    pub count: u64,
    /// Mean rate over its log times, in Hz.
    pub rate_hz: f64,
    /// First header stamp since the log began, in seconds; log time for an ignored topic.
    pub first_s: f64,
    /// Last header stamp, as for `first_s`.
    pub last_s: f64,
    /// Median of log time minus header stamp in seconds, `None` for an ignored topic.
    pub latency_s: Option<f64>,
}

/// Rotation between two images of one camera, measured from the images alone.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageRotation {
    pub camera_key: String,
    /// Header stamp of the first image since the log began.
    pub from_ns: i64,
    /// Header stamp of the second image.
    pub to_ns: i64,
    /// Rotates vectors from the camera frame of the first image to the camera frame of the second.
    pub second_from_first: UnitQuaternion<f64>,
    /// Features of both images, for the readout; may be empty.
    pub tracks: Vec<RowTrack>,
}

/// Result of [`check`](super::check); as JSON it begins with the verdict.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct CheckReport {
    pub log: String,
    /// Name of the rig, `None` without a readable one.
    pub rig: Option<String>,
    /// Absolute header stamp of the log's start, in nanoseconds.
    pub epoch_ns: i64,
    /// Length of the log, in seconds.
    pub duration_s: f64,
    /// All topics, ordered by name.
    pub topics: Vec<TopicReport>,
    /// Most severe first, then by area.
    pub findings: Vec<Finding>,
    /// Sources that measure one quantity, compared with each other.
    #[serde(default)]
    pub agreement: Agreement,
    /// Masks for cameras with the vehicle in view; not part of the JSON.
    #[serde(skip)]
    pub proposed_masks: Vec<ProposedMask>,
}

/// Mask of the static pixels in the images of a camera.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProposedMask {
    pub camera_key: String,
    /// The proposed pixels, without the pixels of the rig's mask.
    pub mask: ImageMask,
}

impl Serialize for CheckReport {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut fields = serializer.serialize_struct("CheckReport", 8)?;
        fields.serialize_field("verdict", &self.verdict())?;
        fields.serialize_field("log", &self.log)?;
        fields.serialize_field("rig", &self.rig)?;
        fields.serialize_field("epoch_ns", &self.epoch_ns)?;
        fields.serialize_field("duration_s", &self.duration_s)?;
        fields.serialize_field("topics", &self.topics)?;
        fields.serialize_field("findings", &self.findings)?;
        fields.serialize_field("agreement", &self.agreement)?;
        fields.end()
    }
}

impl CheckReport {
    /// Highest severity of the findings.
    pub fn worst(&self) -> Severity {
        self.findings.iter().map(|finding| finding.severity).max().unwrap_or(Severity::Good)
    }
}

/// Measurements that comparisons use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Measurement {
    Gyroscope,
    Accelerometer,
    /// Angles of the joints.
    Joints,
}

/// Findings in the order of the checks.
#[derive(Debug, Default)]
pub(super) struct Findings {
    pub(super) list: Vec<Finding>,
    /// Measurements with a fault that is reported: comparisons with them would report its consequences as causes.
    faulty: BTreeSet<Measurement>,
    /// Keys of the cameras with a fault of their stamps that is reported.
    faulty_cameras: BTreeSet<String>,
    /// Places of the findings about a misfit, each with its camera or topic: causes with their faults, and without faults
    /// unexplained ones.
    misfits: BTreeMap<usize, String>,
    /// Places of the findings by comparisons of two sources of which the other one may be wrong, with the measurements that they
    /// use.
    by_pair: BTreeMap<usize, Vec<Measurement>>,
    /// Places of the findings that are the consequence of some fault and explain none.
    symptoms: BTreeSet<usize>,
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
        let [title, evidence, remedy] = [title.into(), evidence.into(), remedy.into()].map(without_signed_zeros);
        self.push(severity, area, [title, evidence, remedy], Basis::Measured);
    }

    fn push(&mut self, severity: Severity, area: Area, texts: [String; 3], basis: Basis) {
        let ([title, evidence, remedy], interval) = (texts, FindingInterval::default());
        let faults = Vec::new();
        self.list.push(Finding { severity, area, title, evidence, remedy, interval, basis, faults });
    }

    /// States the time in which the finding that was added last holds, from the first to the last of some stamps in
    /// nanoseconds since the log began.
    pub(super) fn state_interval(&mut self, stamps_ns: impl IntoIterator<Item = i64>) {
        let range = stamps_ns.into_iter().fold(None, |range: Option<(i64, i64)>, stamp_ns| {
            Some(range.map_or((stamp_ns, stamp_ns), |(first, last)| (first.min(stamp_ns), last.max(stamp_ns))))
        });
        if let Some((first_ns, last_ns)) = range {
            self.state_times(Some(seconds_from_ns(first_ns)), Some(seconds_from_ns(last_ns)));
        }
    }

    /// The same from times in seconds; `None` stands for the start and the end of the log.
    pub(super) fn state_times(&mut self, since_s: Option<f64>, until_s: Option<f64>) {
        if let Some(last) = self.list.last_mut() {
            last.interval = FindingInterval { since_s, until_s };
        }
    }

    /// States the fault of the finding that was added last with its value, or the faults one of which it is.
    pub(super) fn state_faults(&mut self, faults: impl IntoIterator<Item = Fault>) {
        if let Some(last) = self.list.last_mut() {
            last.faults.extend(faults);
            last.interval.since_s = last.interval.since_s.or_else(|| last.since_s());
        }
    }

    /// Marks the finding that was added last as one about a misfit of a camera or a topic, whose cause other sources may
    /// exclude.
    pub(super) fn mark_misfit(&mut self, of: &str) {
        self.misfits.extend(self.list.len().checked_sub(1).map(|place| (place, of.to_owned())));
    }

    /// True if a misfit of a camera or a topic is reported without a cause.
    pub(super) fn is_unexplained(&self, of: &str) -> bool {
        self.misfits.iter().any(|(place, subject)| subject == of && self.list[*place].faults.is_empty())
    }

    /// Findings but for symptoms, and misfits without a cause.
    pub(super) fn explained(&self) -> impl Iterator<Item = &Finding> {
        let findings = self.list.iter().enumerate();
        let explained = |(place, it): &(usize, &Finding)| {
            !it.faults.is_empty() || !(self.misfits.contains_key(place) || self.symptoms.contains(place))
        };
        findings.filter(explained).map(|(_, finding)| finding)
    }

    /// Marks the finding that was added last as one by a comparison of measurements with another source, which a third one may
    /// exclude.
    pub(super) fn mark_by_pair(&mut self, measurements: &[Measurement]) {
        self.by_pair.extend(self.list.len().checked_sub(1).map(|place| (place, measurements.to_vec())));
    }

    /// True if a comparison of a measurement with another source reported a fault.
    pub(super) fn is_by_pair(&self, measurement: Measurement) -> bool {
        self.by_pair.values().any(|measurements| measurements.contains(&measurement))
    }

    /// Marks the finding that was added last as a consequence of some fault, which explains no misfit.
    pub(super) fn mark_symptom(&mut self) {
        self.symptoms.extend(self.list.len().checked_sub(1));
    }

    /// Removes and returns the findings about a misfit that are excluded.
    pub(super) fn retract_misfits(&mut self, is_excluded: impl Fn(&Finding) -> bool) -> Vec<Finding> {
        let places = self.misfits.keys().copied().filter(|place| is_excluded(&self.list[*place])).collect();
        self.retract(&places)
    }

    /// Removes and returns the findings by comparisons of a measurement with another source that are excluded.
    pub(super) fn retract_by_pair(
        &mut self,
        measurement: Measurement,
        is_excluded: impl Fn(&Finding) -> bool,
    ) -> Vec<Finding> {
        let uses = self.by_pair.iter().filter(|(_, measurements)| measurements.contains(&measurement));
        let places = uses.map(|(place, _)| *place).filter(|place| is_excluded(&self.list[*place])).collect();
        self.retract(&places)
    }

    /// Removes and returns the findings at some places.
    fn retract(&mut self, places: &BTreeSet<usize>) -> Vec<Finding> {
        let moved = |place: usize| place - places.range(..place).count();
        let kept = |place: &usize| !places.contains(place);
        self.symptoms = self.symptoms.iter().copied().filter(kept).map(moved).collect();
        self.by_pair.retain(|place, _| kept(place));
        self.by_pair = std::mem::take(&mut self.by_pair).into_iter().map(|(place, of)| (moved(place), of)).collect();
        self.misfits.retain(|place, _| kept(place));
        self.misfits = std::mem::take(&mut self.misfits).into_iter().map(|(place, of)| (moved(place), of)).collect();
        let (removed, list): (Vec<_>, Vec<_>) =
            std::mem::take(&mut self.list).into_iter().enumerate().partition(|(place, _)| places.contains(place));
        self.list = list.into_iter().map(|(_, finding)| finding).collect();
        removed.into_iter().map(|(_, finding)| finding).collect()
    }

    /// Adds a warning about a value that is only assumed.
    pub(super) fn assumption(&mut self, area: Area, title: String, evidence: String, remedy: String) {
        self.push(Severity::Warning, area, [title, evidence, remedy], Basis::Assumed);
    }

    /// Adds a note about something that the measurements do not verify.
    pub(super) fn unverified(
        &mut self,
        area: Area,
        title: impl Into<String>,
        evidence: impl Into<String>,
        remedy: impl Into<String>,
    ) {
        self.add(Severity::Note, area, title, evidence, remedy);
        if let Some(last) = self.list.last_mut() {
            last.basis = Basis::Unverified;
        }
    }

    /// Excludes a measurement, whose fault is reported, from later comparisons.
    pub(super) fn exclude(&mut self, measurement: Measurement) {
        self.faulty.insert(measurement);
    }

    /// Allows comparisons of a measurement whose reported fault is retracted.
    pub(super) fn include(&mut self, measurement: Measurement) {
        self.faulty.remove(&measurement);
    }

    /// Excludes the images of a camera, whose stamps are reported to be wrong, from later comparisons.
    pub(super) fn exclude_camera(&mut self, key: &str) {
        self.faulty_cameras.insert(key.to_owned());
    }

    /// True unless a fault of the camera's stamps is reported.
    pub(super) fn can_compare_camera(&self, key: &str) -> bool {
        !self.faulty_cameras.contains(key)
    }

    /// True unless a fault of the measurement is reported.
    pub(super) fn can_compare(&self, measurement: Measurement) -> bool {
        !self.faulty.contains(&measurement)
    }

    pub(super) fn good(&mut self, area: Area, title: impl Into<String>, evidence: impl Into<String>) {
        self.add(Severity::Good, area, title, evidence, "");
    }
}
