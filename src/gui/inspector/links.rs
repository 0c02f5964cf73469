//! Links by the step's Jacobian: residuals, their features, and the parameters on which they depend.

use std::sync::Arc;

use egui::{RichText, Ui};

use super::rows::ROW_HEIGHT;
use crate::estimator::{JacobianFactor, StepJacobian};
use crate::frontend::FeatureId;
use crate::gimbal::ParameterId;
use crate::gui::PanelContext;
use crate::gui::help::terms::block;
use crate::gui::jacobian::cameras;
use crate::gui::table::{grid_ui, named};
use crate::gui::units::{fixed, significant};
use crate::session::{RunRecord, StepRecord};

/// Number of links shown for a feature or parameter.
const SHOWN: usize = 6;

/// Jacobian of the step that was requested last.
#[derive(Debug, Default)]
pub(super) struct Links {
    of: Option<(Arc<StepRecord>, Option<StepJacobian>)>,
}

impl Links {
    fn jacobian(&mut self, ctx: &PanelContext<'_>, run: &RunRecord, step: &Arc<StepRecord>) -> Option<&StepJacobian> {
        if !self.of.as_ref().is_some_and(|(known, _)| Arc::ptr_eq(known, step)) {
            let cameras = cameras(&ctx.recording.rig, run, step);
            self.of = Some((Arc::clone(step), step.report.jacobian(&cameras)));
        }
        self.of.as_ref()?.1.as_ref()
    }

    /// Lists the features whose residuals depend most on a parameter; a click selects one.
    pub(super) fn of_parameter_ui(
        &mut self,
        ui: &mut Ui,
        ctx: &mut PanelContext<'_>,
        run: &RunRecord,
        step: &Arc<StepRecord>,
        parameter: ParameterId,
    ) {
        let Some(jacobian) = self.jacobian(ctx, run, step) else { return };
        let Some(column) = jacobian.columns.iter().position(|block| block.id.parameter() == Some(parameter)) else {
            return;
        };
        let mut links: Vec<(FeatureId, f32)> = Vec::new();
        for row in &jacobian.rows {
            let norm = row.norms.iter().find(|(known, _)| usize::from(*known) == column);
            if let (JacobianFactor::Feature(id), Some((_, norm))) = (row.factor, norm) {
                links.push((id, *norm));
            }
        }
        links.sort_by(|a, b| b.1.total_cmp(&a.1));
        let selected = ctx.selection.feature;
        let names =
            links.iter().take(SHOWN).map(|(id, norm)| (format!("feature {}", id.0), *norm, selected == Some(*id)));
        if let Some(index) = links_ui(ui, ctx, "features with the largest derivatives", names) {
            let id = links[index].0;
            ctx.selection.feature = (selected != Some(id)).then_some(id);
        }
    }

    /// Lists the parameters on which a feature's residuals depend most; a click selects one.
    pub(super) fn of_feature_ui(
        &mut self,
        ui: &mut Ui,
        ctx: &mut PanelContext<'_>,
        run: &RunRecord,
        step: &Arc<StepRecord>,
        id: FeatureId,
    ) {
        let Some(jacobian) = self.jacobian(ctx, run, step) else { return };
        let Some(row) = jacobian.rows.iter().find(|row| row.factor == JacobianFactor::Feature(id)) else { return };
        let mut links: Vec<(ParameterId, f32)> = Vec::new();
        for (column, norm) in &row.norms {
            if let Some(parameter) = jacobian.columns[usize::from(*column)].id.parameter() {
                links.push((parameter, *norm));
            }
        }
        links.sort_by(|a, b| b.1.total_cmp(&a.1));
        let (selected, names) = (ctx.selection.parameter, ctx.names());
        let shown = links.iter().take(SHOWN);
        let shown = shown.map(|(parameter, norm)| (names.name(*parameter), *norm, selected == Some(*parameter)));
        if let Some(index) = links_ui(ui, ctx, "parameters with the largest derivatives", shown) {
            let parameter = links[index].0;
            ctx.selection.parameter = (selected != Some(parameter)).then_some(parameter);
        }
    }
}

/// Draws links with the norms of their blocks; returns the clicked one.
fn links_ui(
    ui: &mut Ui,
    ctx: &PanelContext<'_>,
    title: &str,
    links: impl Iterator<Item = (String, f32, bool)>,
) -> Option<usize> {
    let mut clicked = None;
    ui.horizontal_wrapped(|ui| {
        ui.label(RichText::new(title).color(ctx.theme.text_weak));
        for (index, (name, norm, selected)) in links.enumerate() {
            let text = RichText::new(format!("{name} ({})", significant(f64::from(norm)))).small();
            if ctx.presentation.is_figure() {
                ui.label(text);
                continue;
            }
            let link = ui.selectable_label(selected, text);
            if link
                .on_hover_text("Norm of the Jacobian block in σ per 10° or 3 cm; click: select in all panels")
                .clicked()
            {
                clicked = Some(index);
            }
        }
    });
    clicked
}

/// Draws the residuals of a feature with their derivatives with respect to a parameter.
pub(super) fn block_ui(
    ui: &mut Ui,
    ctx: &PanelContext<'_>,
    run: &RunRecord,
    step: &StepRecord,
    id: FeatureId,
    parameter: ParameterId,
) {
    let report = &step.report;
    let cameras = cameras(&ctx.recording.rig, run, step);
    let column = report.calibration.index_of(parameter);
    let feature = report.features.iter().find(|feature| feature.id == id);
    let (Some(column), Some(feature), Some(rows)) = (column, feature, report.feature_rows(&cameras, id)) else {
        ui.label(RichText::new("No such block in this step").color(ctx.theme.text_weak));
        return;
    };
    let shown = parameter.shown();
    let unit = shown.unit.trim();
    let known = [block::FRAME, block::RESIDUAL_U, block::RESIDUAL_V, block::CHI2];
    let slopes = [block::SLOPE_U, block::SLOPE_V].map(|term| (format!("{}, px/{unit}", term.name), term));
    let heads: Vec<_> = named(&known).into_iter().chain(slopes).collect();
    let lines = rows.frames.iter().enumerate().filter_map(|(place, frame)| {
        let seen = feature.observations.iter().find(|seen| seen.frame_index == frame.0)?;
        let residual = seen.residual_after_px.map_or([f64::NAN; 2], |residual| [residual.x, residual.y]);
        // Conversion from standard deviations to pixels.
        let pixels = report.pixel_sigma_px(id) / seen.robust_weight.sqrt() / shown.factor;
        let slopes = [0, 1].map(|axis| significant(rows.rows[(2 * place + axis, column)] * pixels));
        let mut cells = vec![frame.to_string()];
        cells.extend(residual.map(|pixel| fixed(pixel, 2)));
        cells.push(significant(seen.chi2));
        cells.extend(slopes);
        Some(cells)
    });
    let caption = "Residuals Δu, Δv after the solve and derivatives of the projection";
    ui.label(RichText::new(caption).small().color(ctx.theme.text_weak));
    grid_ui(ui, ctx.theme, ("block", ROW_HEIGHT), &heads, lines);
}
