//! A trajectory of another program, as on the command line.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use thiserror::Error;

use super::run_spec::distinct_label;

/// Maximum number of trajectories in a session.
pub const MAX_TRAJECTORIES: usize = 4;
/// Prefix of a topic name.
const TOPIC: &str = "topic:";
/// Longest label in characters.
const MAX_LABEL: usize = 40;

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TrajectorySource {
    /// A file in TUM's or EuRoC's format.
    File(PathBuf),
    /// A topic of the log with poses.
    Topic(String),
}

/// A trajectory with its name: `FILE[:LABEL]` or `topic:/TOPIC[:LABEL]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TrajectorySpec {
    pub source: TrajectorySource,
    /// Name in tables and in the window.
    pub label: String,
}

/// The text is not a valid [`TrajectorySpec`].
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("'{text}': {problem}; expected FILE or FILE:LABEL (TUM or EuRoC), or topic:/TOPIC or topic:/TOPIC:LABEL")]
pub struct TrajectorySpecError {
    text: String,
    problem: String,
}

impl TrajectorySource {
    /// Label if none is given: name of the file or of the topic.
    fn default_label(&self) -> String {
        match self {
            Self::File(path) => {
                // For trajectory.tum in the folder of a run, the name of the folder is more informative.
                let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
                let folder = path.parent().and_then(Path::file_name).map(|name| name.to_string_lossy().into_owned());
                folder.filter(|_| stem == "trajectory").unwrap_or(stem)
            }
            Self::Topic(topic) => topic.trim_start_matches('/').to_owned(),
        }
    }
}

impl fmt::Display for TrajectorySource {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(path) => write!(formatter, "{}", path.display()),
            Self::Topic(topic) => write!(formatter, "{TOPIC}{topic}"),
        }
    }
}

impl FromStr for TrajectorySource {
    type Err = TrajectorySpecError;

    fn from_str(text: &str) -> Result<Self, TrajectorySpecError> {
        let (topic, place) = text.strip_prefix(TOPIC).map_or((false, text), |topic| (true, topic));
        if place.is_empty() {
            let problem = "it names no file and no topic".to_owned();
            return Err(TrajectorySpecError { text: text.to_owned(), problem });
        }
        Ok(if topic { Self::Topic(place.to_owned()) } else { Self::File(PathBuf::from(place)) })
    }
}

impl FromStr for TrajectorySpec {
    type Err = TrajectorySpecError;

    fn from_str(text: &str) -> Result<Self, TrajectorySpecError> {
        let bad = |problem: String| TrajectorySpecError { text: text.to_owned(), problem };
        let (prefix, rest) = text.strip_prefix(TOPIC).map_or(("", text), |rest| (TOPIC, rest));
        // The text after the last colon is a label unless it is part of a path, as after a drive letter.
        let label = rest.rsplit_once(':').filter(|(_, label)| !label.contains(['/', '\\']));
        let (place, label) = label.map_or((rest, None), |(place, label)| (place, Some(label)));
        let source: TrajectorySource = format!("{prefix}{place}").parse()?;
        if let Some(label) = label
            && (label.is_empty() || label.chars().count() > MAX_LABEL || label.chars().any(char::is_control))
        {
            return Err(bad(format!(
                "the label '{label}' has no character, a control character or more than {MAX_LABEL}"
            )));
        }
        let label = label.map_or_else(|| source.default_label(), str::to_owned);
        Ok(Self { source, label })
    }
}

impl fmt::Display for TrajectorySpec {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}", self.source)?;
        if self.label == self.source.default_label() { Ok(()) } else { write!(formatter, ":{}", self.label) }
    }
}

/// Makes the labels of trajectories different from each other and from the labels of runs by appending numbers.
pub(in crate::session) fn distinct_trajectory_labels(specs: &mut [TrajectorySpec], runs: &[&str]) {
    for index in 0..specs.len() {
        let (earlier, later) = specs.split_at_mut(index);
        let is_taken = |label: &str| runs.contains(&label) || earlier.iter().any(|spec| spec.label == label);
        later[0].label = distinct_label(&later[0].label, is_taken);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sources_and_labels_are_read_and_written() {
        let check = |text: &str, source: &str, label: &str| {
            let spec: TrajectorySpec = text.parse().unwrap();
            assert_eq!((spec.source.to_string().as_str(), spec.label.as_str()), (source, label), "{text}");
            assert_eq!(spec.to_string().parse::<TrajectorySpec>().unwrap(), spec);
        };
        check("vins.tum", "vins.tum", "vins");
        check("out/vins.csv:VINS-Fusion", "out/vins.csv", "VINS-Fusion");
        check("results/auto/trajectory.tum", "results/auto/trajectory.tum", "auto");
        check(r"C:\data\vins.tum", r"C:\data\vins.tum", if cfg!(windows) { "vins" } else { r"C:\data\vins" });
        check("topic:/vins/odometry", "topic:/vins/odometry", "vins/odometry");
        check("topic:/vins/odometry:VINS", "topic:/vins/odometry", "VINS");
        for text in ["", ":label", "topic:", "a.tum:"] {
            assert!(text.parse::<TrajectorySpec>().is_err(), "{text}");
        }
    }

    #[test]
    fn labels_become_distinct() {
        let mut specs: Vec<TrajectorySpec> =
            ["a.tum:auto", "b.tum:auto", "c.tum"].iter().map(|text| text.parse().unwrap()).collect();
        distinct_trajectory_labels(&mut specs, &["auto"]);
        let labels: Vec<&str> = specs.iter().map(|spec| spec.label.as_str()).collect();
        assert_eq!(labels, ["auto-2", "auto-3", "c"]);
    }
}
