//! Messages of Foxglove's WebSocket protocol, version 1: texts in JSON, measurements in binary messages.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde::Deserialize;

/// Subprotocols with these messages, of the present library and of older bridges.
pub(super) const SUBPROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
/// First byte of a binary message with a measurement.
const MESSAGE_DATA: u8 = 1;
/// Identifier of the subscription (4 bytes) and log time (8), after the first byte.
const MESSAGE_DATA_HEADER: usize = 12;

/// Topic of a server.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "camelCase")]
pub(super) struct AdvertisedTopic {
    /// Identifier of the topic on this connection.
    pub(super) id: u64,
    pub(super) topic: String,
    /// Encoding of the messages, such as `cdr`.
    pub(super) encoding: String,
    /// Name of the type, such as `sensor_msgs/msg/Imu`.
    pub(super) schema_name: String,
    /// Language of the schema; older servers leave it out.
    schema_encoding: Option<String>,
    /// Schema, in base64 if its language is no text.
    #[serde(default)]
    schema: String,
}

impl AdvertisedTopic {
    /// Language of the schema, such as `ros2msg`, `protobuf`, or nothing for messages without one.
    pub(super) fn schema_language(&self) -> &str {
        match (&self.schema_encoding, self.encoding.as_str()) {
            (Some(language), _) => language,
            (None, "cdr") => "ros2msg",
            (None, "ros1") => "ros1msg",
            (None, "json") => "jsonschema",
            (None, encoding) => encoding,
        }
    }

    /// Content of the schema.
    ///
    /// # Errors
    /// If it is not valid base64.
    pub(super) fn schema_content(&self) -> Result<Vec<u8>, String> {
        if ["protobuf", "flatbuffer"].contains(&self.schema_language()) {
            let decoded = STANDARD.decode(&self.schema);
            return decoded.map_err(|error| format!("the schema of '{}' is no base64 ({error})", self.topic));
        }
        Ok(self.schema.clone().into_bytes())
    }
}

/// Severity of a status of a server.
pub(super) const STATUS_ERROR: u8 = 2;

/// Text of a server.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq)]
#[serde(tag = "op", rename_all = "camelCase")]
pub(super) enum ServerText {
    Advertise {
        channels: Vec<AdvertisedTopic>,
    },
    Unadvertise {
        #[serde(rename = "channelIds")]
        channel_ids: Vec<u64>,
    },
    Status {
        /// 0 for information, 1 for a warning, 2 for an error.
        level: u8,
        message: String,
    },
    /// A message about something that is not used.
    #[serde(other)]
    Other,
}

/// Reads a text of a server.
///
/// # Errors
/// With the problem if it is no message of the protocol.
pub(super) fn read_text(text: &str) -> Result<ServerText, String> {
    serde_json::from_str(text).map_err(|error| format!("a text of {} bytes cannot be read ({error})", text.len()))
}

/// Measurement of a subscribed topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct MessageData<'a> {
    pub(super) subscription: u32,
    /// Time of the server's clock, in nanoseconds since the epoch.
    pub(super) log_time_ns: u64,
    pub(super) data: &'a [u8],
}

/// Reads a binary message; `None` if it is no measurement.
///
/// # Errors
/// With the problem if it is shorter than its header.
pub(super) fn read_binary(bytes: &[u8]) -> Result<Option<MessageData<'_>>, String> {
    let Some((&MESSAGE_DATA, rest)) = bytes.split_first() else { return Ok(None) };
    let parts = rest
        .split_first_chunk::<4>()
        .and_then(|(subscription, rest)| rest.split_first_chunk::<8>().map(|(time, data)| (subscription, time, data)));
    let Some((subscription, time, data)) = parts else {
        let expected = 1 + MESSAGE_DATA_HEADER;
        return Err(format!("a message has {} bytes, fewer than the {expected} of its header", bytes.len()));
    };
    let subscription = u32::from_le_bytes(*subscription);
    Ok(Some(MessageData { subscription, log_time_ns: u64::from_le_bytes(*time), data }))
}

/// Text that subscribes topics: pairs of the identifiers of the subscription and of the topic.
pub(super) fn subscribe(subscriptions: &[(u32, u64)]) -> String {
    let subscriptions: Vec<_> = subscriptions
        .iter()
        .map(|(subscription, topic)| serde_json::json!({ "id": subscription, "channelId": topic }))
        .collect();
    serde_json::json!({ "op": "subscribe", "subscriptions": subscriptions }).to_string()
}
