//! Joint angles of a log as samples of all joints, for every kind of recording.

use std::sync::Arc;

use super::super::log::relative_ns;
use super::super::messages::{self, JointMessage, MessageKind};
use super::super::{FlightLog, LogError, WarningKind};
use super::attitude::AttitudeJoints;
use super::ordered::{Decoder, MessageSource, OrderedSamples};
use super::read_context::{ReadContext, Refusal};
use crate::flight_log::joints::{JointMerge, JointReading};
use crate::flight_log::stamps::clock::StampClock;
use crate::geometry::ns_from_seconds;
use crate::sensors::{GimbalRig, JointSample};

/// Number of messages within which every joint of the rig must occur once.
const MESSAGES_SEARCHED: usize = 1000;

/// Samples of all joints in time order.
pub(super) struct JointSamples {
    source: JointSource,
    timeshift_ns: i64,
}

enum JointSource {
    Encoders(Box<EncoderJoints>),
    Attitude(Box<AttitudeJoints>),
}

impl JointSamples {
    /// Reads from a stamp on; `topic` is the gimbal's.
    pub(super) fn new(log: &Arc<FlightLog>, gimbal: &GimbalRig, topic: &str, from_ns: i64) -> Result<Self, LogError> {
        let timeshift_ns = ns_from_seconds(gimbal.timeshift_gimbal_imu_s);
        // Log times are on the recorder's clock: of stamps ahead of it nothing may be left out.
        let from_ns = from_ns.saturating_sub(timeshift_ns.max(0));
        let source = match &gimbal.attitude {
            None => JointSource::Encoders(Box::new(EncoderJoints::new(log, gimbal, topic, from_ns)?)),
            Some(source) => JointSource::Attitude(Box::new(AttitudeJoints::new(log, gimbal, source, topic, from_ns)?)),
        };
        Ok(Self { source, timeshift_ns })
    }

    /// True for samples computed from an attitude, at lower rates than encoders have.
    pub(super) fn are_of_attitude(&self) -> bool {
        matches!(self.source, JointSource::Attitude(_))
    }

    /// Next sample, `None` at the end of the log.
    pub(super) fn next(&mut self, context: &mut ReadContext) -> Option<JointSample> {
        match &mut self.source {
            JointSource::Encoders(joints) => {
                let sample = joints.next(context)?;
                Some(JointSample { stamp_ns: sample.stamp_ns.saturating_add(self.timeshift_ns), ..sample })
            }
            // The time offset applies to the gimbal alone; the vehicle's attitude is in IMU time.
            JointSource::Attitude(joints) => joints.next(context),
        }
    }
}

/// Samples of encoders; messages with only some joints are merged by name.
struct EncoderJoints {
    topic: String,
    readings: OrderedSamples<JointReading>,
    merge: JointMerge,
    ended: bool,
    repeats_reported: bool,
}

impl EncoderJoints {
    fn new(log: &FlightLog, gimbal: &GimbalRig, topic: &str, from_ns: i64) -> Result<Self, LogError> {
        log.require_topic("gimbal.rostopic", topic, &[MessageKind::JointState])?;
        let names: Vec<String> = gimbal.joints.iter().map(|joint| joint.name.clone()).collect();
        let together = named_together(log, topic, &names)?;
        let joints = names.len();
        let readings = OrderedSamples::new(
            log,
            topic,
            from_ns,
            false,
            reading_decoder(names, log.epoch_ns(), StampClock::of_rig(gimbal.use_log_time)),
        );
        Ok(Self {
            topic: topic.to_owned(),
            readings: if together { readings } else { readings.with_equal_stamps() },
            merge: JointMerge::new(joints),
            ended: false,
            repeats_reported: false,
        })
    }

    fn next(&mut self, context: &mut ReadContext) -> Option<JointSample> {
        loop {
            if let Some(sample) = self.merge.pop() {
                return Some(sample);
            }
            if self.ended {
                return None;
            }
            let Some((stamp_ns, reading)) = self.readings.next(context) else {
                self.ended = true;
                self.merge.finish();
                continue;
            };
            if !self.merge.push(&reading) && !std::mem::replace(&mut self.repeats_reported, true) {
                let message = format!("{}: a joint has two readings with one stamp; the first one is used", self.topic);
                context.warn(WarningKind::RepeatedReading, &self.topic, stamp_ns, message);
            }
        }
    }
}

/// Returns true if every message contains all joints; an error if none of the first messages contains one of them.
fn named_together(log: &FlightLog, topic: &str, names: &[String]) -> Result<bool, LogError> {
    let mut known: Vec<String> = Vec::new();
    let mut together = true;
    let mut searched = 0;
    let complete = log.find_message(topic, |data| {
        searched += 1;
        if let Ok(message) = messages::read_joint_state(data) {
            for name in &message.names {
                if !known.iter().any(|other| other == name) {
                    known.push((*name).to_owned());
                }
            }
            together &= names.iter().all(|name| message.names.contains(&name.as_str()));
            if names.iter().all(|name| known.contains(name)) {
                return Some(true);
            }
        }
        (searched >= MESSAGES_SEARCHED).then_some(false)
    });
    let missing = names.iter().position(|name| !known.contains(name));
    match missing.filter(|_| complete != Some(true) && !known.is_empty()) {
        Some(link) => Err(LogError::UnknownJoint {
            link,
            joint: names[link].clone(),
            topic: topic.to_owned(),
            available: known,
            path: log.path().to_owned(),
        }),
        None => Ok(together),
    }
}

fn reading_decoder(names: Vec<String>, epoch_ns: i64, clock: StampClock) -> Decoder<JointReading> {
    Box::new(move |source: MessageSource<'_>| {
        let message = messages::read_joint_state(source.data).map_err(|error| Refusal::not_decodable(&error))?;
        if message.lacks_positions() {
            return Err(Refusal { reason: "joints have no position", detail: message.length_problem() });
        }
        let angles_rad: Vec<Option<f64>> = names.iter().map(|name| angle_of(&message, name)).collect();
        if let Some(joint) = angles_rad.iter().position(|angle| angle.is_some_and(|angle| !angle.is_finite())) {
            let detail = format!("{}: {}", names[joint], angles_rad[joint].unwrap_or(f64::NAN));
            return Err(Refusal { reason: "values are not finite", detail });
        }
        if angles_rad.iter().all(Option::is_none) {
            return Err(Refusal { reason: "it names no joint of the rig", detail: message.names.join(", ") });
        }
        let absolute_ns = clock.stamp_ns(message.stamp_ns, source.position.log_time_ns);
        Ok((absolute_ns, JointReading { stamp_ns: relative_ns(absolute_ns, epoch_ns), angles_rad }))
    })
}

fn angle_of(message: &JointMessage<'_>, name: &str) -> Option<f64> {
    let place = message.names.iter().position(|known| *known == name)?;
    message.positions_rad.get(place).copied()
}
