//! Topics of the IMU's message type that contain orientations only, as published by filters of autopilots and drivers.

use crate::flight_log::messages::{self, MessageKind};
use crate::flight_log::{FlightLog, LogError};
use crate::log_check::report::{Area, Findings, Severity};
use crate::sensors::Rig;

/// Number of messages of a topic that are searched for a measurement.
const MESSAGES: usize = 200;

/// Reports the topics without angular velocities and specific forces; the estimator integrates both and uses no
/// orientation.
pub(crate) fn check_orientation_topics(log: &FlightLog, rig: Result<&Rig, &LogError>, findings: &mut Findings) {
    let topics = log.topics_of(&[MessageKind::Imu]);
    let (without, with): (Vec<&String>, Vec<&String>) = topics.iter().partition(|topic| !measures(log, topic));
    for topic in without {
        let evidence =
            format!("angular velocities and specific forces of its first {MESSAGES} messages are 0 or not set");
        let title = format!("'{topic}' holds orientations only");
        if rig.is_ok_and(|rig| rig.imu.topic == *topic) {
            let quoted: Vec<String> = with.iter().map(|topic| format!("'{topic}'")).collect();
            let remedy = if quoted.is_empty() {
                "record the topic of the raw IMU, too".to_owned()
            } else {
                format!("name a topic with measurements in imu0.rostopic: {}", quoted.join(", "))
            };
            findings.add(Severity::Error, Area::Imu, title, evidence, remedy);
        } else {
            findings.add(Severity::Note, Area::Imu, title, evidence, "it is not used: orientations are estimated");
        }
    }
}

/// True if one of the first messages has an angular velocity or a specific force.
fn measures(log: &FlightLog, topic: &str) -> bool {
    let mut read = 0;
    let found = log.find_message(topic, |data| {
        read += 1;
        let sample = messages::read_imu(data).ok();
        // Unreadable messages are reported by another check and are ignored here.
        let measured = sample.is_none_or(|sample| {
            let values = sample.angular_velocity_rad_per_s.iter().chain(&sample.specific_force_m_per_s2);
            values.copied().any(|value| value != 0.0)
        });
        (measured || read >= MESSAGES).then_some(measured)
    });
    // A topic without messages is not reported.
    found.unwrap_or(read == 0)
}
