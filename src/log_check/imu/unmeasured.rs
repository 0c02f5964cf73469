//! IMU samples that no sensor measured (values that are not finite, zeros and frozen values), and topics that contain
//! orientations only, as published by filters of autopilots and drivers.

use crate::flight_log::imu::filter::Unmeasured;
use crate::flight_log::messages::MessageKind;
use crate::flight_log::{FlightLog, LogError, messages};
use crate::geometry::seconds_from_ns;
use crate::log_check::report::{Area, Findings, Severity};
use crate::log_check::survey::Survey;
use crate::sensors::Rig;

/// Reports how many samples are no measurement, and when; later checks do not use them.
pub(super) fn check_unmeasured(survey: &Survey, findings: &mut Findings) {
    let messages = |topic: &Option<String>| {
        let topic = topic.as_ref().and_then(|topic| survey.topics.get(topic));
        topic.map_or(0, |topic| topic.times.len())
    };
    for (reason, stamps_ns) in &survey.unmeasured {
        let of_accelerometer = *reason == Unmeasured::ZeroForce && survey.accelerometer_topic.is_some();
        let all = messages(if of_accelerometer { &survey.accelerometer_topic } else { &survey.imu_topic });
        let (first, last) = (stamps_ns.iter().min(), stamps_ns.iter().max());
        let evidence = format!(
            "{} of {all} samples ({:.1} %), the first at {:.3} s, the last at {:.3} s{}",
            stamps_ns.len(),
            100.0 * stamps_ns.len() as f64 / all.max(1) as f64,
            seconds_from_ns(first.copied().unwrap_or(0)),
            seconds_from_ns(last.copied().unwrap_or(0)),
            if *reason == Unmeasured::Frozen { stalls(stamps_ns) } else { String::new() },
        );
        let (title, remedy) = texts(*reason);
        findings.add(Severity::Warning, Area::Imu, title, evidence, remedy);
        findings.state_interval(stamps_ns.iter().copied());
    }
}

fn texts(reason: Unmeasured) -> (&'static str, &'static str) {
    match reason {
        Unmeasured::NotFinite => ("IMU samples are not finite", "check the driver; these samples are dropped"),
        Unmeasured::AllZero => (
            "IMU samples are exactly zero in all six values",
            "no sensor measures this: let the driver send nothing where a reading failed; these samples are dropped",
        ),
        Unmeasured::ZeroForce => (
            "specific forces of the IMU are exactly zero",
            "no accelerometer measures this: let the driver send nothing where a reading failed; these samples are dropped",
        ),
        Unmeasured::ZeroRate => (
            "angular velocities of the IMU are exactly zero during a rotation",
            "no gyroscope measures this: let the driver send nothing where a reading failed; these samples are dropped",
        ),
        Unmeasured::Frozen => (
            "the values of the IMU freeze",
            "the driver repeats its last reading: check the connection of the sensor; the copies are dropped, and the IMU \
             is interpolated over them",
        ),
    }
}

/// Number and longest of the intervals in which the values stay equal.
fn stalls(stamps_ns: &[i64]) -> String {
    /// Samples further apart belong to different intervals.
    const APART_NS: i64 = 100_000_000;
    let mut intervals: Vec<(i64, i64)> = Vec::new();
    for stamp_ns in stamps_ns {
        match intervals.last_mut().filter(|(_, last)| stamp_ns - last < APART_NS) {
            Some((_, last)) => *last = *stamp_ns,
            None => intervals.push((*stamp_ns, *stamp_ns)),
        }
    }
    let longest = intervals.iter().max_by_key(|(first, last)| last - first).copied().unwrap_or_default();
    let (length_s, from_s) = (seconds_from_ns(longest.1 - longest.0), seconds_from_ns(longest.0));
    match intervals.len() {
        1 => String::new(),
        count => format!("; {count} intervals, the longest of {length_s:.3} s from {from_s:.3} s on"),
    }
}

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
