//! The file and its topics: damage, unreadable messages, topics that the rig names, and the use of each topic.

use super::report::{Area, Findings, Severity, TopicReport};
use super::survey::Survey;
use crate::flight_log::joints::attitude::{VEHICLE_KINDS, gimbal_kinds, topic_field};
use crate::flight_log::log::topic_info::nothing_read;
use crate::flight_log::{FlightLog, LogError, MessageKind, TopicInfo, WarningKind};
use crate::geometry::seconds_from_ns;
use crate::sensors::Rig;

/// Reports damage to the file, unreadable messages, and topics of other types.
pub(super) fn check_file(log: &FlightLog, survey: &Survey, rig: Option<&Rig>, findings: &mut Findings) {
    let is_used = |topic: &str| {
        let role = role_of(topic, log.topic(topic).and_then(|info| info.kind), rig);
        !["ignored", "intrinsics", "not in the rig"].contains(&role.as_str())
    };
    // The check of the stamps reports topics of the rig without any.
    let is_known = |topic: &str| {
        rig.is_some_and(|rig| rig.uses_log_time(topic))
            || (is_used(topic) && survey.topics.get(topic).is_some_and(|topic| topic.has_one_stamp()))
    };
    for warning in log.warnings() {
        let (area, title, remedy) = match warning.kind {
            WarningKind::Damage => (
                Area::Log,
                "the file is truncated or damaged",
                "copy the file again from the recorder; data after the damage are not used",
            ),
            WarningKind::Stamps if is_known(&warning.subject) => continue,
            WarningKind::Stamps => (
                Area::Time,
                "the stamps of a topic are not of the log's time",
                "set header.stamp to the time of measurement in the driver",
            ),
            WarningKind::Topics => (Area::Log, "topics are not read", ""),
            WarningKind::NothingRead => {
                let (problem, remedy) = nothing_read(log.topics());
                findings.add(Severity::Error, Area::Log, "no topic can be read", problem, remedy);
                continue;
            }
            _ => (Area::Log, "the log cannot be read completely", ""),
        };
        findings.add(Severity::Warning, area, title, warning.message.clone(), remedy);
    }
    for damage in &survey.damages {
        let remedy = "copy the file again; the chunk is skipped and reading continues after it";
        findings.add(Severity::Warning, Area::Log, "a chunk is damaged", damage.clone(), remedy);
    }
    for topic in survey.topics.values().filter(|topic| topic.unreadable > 0) {
        let title = format!("messages of {} cannot be decoded", topic.topic);
        let count = log.topic(&topic.topic).map_or(0, |info| info.count).max(topic.unreadable as u64);
        let evidence = format!("{} of {count}; the first: {}", topic.unreadable, topic.first_problem);
        findings.add(Severity::Warning, Area::Log, title, evidence, "check the recorder's message definitions");
    }
    for topic in survey.topics.values() {
        let Some((count, content)) = topic.without_positions else { continue };
        let title = format!("messages of {} have {content} but no positions", topic.topic);
        let evidence = format!("{count} of {} messages", log.topic(&topic.topic).map_or(0, |info| info.count));
        let remedy = "record joint positions (absolute encoder angles), or compute the angles from attitudes with \
                      gimbal.source; velocities are not integrated";
        findings.add(Severity::Error, Area::Encoders, title, evidence, remedy);
    }
    let ignored: Vec<String> =
        log.topics().iter().filter(|info| info.kind.is_none()).map(TopicInfo::name_with_encoding).collect();
    if !ignored.is_empty() {
        let title = "topics of types or encodings that are not read";
        findings.add(Severity::Note, Area::Log, title, ignored.join(", "), "");
    }
}

const POSES: [MessageKind; 3] = [MessageKind::Odometry, MessageKind::PoseStamped, MessageKind::TransformStamped];

/// Title, evidence and remedy of a topic of the rig that the log does not have in a readable form.
fn topic_problem(log: &FlightLog, error: &LogError, kinds: &[MessageKind]) -> [String; 3] {
    let quoted: Vec<String> = log.topics_of(kinds).iter().map(|topic| format!("'{topic}'")).collect();
    let expected: Vec<&str> = kinds.iter().map(|kind| kind.schema_name()).collect();
    let available = match (quoted.as_slice(), log.unread_topic_of(kinds)) {
        ([], Some(unread)) => format!("'{}', which cannot be read: {}", unread.topic, unread.type_in_encoding()),
        ([], None) => "none".to_owned(),
        _ => quoted.join(", "),
    };
    let available = format!("the log's topics of type {} are {available}", expected.join(" or "));
    let name = "name one of the log's topics in the rig".to_owned();
    match error {
        LogError::UnreadEncoding { field, topic, found, remedy, .. } => {
            let title = format!("{field} names a topic whose messages cannot be read");
            [title, format!("'{topic}': {found}"), (*remedy).to_owned()]
        }
        LogError::OtherType { field, topic, found, .. } => {
            let title = format!("{field} names a topic with messages of another type");
            [title, format!("'{topic}': {found}"), name]
        }
        LogError::MissingTopic { field, topic, .. } => {
            [format!("{field} names a topic that is not in the log"), format!("'{topic}'; {available}"), name]
        }
        other => ["a topic of the rig cannot be used".to_owned(), other.to_string(), String::new()],
    }
}

/// Checks that the log has the topics that the rig names.
pub(super) fn check_topics(log: &FlightLog, rig: &Rig, findings: &mut Findings) {
    let mut named = 0;
    let mut require = |field: String, topic: &str, kinds: &[MessageKind], severity| {
        named += 1;
        if let Err(error) = log.require_topic(&field, topic, kinds) {
            let [title, evidence, remedy] = topic_problem(log, &error, kinds);
            findings.add(severity, Area::Log, title, evidence, remedy);
            named -= 1;
        }
    };
    require("imu0.rostopic".into(), &rig.imu.topic, &[MessageKind::Imu], Severity::Error);
    if let Some(topic) = &rig.imu.accelerometer_topic {
        require("imu0.accelerometer_rostopic".into(), topic, &[MessageKind::Imu], Severity::Error);
    }
    if let Some(imu) = &rig.gimbal_imu {
        require("imu1.rostopic".into(), &imu.sensor.topic, &[MessageKind::Imu], Severity::Error);
        if let Some(topic) = &imu.sensor.accelerometer_topic {
            require("imu1.accelerometer_rostopic".into(), topic, &[MessageKind::Imu], Severity::Error);
        }
    }
    for camera in &rig.cameras {
        require(format!("{}.rostopic", camera.key), &camera.topic, &MessageKind::IMAGES, Severity::Error);
    }
    if let Some(gimbal) = &rig.gimbal
        && let Some(topic) = &gimbal.topic
    {
        require(topic_field(gimbal).into(), topic, gimbal_kinds(gimbal), Severity::Error);
    }
    if let Some(topic) = rig.vehicle_topic() {
        require("gimbal.source.vehicle".into(), topic, &VEHICLE_KINDS, Severity::Error);
    }
    if let Some(topic) = rig.ground_truth_topic.as_ref().filter(|topic| !log.is_position_topic(topic)) {
        require("ground_truth.rostopic".into(), topic, &POSES, Severity::Note);
    }
    for (camera, first) in rig.cameras.iter().filter_map(|camera| Some((camera, rig.first_of_topic(camera)?))) {
        let title = format!("{} and {} have one topic", first.key, camera.key);
        let remedy =
            format!("name the topic of the images of {} in the rig; until then only {} is used", camera.key, first.key);
        findings.add(Severity::Error, Area::Log, title, format!("'{}'", camera.topic), remedy);
    }
    if named > 0 {
        findings.good(Area::Log, "the log has the topics of the rig", format!("{named} of them"));
    }
}

/// Use of a topic by the rig.
fn role_of(topic: &str, kind: Option<MessageKind>, rig: Option<&Rig>) -> String {
    if rig.is_some_and(|rig| rig.ground_truth_topic.as_deref() == Some(topic)) {
        return "ground truth".into();
    }
    let Some(kind) = kind else { return "ignored".into() };
    if let Some(rig) = rig {
        if topic == rig.imu.topic {
            return "imu0".into();
        }
        if rig.imu.accelerometer_topic.as_deref() == Some(topic) {
            return "imu0 accelerometer".into();
        }
        if rig.gimbal_imu.as_ref().is_some_and(|imu| imu.sensor.topic == topic) {
            return "imu1".into();
        }
        if rig.gimbal_imu.as_ref().is_some_and(|imu| imu.sensor.accelerometer_topic.as_deref() == Some(topic)) {
            return "imu1 accelerometer".into();
        }
        if let Some(camera) = rig.cameras.iter().find(|camera| camera.topic == topic) {
            return camera.key.clone();
        }
        if rig.gimbal.as_ref().is_some_and(|gimbal| gimbal.topic.as_deref() == Some(topic)) {
            return "gimbal".into();
        }
        if rig.vehicle_topic() == Some(topic) {
            return "vehicle".into();
        }
    }
    if kind == MessageKind::CameraInfo { "intrinsics".into() } else { "not in the rig".into() }
}

/// Report of each topic of the log.
pub(super) fn topic_reports(log: &FlightLog, survey: &Survey, rig: Option<&Rig>) -> Vec<TopicReport> {
    let report = |info: &TopicInfo| {
        let times = survey.topics.get(&info.topic).filter(|topic| !topic.times.is_empty());
        // Stamps that were never set contain no time.
        let times = times.filter(|topic| !topic.has_one_stamp());
        let stamps = times.map(|topic| topic.stamp_range());
        let (first_ns, last_ns) = stamps.unwrap_or((info.first_ns, info.last_ns));
        TopicReport {
            topic: info.topic.clone(),
            schema: info.schema.clone(),
            role: role_of(&info.topic, info.kind, rig),
            count: info.count,
            rate_hz: info.rate_hz,
            first_s: seconds_from_ns(first_ns),
            last_s: seconds_from_ns(last_ns),
            latency_s: times.map(|topic| topic.median_latency_s()),
        }
    };
    log.topics().iter().map(report).collect()
}
