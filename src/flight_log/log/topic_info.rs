//! Topics of a log, and descriptions of those that cannot be read, each with a remedy that works.

use crate::flight_log::messages::MessageKind;
use crate::text::{counted, printable};

/// Remedy for messages in an encoding that neither this program nor `dcvins convert` reads.
const RECORD_CDR: &str = "neither is this encoding read nor does `dcvins convert` convert it: record ROS 2 messages in \
                          CDR (`ros2 bag record -s mcap`)";
/// Remedy for messages that `dcvins convert` reads.
const CONVERT: &str = "convert the log with `dcvins convert LOG -o NEW.mcap`, and name NEW.mcap";

#[derive(Clone, Debug, PartialEq)]
pub struct TopicInfo {
    pub topic: String,
    /// Schema name, such as `sensor_msgs/msg/Imu`.
    pub schema: String,
    /// Encoding of the messages, such as `cdr` or `ros1`.
    pub encoding: String,
    /// Kind of the messages, `None` if they are ignored.
    pub kind: Option<MessageKind>,
    /// Number of messages by the log's index.
    pub count: u64,
    /// Log time of the first message since the start of the log.
    pub first_ns: i64,
    /// Log time of the last message since the start of the log.
    pub last_ns: i64,
    /// Mean rate over the log times in Hz, 0 for fewer than two messages.
    pub rate_hz: f64,
}

/// Name of a message encoding of MCAP for readers: `ROS 1`, `JSON`, ….
fn encoding_name(encoding: &str) -> String {
    match encoding {
        "ros1" => "ROS 1".to_owned(),
        "cdr" => "CDR".to_owned(),
        "json" => "JSON".to_owned(),
        "" => "an unnamed".to_owned(),
        other => printable(other).into_owned(),
    }
}

impl TopicInfo {
    /// Type and encoding, such as `sensor_msgs/Imu in ROS 1 encoding`.
    pub(crate) fn type_in_encoding(&self) -> String {
        let schema = if self.schema.is_empty() { "no named type".into() } else { printable(&self.schema) };
        format!("{schema} in {} encoding", encoding_name(&self.encoding))
    }

    /// Name, with the encoding if that alone keeps its messages from being read.
    pub(crate) fn name_with_encoding(&self) -> String {
        match self.encoding.as_str() {
            "cdr" => self.topic.clone(),
            encoding => format!("{} ({})", self.topic, encoding_name(encoding)),
        }
    }

    /// True if messages of this type would be read in another encoding.
    pub(crate) fn has_unread_encoding(&self, kinds: &[MessageKind]) -> bool {
        self.kind.is_none() && MessageKind::from_schema_name(&self.schema).is_some_and(|kind| kinds.contains(&kind))
    }

    /// Instruction for a topic whose messages are not read in their encoding.
    pub(crate) fn encoding_remedy(&self) -> &'static str {
        let kind = MessageKind::from_schema_name(&self.schema);
        let converts = kind.is_some_and(|kind| !kind.is_video() && !kind.counts_since_boot());
        if self.encoding == "ros1" && converts { CONVERT } else { RECORD_CDR }
    }
}

/// Problem and remedy of a log of which no topic is read: encodings with their numbers of topics, or the types.
pub(crate) fn nothing_read(topics: &[TopicInfo]) -> (String, &'static str) {
    let unread: Vec<&TopicInfo> =
        topics.iter().filter(|info| MessageKind::from_schema_name(&info.schema).is_some()).collect();
    let Some(first) = unread.first() else {
        let shown: Vec<String> =
            topics.iter().take(3).map(|info| format!("{}: {}", info.topic, info.type_in_encoding())).collect();
        let more = if topics.len() > shown.len() { ", …" } else { "" };
        let count = counted(topics.len(), "topic");
        let problem = format!("{count}, none of a type that is read ({}{more})", shown.join(", "));
        return (problem, "record images and sensor_msgs/msg/Imu of ROS 2");
    };
    let of_first = unread.iter().filter(|info| info.encoding == first.encoding).count();
    let problem = format!(
        "the messages of {} are in {} encoding, expected CDR of ROS 2",
        counted(of_first, "topic"),
        encoding_name(&first.encoding)
    );
    (problem, first.encoding_remedy())
}
