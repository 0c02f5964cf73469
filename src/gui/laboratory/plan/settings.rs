//! Duration, limits and scene of a planned motion; the defaults are those of `dcvins plan`.

use egui::{DragValue, Ui};

use crate::gui::help::terms::window;
use crate::observability::laboratory::{MotionLimits, MotionStart, PLAN_DURATION_S, Situation, scene_distances_m};

/// Settings of a planned motion, in the units of `dcvins plan`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PlanSettings {
    pub(super) start: MotionStart,
    pub(super) duration_s: f64,
    joint_range_deg: f64,
    joint_rate_deg_per_s: f64,
    joint_acceleration_deg_per_s2: f64,
    speed_m_per_s: f64,
    acceleration_m_per_s2: f64,
    reach_m: [f64; 3],
    heading_deg: f64,
    heading_rate_deg_per_s: f64,
    /// Nearest and farthest distance of the assumed scene, in metres.
    scene_m: [f64; 2],
    /// True if the landmarks of the log are the scene.
    pub(super) scene_of_log: bool,
}

impl Default for PlanSettings {
    fn default() -> Self {
        Self {
            start: MotionStart::default(),
            duration_s: 20.0,
            joint_range_deg: 60.0,
            joint_rate_deg_per_s: 60.0,
            joint_acceleration_deg_per_s2: 180.0,
            speed_m_per_s: 1.5,
            acceleration_m_per_s2: 3.0,
            reach_m: [1.5, 1.5, 1.0],
            heading_deg: 60.0,
            heading_rate_deg_per_s: 45.0,
            scene_m: [4.0, 12.0],
            scene_of_log: false,
        }
    }
}

impl PlanSettings {
    pub(super) fn limits(&self, situation: &Situation) -> MotionLimits {
        MotionLimits {
            joint_rate_rad_per_s: self.joint_rate_deg_per_s.to_radians(),
            joint_acceleration_rad_per_s2: self.joint_acceleration_deg_per_s2.to_radians(),
            speed_m_per_s: self.speed_m_per_s,
            acceleration_m_per_s2: self.acceleration_m_per_s2,
            reach_m: self.reach_m.into(),
            heading_rad: self.heading_deg.to_radians(),
            heading_rate_rad_per_s: self.heading_rate_deg_per_s.to_radians(),
            ..MotionLimits::slow_around(situation, self.joint_range_deg.to_radians())
        }
    }

    /// Distances of the assumed scene, in metres.
    pub(super) fn distances_m(&self) -> Vec<f64> {
        scene_distances_m(self.scene_m)
    }

    pub(super) fn ui(&mut self, ui: &mut Ui) {
        ui.horizontal_wrapped(|ui| {
            let [shortest_s, longest_s] = PLAN_DURATION_S;
            let hint = window::PLAN_LIMITS.meaning;
            value_ui(ui, "Duration", &mut self.duration_s, shortest_s..=longest_s, " s", hint);
            value_ui(ui, "Joint range ±", &mut self.joint_range_deg, 1.0..=180.0, "°", hint);
            value_ui(ui, "Joint rate", &mut self.joint_rate_deg_per_s, 1.0..=10_000.0, "°/s", hint);
            let acceleration = &mut self.joint_acceleration_deg_per_s2;
            value_ui(ui, "Joint acceleration", acceleration, 1.0..=10_000.0, "°/s²", hint);
            value_ui(ui, "Speed", &mut self.speed_m_per_s, 0.01..=100.0, " m/s", hint);
            value_ui(ui, "Acceleration", &mut self.acceleration_m_per_s2, 0.01..=100.0, " m/s²", hint);
            for (name, reach_m) in ["Forward ±", "Left ±", "Up ±"].into_iter().zip(&mut self.reach_m) {
                value_ui(ui, name, reach_m, 0.01..=100.0, " m", hint);
            }
            value_ui(ui, "Heading ±", &mut self.heading_deg, 1.0..=180.0, "°", hint);
            value_ui(ui, "Heading rate", &mut self.heading_rate_deg_per_s, 1.0..=10_000.0, "°/s", hint);
        });
        ui.horizontal_wrapped(|ui| {
            let hint = window::PLAN_SCENE.meaning;
            ui.checkbox(&mut self.scene_of_log, "Scene of this log").on_hover_text(hint);
            let [near_m, far_m] = &mut self.scene_m;
            ui.add_enabled_ui(!self.scene_of_log, |ui| {
                value_ui(ui, "Scene from", near_m, 0.2..=1000.0, " m", hint);
                value_ui(ui, "to", far_m, *near_m..=1000.0, " m", hint);
            });
        });
    }
}

fn value_ui(
    ui: &mut Ui,
    name: &str,
    value: &mut f64,
    range: std::ops::RangeInclusive<f64>,
    unit: &str,
    hint: &'static str,
) {
    let label = ui.label(name);
    let field = DragValue::new(value).range(range).suffix(unit).speed(0.1).max_decimals(2);
    ui.add(field).labelled_by(label.id).on_hover_text(hint);
}
