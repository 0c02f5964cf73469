//! Robot description of a log, as published on `/robot_description`.

use std::path::PathBuf;

use crate::files::urdf::{RobotModel, UrdfError};
use crate::flight_log::messages::cdr::CdrReader;
use crate::flight_log::{FlightLog, TopicInfo};

/// Type of the messages on `/robot_description`.
const STRING_TYPES: [&str; 2] = ["std_msgs/msg/String", "std_msgs/String"];

impl RobotModel {
    /// Reads the first message with a description on a topic of a log, such as `/robot_description`.
    ///
    /// # Errors
    /// When the log has no such message, or it is no URDF.
    pub fn of_topic(log: &FlightLog, topic: &str) -> Result<Self, UrdfError> {
        let info = log.topics().iter().find(|info| info.topic == topic);
        let is_text = info.is_some_and(|info| STRING_TYPES.contains(&info.schema.as_str()) && info.encoding == "cdr");
        let found = if is_text { log.find_message(topic, text_of_message) } else { None };
        let text = found.ok_or_else(|| {
            let of_type = |info: &&TopicInfo| STRING_TYPES.contains(&info.schema.as_str());
            let available = log.topics().iter().filter(of_type).map(|info| info.topic.clone()).collect();
            UrdfError::NoTopic { topic: topic.to_owned(), available, path: log.path().to_owned() }
        })?;
        Self::parse(text, &PathBuf::from(format!("{} ({topic})", log.path().display())))
    }
}

/// Content of a `std_msgs/msg/String` in CDR.
fn text_of_message(data: &[u8]) -> Option<String> {
    let mut reader = CdrReader::new(data).ok()?;
    let text = reader.read_string().ok()?;
    (!text.trim().is_empty()).then(|| text.to_owned())
}
