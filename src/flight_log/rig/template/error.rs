//! Errors of a rig for a recording without one.

use thiserror::Error;

/// Reason why a rig cannot be written.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum TemplateError {
    #[error(
        "unknown camera '{given}': expected fov:DEG, info, info:TOPIC or a name such as '{nearest}' (--list prints all)"
    )]
    UnknownCamera {
        /// The given text.
        given: String,
        /// Name with the smallest edit distance.
        nearest: &'static str,
    },
    /// A field of view that is none.
    #[error(
        "'{given}' is not a field of view: expected fov:DEG with degrees across the image from 1 to 220, as in fov:84"
    )]
    FieldOfView {
        /// The given text.
        given: String,
    },
    #[error(
        "unknown mechanism '{given}': expected yaw, roll and pitch in the order from the vehicle to the camera, as in \
         yaw-roll-pitch, no axis twice in a row, or rigid"
    )]
    UnknownMechanism {
        /// The given text.
        given: String,
    },
    /// The log has no such topic.
    #[error("the log has no {what}: {remedy}")]
    NoTopic {
        /// Kind of topic.
        what: String,
        remedy: String,
    },
    /// The log has several such topics.
    #[error("the log has several {what}: name one with {option}, of {}", available.join(", "))]
    SeveralTopics {
        /// Kind of topic.
        what: String,
        /// Option to select a topic.
        option: &'static str,
        available: Vec<String>,
    },
    /// There is no camera model in the log.
    #[error("no camera model in the log: {reason}; give one with --camera fov:DEG")]
    NoCameraInfo { reason: String },
    /// The image size is not known.
    #[error("the size of the images is unknown: {reason}; give it with --size WxH")]
    NoSize { reason: String },
    /// The meaning of an attitude topic is not complete.
    #[error("--attitude: {problem}")]
    Attitude { problem: String },
    /// The joints of the log do not match the mechanism.
    #[error("the joints of {topic} ({}) do not match the mechanism {mechanism}: name them in its order with --joints", found.join(", "))]
    Joints {
        topic: String,
        /// Names of the log's joints.
        found: Vec<String>,
        /// Axes of the mechanism.
        mechanism: String,
    },
}
