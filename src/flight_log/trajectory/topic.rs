//! Poses and positions on a topic of a log.

use nalgebra::Vector3;

use super::super::messages::{self, MessageKind};
use super::super::{FlightLog, LogError};
use super::RecordedPose;
use super::geodesy::Geodetic;
use crate::flight_log::log::relative_ns;
use crate::flight_log::messages::cdr::{CdrError, CdrReader};
use crate::flight_log::stamps::clock::StampClock;

/// Message types of a trajectory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Content {
    Pose(MessageKind),
    /// Position in a `geometry_msgs/msg/PointStamped`.
    Point,
    /// Position in a `sensor_msgs/msg/NavSatFix`.
    Fix,
}

/// Names of the supported message types.
const TYPES: &str = "nav_msgs/msg/Odometry, geometry_msgs/msg/PoseStamped, geometry_msgs/msg/TransformStamped, \
    geometry_msgs/msg/PointStamped, sensor_msgs/msg/NavSatFix";

impl FlightLog {
    /// True for a topic with positions without attitudes.
    pub fn is_position_topic(&self, topic: &str) -> bool {
        let content = self.topic(topic).and_then(|info| content_of(&info.schema, info.kind));
        matches!(content, Some(Content::Point | Content::Fix))
    }

    /// Reads poses or positions of a topic in the order of their header stamps; of several with one stamp the first is
    /// kept.
    /// Fixes of a satellite receiver are metres east, north and up of the first one. Messages without a pose are
    /// skipped.
    ///
    /// # Errors
    /// When the log has no such topic, its type is another one, or no message can be used.
    pub fn read_trajectory_topic(&self, topic: &str) -> Result<Vec<RecordedPose>, LogError> {
        self.trajectory_of_topic(topic, StampClock::Stamps)
    }

    /// [`Self::read_trajectory_topic`] with the stamps of a clock.
    pub(crate) fn trajectory_of_topic(&self, topic: &str, clock: StampClock) -> Result<Vec<RecordedPose>, LogError> {
        let unusable = |problem: String| LogError::Trajectory { problem, path: self.path().to_owned() };
        let info = self.topic(topic).ok_or_else(|| {
            let candidates = self.topics().iter().filter(|info| content_of(&info.schema, info.kind).is_some());
            let names: Vec<&str> = candidates.map(|info| info.topic.as_str()).collect();
            let names = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
            unusable(format!("no topic '{topic}' in the log; topics with poses or positions: {names}"))
        })?;
        let content = content_of(&info.schema, info.kind)
            .ok_or_else(|| unusable(format!("topic '{topic}' is of type {}, expected one of {TYPES}", info.schema)))?;
        let mut origin = None;
        let mut poses: Vec<RecordedPose> = Vec::new();
        self.for_each_message(topic, |log_time_ns, data| {
            let logged_ns = u64::try_from(self.epoch_ns().saturating_add(log_time_ns)).unwrap_or(0);
            let pose = read(content, data, &mut origin).ok().and_then(|read| read.pose);
            poses.extend(pose.map(|pose| RecordedPose { stamp_ns: clock.stamp_ns(pose.stamp_ns, logged_ns), ..pose }));
            true
        });
        if poses.is_empty() {
            return Err(unusable(format!("topic '{topic}' has no message with a usable pose or position")));
        }
        poses.sort_by_key(|pose| pose.stamp_ns);
        poses.dedup_by_key(|pose| pose.stamp_ns);
        Ok(poses)
    }

    /// Stamps of the messages of a topic without a usable pose or position, in nanoseconds since the log began, each with
    /// true for a receiver that states that it has no fix; empty for other topics.
    pub fn stamps_without_pose(&self, topic: &str) -> Vec<(i64, bool)> {
        let content = self.topic(topic).and_then(|info| content_of(&info.schema, info.kind));
        let (mut origin, mut stamps) = (None, Vec::new());
        if let Some(content) = content {
            self.for_each_message(topic, |_, data| {
                let unusable = read(content, data, &mut origin).ok().filter(|read| read.pose.is_none());
                stamps.extend(unusable.map(|read| (relative_ns(read.stamp_ns, self.epoch_ns()), !read.has_fix)));
                true
            });
        }
        stamps
    }
}

fn content_of(schema: &str, kind: Option<MessageKind>) -> Option<Content> {
    match (kind, schema) {
        (Some(kind @ (MessageKind::Odometry | MessageKind::PoseStamped | MessageKind::TransformStamped)), _) => {
            Some(Content::Pose(kind))
        }
        (_, "geometry_msgs/msg/PointStamped") => Some(Content::Point),
        (_, "sensor_msgs/msg/NavSatFix") => Some(Content::Fix),
        _ => None,
    }
}

/// Message of a trajectory.
struct Read {
    /// Header stamp, in nanoseconds.
    stamp_ns: i64,
    /// `None` for a message without a usable pose.
    pose: Option<RecordedPose>,
    /// False for a receiver that states that it has no fix.
    has_fix: bool,
}

/// Reads the pose of a message; `origin` is the first fix of a receiver.
fn read(content: Content, data: &[u8], origin: &mut Option<Geodetic>) -> Result<Read, CdrError> {
    if let Content::Pose(kind) = content {
        let message = messages::read_pose(kind, data)?;
        let pose = message.pose.map(|pose| RecordedPose {
            stamp_ns: message.stamp_ns,
            position_m: pose.translation_m,
            rotation: Some(pose.rotation),
        });
        return Ok(Read { stamp_ns: message.stamp_ns, pose, has_fix: true });
    }
    let mut reader = CdrReader::new(data)?;
    let stamp_ns = messages::read_header(&mut reader)?.stamp_ns;
    let mut has_fix = true;
    let position_m = if content == Content::Point {
        Some(Vector3::from(reader.read_f64s::<3>()?))
    } else {
        // −1: no fix.
        has_fix = reader.read_u8()?.cast_signed() >= 0;
        let _service = reader.read_u16()?;
        let [latitude_deg, longitude_deg, altitude_m] = reader.read_f64s::<3>()?;
        let place = Geodetic::from_deg(latitude_deg, longitude_deg, altitude_m).filter(|_| has_fix);
        place.map(|place| place.east_north_up_m(*origin.get_or_insert(place)))
    };
    let finite = position_m.filter(|position_m| position_m.iter().all(|value| value.is_finite()));
    let pose = finite.map(|position_m| RecordedPose { stamp_ns, position_m, rotation: None });
    Ok(Read { stamp_ns, pose, has_fix })
}
