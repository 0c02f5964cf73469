//! Topics of a new rig: IMU, images, and the angles of the gimbal.

use egui::{ComboBox, Ui};

use crate::flight_log::joints::attitude::VEHICLE_KINDS;
use crate::flight_log::{FlightLog, MessageKind, TopicInfo};
use crate::gui::widgets::choice_ui;
use crate::sensors::{AngleUnit, AttitudeFrame, BodyAxes};
use crate::text::Named as _;

/// Topics with an attitude that a gimbal may have.
const ATTITUDES: [MessageKind; 5] = [
    MessageKind::QuaternionStamped,
    MessageKind::PoseStamped,
    MessageKind::Vector3Stamped,
    MessageKind::MavrosGimbalAttitude,
    MessageKind::Px4GimbalAttitude,
];
/// Order of Euler angles at first: the fields z, x, y of DJI are yaw, roll and pitch.
const USUAL_ORDER: &str = "yaw=z roll=x pitch=y";

/// Source of the joint angles.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum AngleField {
    None,
    Joints(String),
    Attitude(String, MessageKind),
}

impl AngleField {
    fn text(&self) -> String {
        match self {
            Self::None => "not measured".to_owned(),
            Self::Joints(topic) => format!("{topic} (joint angles)"),
            Self::Attitude(topic, _) => format!("{topic} (attitude)"),
        }
    }
}

pub(super) struct TopicFields {
    imus: Vec<String>,
    images: Vec<String>,
    sources: Vec<AngleField>,
    vehicles: Vec<String>,
    imu: Option<String>,
    pub(super) image: Option<String>,
    pub(super) angles: AngleField,
    frame: AttitudeFrame,
    axes: BodyAxes,
    vehicle: Option<String>,
    order: String,
    unit: AngleUnit,
}

/// True for the part of the name of a topic that belongs to the gimbal.
fn of_gimbal(topic: &str) -> bool {
    ["gimbal", "mount"].iter().any(|word| topic.to_ascii_lowercase().contains(word))
}

/// True for the topic of an accelerometer whose gyroscope has a topic with the same start.
fn has_own_gyroscope(topic: &str, all: &[String]) -> bool {
    let gyroscope = topic.strip_suffix("/accelerometer").map(|start| format!("{start}/gyroscope"));
    gyroscope.is_some_and(|gyroscope| all.contains(&gyroscope))
}

impl TopicFields {
    pub(super) fn new(log: &FlightLog) -> Self {
        let named = |info: &TopicInfo| info.topic.clone();
        let of_kind = |kind: MessageKind| log.topics().iter().filter(move |info| info.kind == Some(kind));
        let joints = of_kind(MessageKind::JointState).map(|info| AngleField::Joints(named(info)));
        let attitudes = ATTITUDES.into_iter().flat_map(|kind| {
            of_kind(kind).map(move |info| AngleField::Attitude(info.topic.clone(), kind)).collect::<Vec<_>>()
        });
        let sources: Vec<AngleField> = joints.chain(attitudes).chain([AngleField::None]).collect();
        // An attitude is only taken at first if its name says that it is the gimbal's.
        let angles = sources.iter().find(|source| match source {
            AngleField::Joints(_) | AngleField::None => true,
            AngleField::Attitude(topic, _) => of_gimbal(topic),
        });
        let (all_imus, images) = (log.topics_of(&[MessageKind::Imu]), log.topics_of(&MessageKind::IMAGES));
        let halves = are_halves(&all_imus);
        let imus: Vec<String> =
            all_imus.iter().filter(|topic| halves || !has_own_gyroscope(topic, &all_imus)).cloned().collect();
        // The IMU of a camera may move on a gimbal.
        let of_vehicle = imus.iter().find(|topic| !topic.starts_with("/camera/")).or_else(|| imus.first());
        let vehicles: Vec<String> = VEHICLE_KINDS.iter().flat_map(|kind| log.topics_of(&[*kind])).collect();
        let first_of_gimbal = images.iter().find(|topic| of_gimbal(topic)).or_else(|| images.first());
        Self {
            imu: of_vehicle.cloned().filter(|_| imus.len() > 1 && !halves),
            image: first_of_gimbal.cloned(),
            angles: angles.cloned().unwrap_or(AngleField::None),
            frame: AttitudeFrame::Body,
            axes: BodyAxes::Frd,
            vehicle: vehicles.iter().find(|topic| !of_gimbal(topic)).cloned(),
            order: USUAL_ORDER.to_owned(),
            unit: AngleUnit::Degrees,
            imus,
            images,
            sources,
            vehicles,
        }
    }

    pub(super) fn has_attitudes(&self) -> bool {
        matches!(self.angles, AngleField::Attitude(..))
    }

    /// Topic of the IMU; `None` leaves an only one, or two halves, to the log.
    pub(super) fn imu_choice(&self) -> Option<String> {
        self.imu.clone()
    }

    /// Attitude topic with its entries of `gimbal.source`; `None` if the angles are measured in another way.
    pub(super) fn attitude(&self) -> Option<(String, Vec<(String, String)>)> {
        let AngleField::Attitude(topic, kind) = &self.angles else { return None };
        let mut entries: Vec<(&str, String)> = Vec::new();
        let message = match kind {
            MessageKind::MavrosGimbalAttitude => "mavros",
            MessageKind::Px4GimbalAttitude => "px4",
            MessageKind::Vector3Stamped => "euler",
            MessageKind::PoseStamped => "pose",
            _ => "quaternion",
        };
        entries.push(("type", message.to_owned()));
        if message == "euler" {
            entries.push(("order", self.order.clone()));
            entries.push(("unit", self.unit.name().to_owned()));
        }
        if !self.by_flags() {
            entries.push(("frame", self.frame.name().to_owned()));
            entries.push(("axes", self.axes.name().to_owned()));
        }
        if self.needs_vehicle() {
            entries.extend(self.vehicle.clone().map(|vehicle| ("vehicle", vehicle)));
        }
        Some((topic.clone(), entries.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()))
    }

    /// True for messages that say by flags what they are relative to.
    fn by_flags(&self) -> bool {
        let flagged = [MessageKind::MavrosGimbalAttitude, MessageKind::Px4GimbalAttitude];
        matches!(&self.angles, AngleField::Attitude(_, kind) if flagged.contains(kind))
    }

    fn needs_vehicle(&self) -> bool {
        self.by_flags() || self.has_attitudes() && self.frame != AttitudeFrame::Body
    }

    /// Draws the rows of a grid with two columns; the rows of the angles only for a gimbal.
    pub(super) fn ui(&mut self, ui: &mut Ui, gimbal: bool, width: f32) {
        if self.images.len() > 1 {
            topic_ui(ui, "Images", &mut self.image, &self.images, width);
        }
        if self.imus.len() > 1 {
            topic_ui(ui, "IMU", &mut self.imu, &self.imus, width);
        }
        if !gimbal {
            return;
        }
        choice_ui(ui, "Gimbal angles", width, &mut self.angles, self.sources.iter().cloned(), AngleField::text);
        ui.end_row();
        if !self.has_attitudes() {
            return;
        }
        if matches!(&self.angles, AngleField::Attitude(_, MessageKind::Vector3Stamped)) {
            let name = ui.label("Order and unit of the angles");
            ui.horizontal(|ui| {
                ui.add(egui::TextEdit::singleline(&mut self.order).desired_width(150.0)).labelled_by(name.id);
                for unit in AngleUnit::all() {
                    ui.selectable_value(&mut self.unit, unit, unit.name());
                }
            });
            ui.end_row();
        }
        if !self.by_flags() {
            let name = ui.label("Attitude relative to");
            ui.horizontal(|ui| {
                let combo = ComboBox::from_id_salt("frame").selected_text(self.frame.name());
                let shown = combo.show_ui(ui, |ui| {
                    for frame in AttitudeFrame::all().filter(|frame| *frame != AttitudeFrame::Flags) {
                        ui.selectable_value(&mut self.frame, frame, frame.name());
                    }
                });
                shown.response.labelled_by(name.id);
                for axes in BodyAxes::all() {
                    ui.selectable_value(&mut self.axes, axes, axes.name());
                }
            });
            ui.end_row();
        }
        if self.needs_vehicle() {
            topic_ui(ui, "Attitude of the vehicle", &mut self.vehicle, &self.vehicles, width);
        }
    }
}

/// True for the separate topics of gyroscope and accelerometer, which are found together.
fn are_halves(imus: &[String]) -> bool {
    let has = |word: &str| imus.iter().any(|topic| topic.to_ascii_lowercase().contains(word));
    imus.len() == 2 && has("gyro") && has("accel")
}

fn topic_ui(ui: &mut Ui, label: &str, chosen: &mut Option<String>, topics: &[String], width: f32) {
    let text = |topic: &Option<String>| topic.clone().unwrap_or_else(|| "found in the log".to_owned());
    choice_ui(ui, label, width, chosen, topics.iter().cloned().map(Some), text);
    ui.end_row();
}
