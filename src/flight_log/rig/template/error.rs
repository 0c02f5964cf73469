//! Errors of a rig for a recording without one.

use thiserror::Error;

/// Reason why a rig cannot be written.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum TemplateError {
    #[error(
        "unknown camera '{given}': expected fov:DEG, info, info:TOPIC or a name such as '{nearest}' (--list prints all)"
    )]
    UnknownCamera {
        given: String,
        /// Name with the smallest edit distance.
        nearest: &'static str,
    },
    #[error(
        "'{given}' is not a field of view: expected fov:DEG with degrees across the image from 1 to 220, as in fov:84"
    )]
    FieldOfView { given: String },
    #[error(
        "unknown mechanism '{given}': expected yaw, roll and pitch in the order from the vehicle to the camera, as in \
         yaw-roll-pitch, no axis twice in a row, or rigid"
    )]
    UnknownMechanism { given: String },
    #[error("the log has no {what}: {remedy}")]
    NoTopic { what: String, remedy: String },
    #[error("the log has several {what}: name one with {option}, of {}", available.join(", "))]
    SeveralTopics { what: String, option: &'static str, available: Vec<String> },
    #[error("no camera model in the log: {reason}; give one with --camera fov:DEG")]
    NoCameraInfo { reason: String },
    #[error("the size of the images is unknown: {reason}; give it with --size WxH")]
    NoSize { reason: String },
    #[error("--attitude: {problem}")]
    Attitude { problem: String },
    #[error("the joints of {topic} ({}) do not match the mechanism {mechanism}: name them in its order with --joints", found.join(", "))]
    Joints { topic: String, found: Vec<String>, mechanism: String },
}
