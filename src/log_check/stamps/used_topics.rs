//! Topics that the rig names, with the times of their messages.

use crate::geometry::seconds_from_ns;
use crate::log_check::survey::Survey;
use crate::log_check::survey::topic_survey::TopicSurvey;
use crate::sensors::{AttitudeMessage, GimbalRig, Rig};

/// Topic of the log that the rig uses.
pub(super) struct UsedTopic<'a> {
    /// `imu0`, `cam0`, `gimbal`, ….
    pub(crate) role: String,
    pub(crate) topic: &'a TopicSurvey,
    /// Rate in the rig.
    pub(super) nominal_hz: Option<f64>,
    /// True for a camera.
    pub(super) of_images: bool,
    /// Time offset in the rig: `t_imu = t + shift`.
    pub(crate) shift_s: f64,
    /// Key of the time offset in the rig, `None` if it has none.
    pub(super) shift_key: Option<&'static str>,
    /// True if the rig can replace the stamps by log times.
    pub(super) can_use_log_time: bool,
}

impl UsedTopic<'_> {
    /// Stamps of the first and the last message in IMU time, in seconds since the start of the log.
    pub(crate) fn range_s(&self) -> (f64, f64) {
        let (first_ns, last_ns) = self.topic.stamp_range();
        (seconds_from_ns(first_ns) + self.shift_s, seconds_from_ns(last_ns) + self.shift_s)
    }

    /// Path of the time offset in the rig, such as `cam0.timeshift_cam_imu`.
    pub(super) fn shift_field(&self) -> Option<String> {
        self.shift_key.map(|key| format!("{}.{key}", self.role))
    }
}

/// The topics with more than two messages, the IMU first.
pub(crate) fn used_topics<'a>(survey: &'a Survey, rig: Option<&Rig>) -> Vec<UsedTopic<'a>> {
    let mut used: Vec<UsedTopic<'a>> = Vec::new();
    let mut add = |role: &str, topic: Option<&str>, nominal_hz: Option<f64>, shift: Option<(&'static str, f64)>| {
        if let Some(topic) = topic.and_then(|topic| survey.topics.get(topic)).filter(|topic| topic.times.len() > 2) {
            used.push(UsedTopic {
                role: role.to_owned(),
                topic,
                nominal_hz,
                of_images: role.starts_with("cam"),
                shift_s: shift.map_or(0.0, |(_, shift_s)| shift_s),
                shift_key: shift.map(|(key, _)| key),
                can_use_log_time: role != "vehicle",
            });
        }
    };
    add("imu0", survey.imu_topic.as_deref(), rig.map(|rig| rig.imu.rate_hz), None);
    let Some(rig) = rig else { return used };
    if let Some(imu) = &rig.gimbal_imu {
        let shift = ("timeshift_imu1_imu", imu.timeshift_s);
        add("imu1", Some(&imu.sensor.topic), Some(imu.sensor.rate_hz), Some(shift));
    }
    for camera in &rig.cameras {
        let shift = ("timeshift_cam_imu", camera.timeshift_cam_imu_s);
        add(&camera.key, Some(&camera.topic), Some(camera.rate_hz), Some(shift));
    }
    // Transforms of other frames are interleaved with the gimbal's transforms.
    let of_one_kind = |gimbal: &&GimbalRig| {
        let message = gimbal.attitude.as_ref().map(|source| &source.message);
        !matches!(message, Some(AttitudeMessage::Transforms { .. }))
    };
    if let Some(gimbal) = rig.gimbal.as_ref().filter(of_one_kind) {
        let shift = ("timeshift_gimbal_imu", gimbal.timeshift_gimbal_imu_s);
        add("gimbal", gimbal.topic.as_deref(), Some(gimbal.rate_hz), Some(shift));
    }
    add("vehicle", rig.vehicle_topic(), None, None);
    add("ground truth", rig.ground_truth_topic.as_deref(), None, None);
    used
}
