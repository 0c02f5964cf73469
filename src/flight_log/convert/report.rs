use std::fmt::{Display, Formatter, Result};
use std::path::{Path, PathBuf};

use serde::{Serialize, Serializer};

use super::{ForceAgreement, VideoClock};
use crate::table::text::{TextTable, left, right};
use crate::text::{printable, shortened};

/// Result of one topic of a source.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ConvertedTopic {
    /// Name in the log.
    pub topic: String,
    /// Type in the source's notation, such as `sensor_msgs/Imu`.
    pub message_type: String,
    /// Number of messages written to the log.
    pub taken: u64,
    /// Number of messages skipped.
    pub left: u64,
    /// Reason of the first skipped message, or a remark on the written ones.
    pub reason: Option<String>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ConversionReport {
    /// Kind of the source, such as `ROS 1 bag`.
    pub kind: String,
    #[serde(serialize_with = "as_text")]
    pub source: PathBuf,
    #[serde(serialize_with = "as_text")]
    pub log: PathBuf,
    /// Rig next to the log: written from the source's calibration, or existing before.
    #[serde(serialize_with = "optional_as_text")]
    pub rig: Option<PathBuf>,
    /// Length of the log in seconds.
    pub duration_s: f64,
    /// Relation of the video's clock to the autopilot's log; `None` without both.
    pub video_clock: Option<VideoClock>,
    /// Evidence for this clock if it was found by the specific forces of autopilot and camera.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub forces: Option<ForceAgreement>,
    /// All topics of the source, in the order of their names.
    pub topics: Vec<ConvertedTopic>,
    /// Remarks, such as damage or a missing rig.
    pub notes: Vec<String>,
}

/// Serializes a path, which need not be UTF-8, as text.
fn as_text<S: Serializer>(path: &Path, serializer: S) -> std::result::Result<S::Ok, S::Error> {
    path.to_string_lossy().serialize(serializer)
}

#[expect(clippy::ref_option, reason = "the signature that serde calls")]
fn optional_as_text<S: Serializer>(path: &Option<PathBuf>, serializer: S) -> std::result::Result<S::Ok, S::Error> {
    path.as_deref().map(Path::to_string_lossy).serialize(serializer)
}

/// Largest number of characters of a topic or a type in the table; longer ones are cut.
const WIDEST_NAME: usize = 60;

/// Table of the topics, then the notes and the files.
impl Display for ConversionReport {
    fn fmt(&self, out: &mut Formatter<'_>) -> Result {
        writeln!(out, "{}: {}, {:.3} s", self.source.display(), self.kind, self.duration_s)?;
        let columns = [left("topic", 0), left("type", 0), right("taken", 0), right("left", 0), left("", 0)];
        let rows = self.topics.iter().map(|topic| {
            [
                shortened(&topic.topic, WIDEST_NAME).into_owned(),
                shortened(&topic.message_type, WIDEST_NAME).into_owned(),
                topic.taken.to_string(),
                topic.left.to_string(),
                topic.reason.as_deref().map(printable).unwrap_or_default().into_owned(),
            ]
        });
        write!(out, "{}", TextTable::new(columns, rows))?;
        for note in &self.notes {
            writeln!(out, "  note: {}", printable(note))?;
        }
        writeln!(out, "{}", self.log.display())?;
        self.rig.iter().try_for_each(|rig| writeln!(out, "{}", rig.display()))
    }
}
