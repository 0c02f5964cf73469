//! The numbers of the factors that are not features: a step keeps only the norms of their blocks, so it is taken again when
//! somebody looks at one.

use std::sync::Arc;

use egui::{RichText, Ui};

use super::details::numbers_ui;
use super::model::JacobianModel;
use crate::estimator::{ColumnBlock, ColumnId, FactorRows, JacobianFactor};
use crate::geometry::Dimension;
use crate::gui::PanelContext;
use crate::gui::step_work::{REPAINT, StepWork};
use crate::gui::units::{Shown, figure, fixed};
use crate::session::{RunRecord, StepRecord};

/// Rows of a block that are shown; a marginalization prior has over a hundred, the strongest come first.
const MOST_ROWS: usize = 40;

/// The rows of one step.
#[derive(Debug, Default)]
pub(super) struct FactorsUi {
    rows: StepWork<Vec<FactorRows>>,
}

impl FactorsUi {
    /// Sees to it that the rows of the picked factor come, where it has any beside the report's.
    pub(super) fn look(
        &mut self,
        run: &RunRecord,
        step: &Arc<StepRecord>,
        number: Option<usize>,
        picked: Option<JacobianFactor>,
        in_background: bool,
    ) {
        let wanted =
            picked.is_some_and(|factor| !matches!(factor, JacobianFactor::Feature(_) | JacobianFactor::Encoder(_)));
        if wanted {
            let can_be_taken = run.history.is_some() && number.is_some();
            self.rows.ask(step, "factor rows", in_background && can_be_taken, || {
                let history = run.history.clone();
                move || history.as_ref()?.factor_rows(number?)
            });
        }
    }

    /// A row for each residual of the factor that the block is in: the residual, and how it follows the unknowns.
    pub(super) fn block_ui(
        &self,
        ui: &mut Ui,
        ctx: &PanelContext<'_>,
        step: &StepRecord,
        model: &JacobianModel,
        factor: JacobianFactor,
        column: usize,
    ) {
        let note = |ui: &mut Ui, text: &str| {
            ui.label(RichText::new(text).color(ctx.theme.text_weak));
        };
        if self.rows.is_busy() {
            note(ui, "Taking the step again for the numbers…");
            ui.ctx().request_repaint_after(REPAINT);
            return;
        }
        let rows = self.rows.of(step).and_then(|rows| rows.iter().find(|rows| rows.factor == factor));
        let Some(FactorRows { rows, .. }) = rows else {
            note(ui, "Only the norms of this block were kept");
            return;
        };
        let block = &model.jacobian.columns[column];
        let residuals = rows.ncols() - 1;
        if block.start + block.len > residuals {
            return;
        }
        let parts = parts_of(block);
        let own = rows.columns(block.start, block.len);
        let mut order: Vec<usize> = (0..rows.nrows()).filter(|row| own.row(*row).amax() > 0.0).collect();
        let count = order.len();
        if count > MOST_ROWS {
            order.sort_by(|a, b| own.row(*b).norm().total_cmp(&own.row(*a).norm()));
            order.truncate(MOST_ROWS);
        }
        let squared = rows.column(residuals).norm_squared();
        let shown = if count > order.len() { format!(", the strongest {} shown", order.len()) } else { String::new() };
        let text = format!("its {} residuals: χ² {}; {count} touch this block{shown}", rows.nrows(), figure(squared));
        ui.label(RichText::new(text).color(ctx.theme.text));
        let mut heads = vec!["row".to_owned(), "residual σ".to_owned()];
        heads.extend(parts.iter().map(|(name, _)| name.clone()));
        let lines = order.iter().map(|row| {
            let mut cells = vec![(row + 1).to_string(), fixed(rows[(*row, residuals)], 3)];
            cells.extend(parts.iter().enumerate().map(|(part, (_, factor))| figure(own[(*row, part)] / factor)));
            cells
        });
        numbers_ui(ui, ctx, &heads, lines);
    }
}

/// The columns of a block: what a residual's slope by them is called, and how many shown units one stored unit is.
fn parts_of(block: &ColumnBlock) -> Vec<(String, f64)> {
    let shown = |name: &str, dimension: Dimension| {
        let shown = Shown::of(dimension);
        (format!("∂{name} σ/{}", shown.unit.trim()), shown.factor)
    };
    let three =
        |names: [&str; 3], unit: &'static str, factor: f64| names.map(|name| (format!("∂{name} σ/{unit}"), factor));
    let degrees = 1_f64.to_degrees();
    match block.id {
        ColumnId::Calibration(parameter) => vec![shown("", parameter.dimension())],
        ColumnId::Joints(_) => (1..=block.len).map(|joint| shown(&format!("q{joint}"), Dimension::Angle)).collect(),
        ColumnId::Pose(_) => {
            let turns = ["rx", "ry", "rz"].map(|part| shown(part, Dimension::Angle)).into_iter();
            turns.chain(["tx", "ty", "tz"].map(|part| shown(part, Dimension::Length))).collect()
        }
        ColumnId::VelocityBias(_) => {
            let speeds = three(["vx", "vy", "vz"], "(m/s)", 1.0).into_iter();
            let turns = three(["gx", "gy", "gz"], "(°/s)", degrees);
            speeds.chain(turns).chain(three(["ax", "ay", "az"], "(m/s²)", 1.0)).collect()
        }
        ColumnId::InverseDepth => Vec::new(),
    }
}
