//! MCAP files of other recorders: ROS 2 messages are copied, ROS 1 messages rewritten.

use std::path::Path;

use mcap::MessageStream;
use mcap::read::Options;

use super::super::container::ContainerIndex;
use super::super::file::LogFile;
use super::ConvertError;
use super::sink::{Payload, Sink, SourceMessage};

/// Converts one file with its attachments. An unfinished file is converted up to its end.
pub(super) fn convert(path: &Path, sink: &mut Sink<'_>) -> Result<(), ConvertError> {
    let file = LogFile::open(path)?;
    let failed = |error: mcap::McapError| ConvertError::unreadable(format!("not an MCAP log: {error}"), path);
    let messages = MessageStream::new_with_options(&file, Options::IgnoreEndMagic.into()).map_err(failed)?;
    for (taken, message) in messages.enumerate() {
        let message = match message {
            Ok(message) => message,
            Err(error) => {
                sink.note(format!(
                    "{} is damaged after {taken} messages: {error}; everything before is in the log",
                    path.display()
                ));
                break;
            }
        };
        let channel = &message.channel;
        let schema = channel.schema.as_ref();
        let definition = schema.filter(|schema| schema.encoding == "ros2msg");
        sink.take(&SourceMessage {
            topic: &channel.topic,
            message_type: schema.map_or("", |schema| &schema.name),
            definition: definition.and_then(|schema| std::str::from_utf8(&schema.data).ok()),
            log_time_ns: i64::try_from(message.log_time).unwrap_or(i64::MAX),
            payload: match channel.message_encoding.as_str() {
                "cdr" => Payload::Cdr(&message.data),
                "ros1" => Payload::Ros1(&message.data),
                other => Payload::Other(other),
            },
        })?;
    }
    let index = ContainerIndex::read(&file);
    for place in &index.attachments {
        let content = ContainerIndex::attachment(&file, place).and_then(|content| std::str::from_utf8(content).ok());
        match content {
            Some(content) => sink.writer.attach(&place.name, "text/plain", content, 0)?,
            None => sink.note(format!("the attachment {} is damaged or no text, and is left out", place.name)),
        }
    }
    Ok(())
}
