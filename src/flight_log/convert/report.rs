use std::fmt::{Display, Formatter, Result};
use std::path::PathBuf;

use serde::Serialize;

/// Result of one topic of a source.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ConvertedTopic {
    /// Its name in the log.
    pub topic: String,
    /// Its type as the source names it, `sensor_msgs/Imu`.
    pub message_type: String,
    /// Number of messages written to the log.
    pub taken: u64,
    /// Number of messages skipped.
    pub left: u64,
    /// The reason of the first skipped message, or a remark on the written ones.
    pub reason: Option<String>,
}

/// Result of a conversion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ConversionReport {
    /// Kind of the source: `ROS 1 bag`.
    pub kind: String,
    /// The source.
    pub source: PathBuf,
    /// The log that was written.
    pub log: PathBuf,
    /// The rig beside the log: written from the source's calibration, or found there.
    pub rig: Option<PathBuf>,
    /// Length of the log in seconds.
    pub duration_s: f64,
    /// Every topic of the source, in the order of their names.
    pub topics: Vec<ConvertedTopic>,
    /// Remarks, such as damage or a missing rig.
    pub notes: Vec<String>,
}

/// A table of the topics, then the notes and the files.
impl Display for ConversionReport {
    fn fmt(&self, out: &mut Formatter<'_>) -> Result {
        writeln!(out, "{}: {}, {:.3} s", self.source.display(), self.kind, self.duration_s)?;
        let header = ["topic", "type", "taken", "left", ""].map(str::to_owned);
        let rows = self.topics.iter().map(|topic| {
            [
                topic.topic.clone(),
                topic.message_type.clone(),
                topic.taken.to_string(),
                topic.left.to_string(),
                topic.reason.clone().unwrap_or_default(),
            ]
        });
        let rows: Vec<[String; 5]> = std::iter::once(header).chain(rows).collect();
        let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
        let widths = [width(0), width(1), width(2), width(3)];
        for [topic, message_type, taken, left, reason] in &rows {
            let line = format!(
                "  {topic:0$}  {message_type:1$}  {taken:>2$}  {left:>3$}  {reason}",
                widths[0], widths[1], widths[2], widths[3]
            );
            writeln!(out, "{}", line.trim_end())?;
        }
        for note in &self.notes {
            writeln!(out, "  note: {note}")?;
        }
        writeln!(out, "{}", self.log.display())?;
        self.rig.iter().try_for_each(|rig| writeln!(out, "{}", rig.display()))
    }
}
