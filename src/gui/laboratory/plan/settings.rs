//! Duration, limits and scene of a planned motion, with the defaults of `dcvins plan`.

use egui::{DragValue, Ui};

use crate::gui::help::terms::window;
use crate::observability::laboratory::{
    EnteredLimits, MotionLimits, MotionStart, PLAN_DURATION_S, PLAN_SECONDS, SCENE_M, Situation, scene_distances_m,
};

/// Settings of a planned motion, in the units of `dcvins plan`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PlanSettings {
    pub(super) start: MotionStart,
    pub(super) duration_s: f64,
    limits: EnteredLimits,
    /// Nearest and farthest distance of the assumed scene, in metres.
    scene_m: [f64; 2],
    /// True if the landmarks of the log are the scene.
    pub(super) scene_of_log: bool,
}

impl Default for PlanSettings {
    fn default() -> Self {
        Self {
            start: MotionStart::default(),
            duration_s: PLAN_SECONDS,
            limits: EnteredLimits::SLOW,
            scene_m: SCENE_M,
            scene_of_log: false,
        }
    }
}

impl PlanSettings {
    pub(super) fn limits(&self, situation: &Situation) -> MotionLimits {
        self.limits.around(situation)
    }

    /// Distances of the assumed scene, in metres.
    pub(super) fn distances_m(&self) -> Vec<f64> {
        scene_distances_m(self.scene_m)
    }

    pub(super) fn ui(&mut self, ui: &mut Ui) {
        ui.horizontal_wrapped(|ui| {
            let [shortest_s, longest_s] = PLAN_DURATION_S;
            let (limits, hint) = (&mut self.limits, window::PLAN_LIMITS.meaning);
            value_ui(ui, "Duration", &mut self.duration_s, shortest_s..=longest_s, " s", hint);
            value_ui(ui, "Joint range ±", &mut limits.joint_range_deg, 1.0..=180.0, "°", hint);
            value_ui(ui, "Joint rate", &mut limits.joint_rate_deg_per_s, 1.0..=10_000.0, "°/s", hint);
            let acceleration = &mut limits.joint_acceleration_deg_per_s2;
            value_ui(ui, "Joint acceleration", acceleration, 1.0..=10_000.0, "°/s²", hint);
            value_ui(ui, "Speed", &mut limits.speed_m_per_s, 0.01..=100.0, " m/s", hint);
            value_ui(ui, "Acceleration", &mut limits.acceleration_m_per_s2, 0.01..=100.0, " m/s²", hint);
            for (name, reach_m) in ["Forward ±", "Left ±", "Up ±"].into_iter().zip(&mut limits.reach_m) {
                value_ui(ui, name, reach_m, 0.01..=100.0, " m", hint);
            }
            value_ui(ui, "Heading ±", &mut limits.heading_deg, 1.0..=180.0, "°", hint);
            value_ui(ui, "Heading rate", &mut limits.heading_rate_deg_per_s, 1.0..=10_000.0, "°/s", hint);
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
