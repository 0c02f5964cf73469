//! Values of a block and of its residuals.

use egui::{Label, RichText, ScrollArea, Ui, vec2};

use super::factors::{self, NUMBERS};
use super::model::{JacobianModel, cameras, joint_columns, name_of, per, unit_text};
use crate::estimator::{ColumnBlock, ColumnId, FeatureRows, FrameId, JacobianFactor};
use crate::frontend::FeatureId;
use crate::geometry::{Dimension, principal_angle};
use crate::gui::PanelContext;
use crate::gui::help::terms::{Term, jacobian as terms};
use crate::gui::table::{grid_ui, named};
use crate::gui::units::{Shown, fixed, significant};
use crate::session::{RunRecord, StepRecord};

/// A block in one line: name, size and norm.
pub(super) fn headline(model: &JacobianModel, row: usize, column: usize) -> String {
    let (of_row, block) = (&model.jacobian.rows[row], &model.jacobian.columns[column]);
    let norm = model.norm(row, column);
    let size = format!("{} × {}", of_row.height, block.len);
    let name = format!("{} × {}", name_of(&of_row.factor), model.columns.strips[column].name);
    if norm == 0.0 {
        return format!("{name}: zero ({size})");
    }
    format!("{name}: {} {} ({size})", significant(f64::from(norm)), unit_text(block, model.joint_count))
}

/// Draws the values of the selected row, column or block. Without a row, the window lists the columns of all calibration
/// parameters below each other.
pub(super) fn ui(
    ui: &mut Ui,
    ctx: &PanelContext<'_>,
    run: &RunRecord,
    step: &StepRecord,
    model: &JacobianModel,
    picked: (Option<usize>, Option<usize>),
) {
    ScrollArea::vertical().id_salt("block").auto_shrink(false).show(ui, |ui| {
        ui.spacing_mut().item_spacing = vec2(6.0, 2.0);
        match picked {
            (Some(row), Some(column)) => block_ui(ui, ctx, run, step, model, (row, column)),
            (Some(row), None) => line_ui(ui, ctx, &strongest_columns(model, row)),
            (None, column) => columns_ui(ui, ctx, model, column),
        }
    });
}

/// Draws a line for the selected column, and in the window one for each other column of a calibration parameter.
fn columns_ui(ui: &mut Ui, ctx: &PanelContext<'_>, model: &JacobianModel, selected: Option<usize>) {
    if let Some(column) = selected {
        line_ui(ui, ctx, &strongest_rows(model, column));
    } else {
        let text = "Click a block: its rows, residuals and derivatives, and the feature or parameter in all panels";
        ui.add(Label::new(RichText::new(text).color(ctx.theme.text_weak)).wrap());
    }
    let others = model.jacobian.columns.iter().enumerate().filter(|(column, block)| {
        !ctx.presentation.is_figure() && block.id.parameter().is_some() && Some(*column) != selected
    });
    for (column, _) in others {
        let text = strongest_rows(model, column);
        ui.add(Label::new(RichText::new(text).color(ctx.theme.text)).wrap());
    }
}

fn line_ui(ui: &mut Ui, ctx: &PanelContext<'_>, text: &str) {
    ui.add(Label::new(RichText::new(text).color(ctx.theme.text_strong)).wrap());
}

/// The parameters with the largest norms in a row.
fn strongest_columns(model: &JacobianModel, row: usize) -> String {
    const SHOWN: usize = 4;
    let of_row = &model.jacobian.rows[row];
    let mut norms: Vec<(usize, f32)> = of_row
        .norms
        .iter()
        .map(|(column, norm)| (usize::from(*column), *norm))
        .filter(|(column, _)| model.jacobian.columns[*column].id.parameter().is_some())
        .collect();
    norms.sort_by(|a, b| b.1.total_cmp(&a.1));
    let shown = norms.iter().take(SHOWN).map(|(column, norm)| {
        let words = unit_text(&model.jacobian.columns[*column], model.joint_count);
        format!("{} {} {words}", model.columns.strips[*column].name, significant(f64::from(*norm)))
    });
    let shown = shown.collect::<Vec<_>>().join(", ");
    let name = name_of(&of_row.factor);
    if shown.is_empty() {
        format!("{name}: no calibration parameter")
    } else {
        format!("{name}, largest block norms: {shown}")
    }
}

/// The rows with the largest norms in a column.
fn strongest_rows(model: &JacobianModel, column: usize) -> String {
    const SHOWN: usize = 4;
    let rows = 0..model.jacobian.rows.len();
    let mut norms: Vec<(usize, f32)> = rows.map(|row| (row, model.norm(row, column))).collect();
    norms.retain(|(_, norm)| *norm > 0.0);
    norms.sort_by(|a, b| b.1.total_cmp(&a.1));
    let count = norms.len();
    let shown = norms.iter().take(SHOWN);
    let shown = shown.map(|(row, norm)| {
        format!("{} ({})", name_of(&model.jacobian.rows[*row].factor), significant(f64::from(*norm)))
    });
    let shown = shown.collect::<Vec<_>>().join(", ");
    format!("{}: non-zero in {count} factors, largest block norms: {shown}", model.columns.strips[column].name)
}

fn block_ui(
    ui: &mut Ui,
    ctx: &PanelContext<'_>,
    run: &RunRecord,
    step: &StepRecord,
    model: &JacobianModel,
    (row, column): (usize, usize),
) {
    line_ui(ui, ctx, &headline(model, row, column));
    match model.jacobian.rows[row].factor {
        JacobianFactor::Feature(id) => {
            let cameras = cameras(&ctx.recording.rig, run, step);
            if let Some(rows) = step.report.feature_rows(&cameras, id) {
                observations_ui(ui, ctx, step, model, &rows, id, column);
            }
        }
        factor => {
            let kind = factor.kind();
            if let Some(summary) = step.report.residuals.iter().find(|summary| summary.factor == kind) {
                let (before, after) = (significant(summary.chi2_before), significant(summary.chi2_after));
                let text = format!(
                    "All factors of this kind: χ² {before} before the solve, {after} after, {} residuals",
                    summary.count
                );
                ui.label(RichText::new(text).color(ctx.theme.text));
            }
            if let JacobianFactor::Encoder(frame) = factor {
                readings_ui(ui, ctx, step, model, frame, column);
            } else {
                factors::block_ui(ui, ctx, run, model, factor, column);
            }
        }
    }
}

/// Table with a row per observation: its residual, and the derivatives of the pixel with respect to the unknown.
fn observations_ui(
    ui: &mut Ui,
    ctx: &PanelContext<'_>,
    step: &StepRecord,
    model: &JacobianModel,
    rows: &FeatureRows,
    id: FeatureId,
    column: usize,
) {
    let block = &model.jacobian.columns[column];
    let Some(feature) = step.report.features.iter().find(|feature| feature.id == id) else { return };
    let parts = scalar_columns(block, model.joint_count);
    let known = [terms::FRAME, terms::U, terms::V, terms::RESIDUAL_U, terms::RESIDUAL_V, terms::WEIGHT];
    let slopes = parts.iter().flat_map(|(name, _)| [format!("∂u{name}"), format!("∂v{name}")]);
    let heads: Vec<(String, Term)> = known
        .into_iter()
        .map(|term| (term.name.to_owned(), term))
        .chain(slopes.map(|head| (head, terms::SLOPE)))
        .collect();
    let lines = rows.frames.iter().enumerate().filter_map(|(place, frame)| {
        let seen = feature.observations.iter().find(|seen| seen.frame_index == frame.0)?;
        let residual = seen.residual_after_px.map_or([f64::NAN; 2], |residual| [residual.x, residual.y]);
        let mut cells = vec![frame.to_string()];
        cells.extend([seen.measured_px.x, seen.measured_px.y].map(|pixel| fixed(pixel, 1)));
        cells.extend(residual.map(|pixel| fixed(pixel, 2)));
        cells.push(fixed(seen.robust_weight, 2));
        // Conversion from standard deviations to pixels.
        let pixels = step.report.pixel_sigma_px(feature.id) / seen.robust_weight.sqrt();
        for (part, (_, factor)) in parts.iter().enumerate() {
            let at = |axis: usize| rows.rows[(2 * place + axis, block.start + part)] * pixels / factor;
            cells.extend([significant(at(0)), significant(at(1))]);
        }
        Some(cells)
    });
    grid_ui(ui, ctx.theme, NUMBERS, &heads, lines);
}

/// Table with a row per encoder: its reading, its residual, and the derivatives of the residual with respect to the
/// unknown.
fn readings_ui(
    ui: &mut Ui,
    ctx: &PanelContext<'_>,
    step: &StepRecord,
    model: &JacobianModel,
    frame: FrameId,
    column: usize,
) {
    let block = &model.jacobian.columns[column];
    let Some(frame) = step.report.window.iter().find(|state| state.frame_index == frame.0) else { return };
    let (Some(readings), Some(sigmas)) = (&frame.encoder_angles_rad, &frame.encoder_sigmas_rad) else { return };
    let own = block.id == ColumnId::Joints(FrameId(frame.frame_index));
    let lines = readings.iter().zip(sigmas).zip(&frame.joint_angles_rad).enumerate();
    let lines = lines.map(|(joint, ((reading, sigma), angle))| {
        let slope = if own {
            format!("{} in q{}", significant(sigma.recip().to_radians()), joint + 1)
        } else {
            "–".to_owned()
        };
        vec![
            (joint + 1).to_string(),
            fixed(principal_angle(*reading).to_degrees(), 3),
            fixed(principal_angle(*angle).to_degrees(), 3),
            fixed(sigma.to_degrees(), 3),
            fixed(principal_angle(angle - reading) / sigma, 2),
            slope,
        ]
    });
    let columns = [terms::JOINT, terms::READING, terms::ESTIMATE, terms::SIGMA, terms::RESIDUAL, terms::ENCODER_SLOPE];
    grid_ui(ui, ctx.theme, NUMBERS, &named(&columns), lines);
}

/// Scalar columns of a block: label, and shown units per stored unit.
fn scalar_columns(block: &ColumnBlock, joint_count: usize) -> Vec<(String, f64)> {
    let shown = |name: &str, dimension: Dimension| {
        let shown = Shown::of(dimension);
        (format!("{name}, px/{}", shown.unit.trim()), shown.factor)
    };
    match block.id {
        ColumnId::Calibration(parameter) => {
            let shown = parameter.shown();
            vec![(format!(", {}", per("px", shown)), shown.factor)]
        }
        ColumnId::Joints(_) => joint_columns(block.len, joint_count)
            .into_iter()
            .map(|(name, unit)| (format!(" {name}, px/{unit}"), 1_f64.to_degrees()))
            .collect(),
        ColumnId::Pose(_) => {
            let parts = [" rx", " ry", " rz"].map(|part| shown(part, Dimension::Angle)).into_iter();
            parts.chain([" tx", " ty", " tz"].map(|part| shown(part, Dimension::Length))).collect()
        }
        ColumnId::VelocityBias(_) | ColumnId::GimbalImu(_) => Vec::new(),
        ColumnId::InverseDepth => vec![(", px·m".to_owned(), 1.0)],
    }
}
