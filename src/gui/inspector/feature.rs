//! One feature in the step at the cursor.

use egui::{RichText, Ui};

use super::rows::{ROW_HEIGHT, rows_ui};
use crate::frontend::FeatureId;
use crate::gui::PanelContext;
use crate::gui::help::terms::{feature, observations};
use crate::gui::table::{grid_ui, named};
use crate::gui::units::{fixed, significant};
use crate::session::StepRecord;

pub(super) fn ui(ui: &mut Ui, ctx: &PanelContext<'_>, step: &StepRecord, id: FeatureId) {
    let theme = ctx.theme;
    let track = step.track(id);
    let report = step.report.features.iter().find(|known| known.id == id);
    if track.is_none() && report.is_none() {
        ui.label(RichText::new("No observation in this frame").color(theme.text_weak));
        return;
    }
    let mut rows = Vec::new();
    if let Some(track) = track {
        rows.push((feature::POSITION, vec![format!("{}, {}", fixed(track.uv_px.x, 2), fixed(track.uv_px.y, 2))]));
        rows.push((feature::AGE, vec![track.age.to_string()]));
        if let Some(previous) = track.previous_uv_px {
            let flow = track.uv_px - previous;
            rows.push((feature::FLOW, vec![fixed(flow.norm(), 2)]));
        }
    }
    if let Some(report) = report {
        rows.push((feature::ANCHOR, vec![report.anchor_frame_index.to_string()]));
        let depth = 1.0 / report.inverse_depth_per_m;
        rows.push((feature::DEPTH, vec![fixed(depth, 2)]));
        let state = if report.rejected { "rejected as an outlier" } else { "used in the solve" };
        rows.push((feature::STATE, vec![state.to_owned()]));
    } else {
        rows.push((feature::STATE, vec!["not used in the solve".to_owned()]));
    }
    if let Some(landmark) = step.report.landmarks.iter().find(|landmark| landmark.id == id) {
        let position = landmark.position_m;
        let values = [position.x, position.y, position.z].map(|value| fixed(value, 3));
        rows.push((feature::LANDMARK, vec![values.join(", ")]));
    }
    rows_ui(ui, theme, "feature", rows);
    let Some(report) = report else { return };
    let length = |residual: Option<nalgebra::Vector2<f64>>| {
        residual.map_or_else(|| "–".to_owned(), |residual| fixed(residual.norm(), 2))
    };
    let caption = "Observations: residual before and after the solve, χ² and robust weight";
    ui.label(RichText::new(caption).small().color(theme.text_weak));
    let columns = [
        observations::FRAME,
        observations::U,
        observations::V,
        observations::BEFORE,
        observations::AFTER,
        observations::CHI2,
        observations::WEIGHT,
    ];
    let lines = report.observations.iter().map(|one| {
        vec![
            one.frame_index.to_string(),
            fixed(one.measured_px.x, 1),
            fixed(one.measured_px.y, 1),
            length(one.residual_before_px),
            length(one.residual_after_px),
            significant(one.chi2),
            fixed(one.robust_weight, 2),
        ]
    });
    grid_ui(ui, theme, ("observations", ROW_HEIGHT), &named(&columns), lines);
}
