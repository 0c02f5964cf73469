//! Rows of the factors other than reprojection. A record contains only the norms of their blocks, so the session
//! recomputes the rows of a selected factor.

use egui::{RichText, Ui};

use super::model::{JacobianModel, joint_columns, per};
use crate::estimator::{ColumnBlock, ColumnId, FactorRows, JacobianFactor};
use crate::geometry::Dimension;
use crate::gui::PanelContext;
use crate::gui::help::terms::jacobian as terms;
use crate::gui::table::{grid_ui, named};
use crate::gui::units::{Shown, fixed, significant};
use crate::session::{Command, RunRecord};

/// Id and row height of the tables of numbers.
pub(super) const NUMBERS: (&str, f32) = ("block numbers", 14.0);

/// Maximum number of rows shown, the largest first; a marginalization prior has more than a hundred.
const MAX_ROWS: usize = 40;

/// Requests the rows of the selected factor of step `number` if the record does not have them.
pub(super) fn request(ctx: &mut PanelContext<'_>, run: &RunRecord, number: Option<usize>, picked: JacobianFactor) {
    let kept = matches!(picked, JacobianFactor::Feature(_) | JacobianFactor::Encoder(_));
    let known = |step| run.factor_rows.as_ref().is_some_and(|rows| rows.step == step);
    let index = ctx.recording.runs.iter().position(|known| known.id == run.id);
    if let (Some(run), Some(step)) = (index, number.filter(|step| !kept && !known(*step))) {
        ctx.commands.push(Command::RequestFactorRows { run, step });
    }
}

/// Table with a row per residual of the block's factor: the residual, and its derivatives with respect to the unknowns.
pub(super) fn block_ui(
    ui: &mut Ui,
    ctx: &PanelContext<'_>,
    run: &RunRecord,
    model: &JacobianModel,
    factor: JacobianFactor,
    column: usize,
) {
    let note = |ui: &mut Ui, text: &str| {
        ui.label(RichText::new(text).color(ctx.theme.text_weak));
    };
    let number = run.index_at(ctx.cursor_ns);
    let Some(known) = run.factor_rows.as_ref().filter(|known| Some(known.step) == number) else {
        note(ui, "Computing the rows of this step…");
        return;
    };
    let rows = known.rows.as_ref().and_then(|rows| rows.iter().find(|rows| rows.factor == factor));
    let Some(FactorRows { rows, .. }) = rows else {
        note(ui, "Only the norms of this block are stored");
        return;
    };
    let block = &model.jacobian.columns[column];
    let residuals = rows.ncols() - 1;
    if block.start + block.len > residuals {
        return;
    }
    let parts = scalar_columns(block, model.joint_count);
    let own = rows.columns(block.start, block.len);
    let mut order: Vec<usize> = (0..rows.nrows()).filter(|row| own.row(*row).amax() > 0.0).collect();
    let count = order.len();
    if count > MAX_ROWS {
        order.sort_by(|a, b| own.row(*b).norm().total_cmp(&own.row(*a).norm()));
        order.truncate(MAX_ROWS);
    }
    let squared = rows.column(residuals).norm_squared();
    let shown = if count > order.len() { format!(", the largest {} shown", order.len()) } else { String::new() };
    let text = format!(
        "{} residuals of this factor: χ² {}; {count} non-zero rows in this block{shown}",
        rows.nrows(),
        significant(squared)
    );
    ui.label(RichText::new(text).color(ctx.theme.text));
    let slopes = parts.iter().map(|(name, _)| (name.clone(), terms::ROW_SLOPE));
    let heads: Vec<_> = named(&[terms::ROW, terms::RESIDUAL]).into_iter().chain(slopes).collect();
    let lines = order.iter().map(|row| {
        let mut cells = vec![(row + 1).to_string(), fixed(rows[(*row, residuals)], 3)];
        cells.extend(parts.iter().enumerate().map(|(part, (_, factor))| significant(own[(*row, part)] / factor)));
        cells
    });
    grid_ui(ui, ctx.theme, NUMBERS, &heads, lines);
}

/// Scalar columns of a block: label of the derivative, and shown units per stored unit.
fn scalar_columns(block: &ColumnBlock, joint_count: usize) -> Vec<(String, f64)> {
    let shown = |name: &str, dimension: Dimension| {
        let shown = Shown::of(dimension);
        (format!("∂{name}, σ/{}", shown.unit.trim()), shown.factor)
    };
    let three =
        |names: [&str; 3], unit: &'static str, factor: f64| names.map(|name| (format!("∂{name}, σ/{unit}"), factor));
    let degrees = 1_f64.to_degrees();
    match block.id {
        ColumnId::Calibration(parameter) => {
            let shown = parameter.shown();
            vec![(format!("∂, {}", per("σ", shown)), shown.factor)]
        }
        ColumnId::Joints(_) => joint_columns(block.len, joint_count)
            .into_iter()
            .map(|(name, unit)| (format!("∂{name}, σ/{unit}"), degrees))
            .collect(),
        ColumnId::Pose(_) => {
            let rotations = ["rx", "ry", "rz"].map(|part| shown(part, Dimension::Angle)).into_iter();
            rotations.chain(["tx", "ty", "tz"].map(|part| shown(part, Dimension::Length))).collect()
        }
        ColumnId::VelocityBias(_) | ColumnId::GimbalImu(_) => {
            let velocities = three(["vx", "vy", "vz"], "(m/s)", 1.0).into_iter();
            let angular_rates = three(["gx", "gy", "gz"], "(°/s)", degrees);
            velocities.chain(angular_rates).chain(three(["ax", "ay", "az"], "(m/s²)", 1.0)).collect()
        }
        ColumnId::InverseDepth => Vec::new(),
    }
}
