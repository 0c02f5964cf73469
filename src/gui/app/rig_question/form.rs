//! Form of a new rig: mechanism, camera, position and topics.

use egui::{DragValue, Grid, RichText, Ui, vec2};

use super::topic_fields::{AngleField, TopicFields};
use crate::flight_log::rig_template::{CameraChoice, MechanismAxes, PublishedCamera, RigChoices, suggested_mechanism};
use crate::flight_log::{FlightLog, MessageKind};
use crate::gui::theme::Theme;
use crate::gui::widgets::choice_ui;
use crate::sensors::BodyAxes;
use crate::text::Named as _;

/// Mechanisms of the form; others are written into the text of the rig.
const MECHANISMS: [&str; 8] =
    ["rigid", "pitch", "yaw-pitch", "roll-pitch", "yaw-roll-pitch", "yaw-pitch-roll", "roll-pitch-yaw", "pitch-yaw"];
/// Field of view at first, in degrees: a usual one of gimballed cameras.
const USUAL_FIELD_OF_VIEW_DEG: f64 = 84.0;
/// Largest coordinate of a position, in metres.
const FARTHEST_M: f64 = 20.0;
const COMBO_WIDTH: f32 = 250.0;

/// Way in which the camera is given.
#[derive(Clone, Copy, Debug, PartialEq)]
enum CameraField {
    Info,
    FieldOfView,
    Published(PublishedCamera),
}

pub(super) struct RigForm {
    name: String,
    mechanism: MechanismAxes,
    camera: CameraField,
    field_of_view_deg: f64,
    /// Position of the gimbal: forward, left and up of the IMU, in metres; not used before it is measured.
    position_m: [f64; 3],
    position_is_measured: bool,
    positive: BodyAxes,
    imu_axes: Option<BodyAxes>,
    topics: TopicFields,
    has_info: bool,
}

impl RigForm {
    /// Form with what the log suggests.
    pub(super) fn new(log: &FlightLog, name: String) -> Self {
        let topics = TopicFields::new(log);
        let usual = if topics.has_attitudes() { "yaw-roll-pitch" } else { "rigid" };
        let mechanism = suggested_mechanism(log).or_else(|| usual.parse().ok());
        let has_info = !log.topics_of(&[MessageKind::CameraInfo]).is_empty();
        Self {
            name,
            mechanism: mechanism.unwrap_or(MechanismAxes(Vec::new())),
            camera: if has_info { CameraField::Info } else { CameraField::FieldOfView },
            field_of_view_deg: USUAL_FIELD_OF_VIEW_DEG,
            position_m: [0.0; 3],
            position_is_measured: false,
            positive: BodyAxes::Frd,
            imu_axes: None,
            topics,
            has_info,
        }
    }

    pub(super) fn choices(&self) -> RigChoices {
        let is_gimbal = !self.mechanism.0.is_empty();
        let angles = &self.topics.angles;
        RigChoices {
            name: self.name.clone(),
            camera: match self.camera {
                CameraField::Info => CameraChoice::CameraInfo(None),
                CameraField::FieldOfView => CameraChoice::FieldOfView(self.field_of_view_deg),
                CameraField::Published(camera) => CameraChoice::Published(camera),
            },
            resolution_px: None,
            mechanism: self.mechanism.clone(),
            described: None,
            positive: Some(self.positive).filter(|_| is_gimbal && *angles != AngleField::None),
            imu_axes: self.imu_axes,
            position_m: self.position_is_measured.then(|| self.position_m.into()),
            imu_topic: self.topics.imu_choice(),
            gimbal_imu_topic: None,
            gimbal_imu_axes: None,
            image_topic: self.topics.image.clone(),
            joint_topic: if let AngleField::Joints(topic) = angles { Some(topic.clone()) } else { None },
            joint_names: Vec::new(),
            attitude: self.topics.attitude().filter(|_| is_gimbal),
            noise: None,
        }
    }

    pub(super) fn ui(&mut self, ui: &mut Ui, theme: &Theme) {
        Grid::new("rig form").num_columns(2).spacing(vec2(12.0, 6.0)).show(ui, |ui| {
            self.mechanism_ui(ui);
            self.camera_ui(ui);
            let name = ui.label("Position of the gimbal");
            ui.horizontal(|ui| {
                let measured = ui.checkbox(&mut self.position_is_measured, "measured");
                measured.on_hover_text("Forward, left and up of the IMU; a ruler is accurate enough");
                for (value, axis) in self.position_m.iter_mut().zip(["forward", "left", "up"]) {
                    let drag = DragValue::new(value).speed(0.005).range(-FARTHEST_M..=FARTHEST_M).suffix(" m");
                    let drag = ui.add_enabled(self.position_is_measured, drag.max_decimals(3));
                    drag.labelled_by(name.id).on_hover_text(axis);
                }
            });
            ui.end_row();
            if !self.mechanism.0.is_empty() {
                let text = |axes: &BodyAxes| match axes {
                    BodyAxes::Frd => "right, up (frd: autopilots, DJI)".to_owned(),
                    BodyAxes::Flu => "left, down (flu: ROS)".to_owned(),
                };
                choice_ui(ui, "Positive angles", COMBO_WIDTH, &mut self.positive, BodyAxes::all(), text);
                ui.end_row();
            }
            let text = |axes: &Option<BodyAxes>| match axes {
                None => "from gravity in the log".to_owned(),
                Some(BodyAxes::Frd) => "forward, right, down (frd)".to_owned(),
                Some(BodyAxes::Flu) => "forward, left, up (flu)".to_owned(),
            };
            let axes = std::iter::once(None).chain(BodyAxes::all().map(Some));
            choice_ui(ui, "Axes of the IMU", COMBO_WIDTH, &mut self.imu_axes, axes, text);
            ui.end_row();
            self.topics.ui(ui, !self.mechanism.0.is_empty(), COMBO_WIDTH);
        });
        let hint = "Values that the form does not have are changed in the text";
        ui.label(RichText::new(hint).small().color(theme.text_weak));
    }

    fn mechanism_ui(&mut self, ui: &mut Ui) {
        let known = MECHANISMS.into_iter().filter_map(|text| text.parse::<MechanismAxes>().ok());
        choice_ui(ui, "Mechanism", COMBO_WIDTH, &mut self.mechanism, known, ToString::to_string)
            .on_hover_text("Axes from the vehicle to the camera");
        ui.end_row();
    }

    fn camera_ui(&mut self, ui: &mut Ui) {
        let text = |camera: &CameraField| match camera {
            CameraField::Info => "CameraInfo of the log".to_owned(),
            CameraField::FieldOfView => "horizontal field of view".to_owned(),
            CameraField::Published(camera) => camera.name().to_owned(),
        };
        let info = self.has_info.then_some(CameraField::Info);
        let published = PublishedCamera::ALL.into_iter().map(CameraField::Published);
        let cameras = info.into_iter().chain([CameraField::FieldOfView]).chain(published);
        choice_ui(ui, "Camera", COMBO_WIDTH, &mut self.camera, cameras, text);
        ui.end_row();
        if self.camera == CameraField::FieldOfView {
            let name = ui.label("Field of view");
            let drag = DragValue::new(&mut self.field_of_view_deg).range(1.0..=220.0).speed(0.25).suffix("°");
            ui.add(drag.max_decimals(1)).labelled_by(name.id).on_hover_text("Degrees across the image");
            ui.end_row();
        }
    }
}
