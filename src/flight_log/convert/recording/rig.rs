//! Rig of a video: recorded facts, and usual values for the rest.

use super::super::super::FlightLog;
use super::super::super::rig_template::{CameraChoice, MechanismAxes, RigChoices, RigTemplate, TemplateError};
use super::recorded::GimbalFrame;
use super::topics::{GIMBAL_TOPIC, VEHICLE_TOPIC, VIDEO_TOPIC};
use crate::sensors::BodyAxes;

/// Horizontal field of view of an unknown camera, in degrees: a common one of gimballed cameras.
const USUAL_FIELD_OF_VIEW_DEG: f64 = 84.0;
/// Mechanism of an unknown gimbal: the usual order of three axes.
const USUAL_MECHANISM: &str = "yaw-roll-pitch";
/// `GoPro` cameras by the first letters of their firmware.
const FIRMWARES: [(&str, &str); 8] = [
    ("HD3", "hero3"),
    ("HD4", "hero4"),
    ("HD5", "hero5"),
    ("HD6", "hero6"),
    ("HD7", "hero7"),
    ("HD8", "hero8"),
    ("HD9", "hero9"),
    ("H21", "hero10"),
];

/// Facts about the rig from a video and its recorders.
#[derive(Clone, Debug)]
pub(in super::super) struct VideoFacts {
    pub(super) resolution_px: [usize; 2],
    /// Version of a `GoPro`'s firmware, and the letter of its field of view.
    pub(super) firmware: Option<String>,
    pub(super) field_of_view: Option<String>,
    /// Recorded horizontal field of view in degrees.
    pub(super) horizontal_deg: Option<f64>,
    /// True for an IMU of the camera whose axes are not known.
    pub(super) has_unknown_axes: bool,
    /// Frame of the gimbal's attitude, `None` if it was not recorded.
    pub(super) gimbal_frame: Option<GimbalFrame>,
    /// True if the camera rotates relative to the autopilot, by the IMUs of both.
    pub(super) camera_moves: bool,
    /// True for the IMU of an autopilot.
    pub(super) has_autopilot: bool,
}

impl VideoFacts {
    /// Published camera, else the recorded field of view, else the usual one.
    fn camera(&self) -> CameraChoice {
        let usual = CameraChoice::FieldOfView(self.horizontal_deg.unwrap_or(USUAL_FIELD_OF_VIEW_DEG));
        let Some(firmware) = &self.firmware else { return usual };
        let Some((_, model)) = FIRMWARES.into_iter().find(|(start, _)| firmware.starts_with(start)) else {
            return usual;
        };
        let lens = match self.field_of_view.as_deref() {
            Some("W") => "wide",
            Some("M") => "medium",
            Some("N") => "narrow",
            Some("L") => "linear",
            _ => return usual,
        };
        format!("gopro-{model}-{lens}").parse().unwrap_or(usual)
    }

    pub(in super::super) fn template(&self, name: &str, log: &FlightLog) -> Result<RigTemplate, TemplateError> {
        let prefix = if self.has_autopilot { "/imu" } else { "/camera/imu" };
        let both = |suffix: &str| [format!("{prefix}{suffix}"), format!("{prefix}0{suffix}")];
        let present = |names: [String; 2]| names.into_iter().find(|name| log.topic(name).is_some());
        let imu = present(both("")).or_else(|| present(both("/gyroscope")));
        let frame = self.gimbal_frame.filter(|_| log.topic(VEHICLE_TOPIC).is_some());
        let attitude = frame.map(|frame| {
            let frame = match frame {
                GimbalFrame::Vehicle => "vehicle",
                GimbalFrame::Earth => "earth",
            };
            let entries = [
                ("type", "quaternion"),
                ("frame", frame),
                ("axes", "frd"),
                ("imu_axes", "frd"),
                ("vehicle", VEHICLE_TOPIC),
            ];
            let entries = entries.map(|(key, value)| (key.to_owned(), value.to_owned()));
            (GIMBAL_TOPIC.to_owned(), entries.to_vec())
        });
        let (frd, flu) = (BodyAxes::Frd, BodyAxes::Flu);
        let on_gimbal = self.gimbal_frame.is_some() || self.camera_moves;
        let mechanism = if on_gimbal { USUAL_MECHANISM } else { "rigid" };
        let choices = RigChoices {
            name: name.to_owned(),
            camera: self.camera(),
            // Size of the decoded images, since the container can declare another display size.
            resolution_px: None,
            mechanism: mechanism.parse::<MechanismAxes>()?,
            described: None,
            positive: Some(frd),
            imu_axes: if self.has_autopilot { Some(frd) } else { (!self.has_unknown_axes).then_some(flu) },
            position_m: None,
            imu_topic: imu,
            // The video's own IMU moves with the camera on the gimbal; its axes are the camera's axes, as converted.
            gimbal_imu_topic: None,
            gimbal_imu_axes: (!self.has_unknown_axes).then_some(flu),
            image_topic: Some(VIDEO_TOPIC.to_owned()),
            joint_topic: None,
            joint_names: Vec::new(),
            attitude,
            noise: None,
        };
        let template = RigTemplate::new(&choices, Some(log));
        let of_container =
            || RigTemplate::new(&RigChoices { resolution_px: Some(self.resolution_px), ..choices.clone() }, Some(log));
        template.or_else(|error| match error {
            TemplateError::NoSize { .. } => of_container(),
            other => Err(other),
        })
    }
}
