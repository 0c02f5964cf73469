//! The numbers of the factors that are not features: a step keeps only the norms of their blocks, so it is taken again when
//! somebody looks at one.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::thread::Builder;
use std::time::Duration;

use egui::{RichText, Ui};

use super::details::numbers_ui;
use super::model::JacobianModel;
use crate::estimator::{ColumnBlock, ColumnGroup, FactorRows, JacobianFactor};
use crate::gui::PanelContext;
use crate::gui::units::{Shown, figure, fixed};
use crate::session::{History, RunRecord, StepRecord};

/// How often it is looked whether the step has been taken again.
const REPAINT: Duration = Duration::from_millis(50);
/// Rows of a block that are shown; a marginalization prior has over a hundred, the strongest come first.
const MOST_ROWS: usize = 40;

type Rows = Option<Vec<FactorRows>>;

/// The rows of one step.
#[derive(Debug, Default)]
pub(super) struct FactorsUi {
    known: Option<(Arc<StepRecord>, Rows)>,
    coming: Option<(Arc<StepRecord>, Receiver<Rows>)>,
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
        let fresh = |known: &Arc<StepRecord>| Arc::ptr_eq(known, step);
        let wanted =
            picked.is_some_and(|factor| !matches!(factor, JacobianFactor::Feature(_) | JacobianFactor::Encoder(_)));
        if !wanted || self.known.as_ref().is_some_and(|(known, _)| fresh(known)) {
            return;
        }
        if !self.coming.as_ref().is_some_and(|(known, _)| fresh(known)) {
            let (Some(history), Some(number)) = (&run.history, number) else {
                self.known = Some((Arc::clone(step), None));
                return;
            };
            self.coming = Some((Arc::clone(step), taken_again(history, number, in_background)));
        }
        let told = self.coming.as_ref().map(|(_, coming)| coming.try_recv());
        if let Some(Err(TryRecvError::Empty)) = told {
            return;
        }
        self.known = Some((Arc::clone(step), told.and_then(Result::ok).flatten()));
        self.coming = None;
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
        if self.coming.is_some() {
            note(ui, "Taking the step again for the numbers…");
            ui.ctx().request_repaint_after(REPAINT);
            return;
        }
        let rows = self.known.as_ref().filter(|(known, _)| std::ptr::eq(Arc::as_ptr(known), step));
        let rows = rows.and_then(|(_, rows)| rows.as_ref()?.iter().find(|rows| rows.factor == factor));
        let Some(FactorRows { rows, .. }) = rows else {
            note(ui, "Only the norms of this block were kept");
            return;
        };
        let block = &model.jacobian.columns[column];
        let residuals = rows.ncols() - 1;
        if block.start + block.len > residuals {
            return;
        }
        let unit = step.report.calibration.units.get(column).copied().unwrap_or_default();
        let parts = parts_of(block, unit);
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

/// The rows of a step, as soon as it has been taken again.
fn taken_again(history: &Arc<History>, number: usize, in_background: bool) -> Receiver<Rows> {
    let (sender, receiver) = channel();
    let (later, given) = (sender.clone(), Arc::clone(history));
    let work = move || drop(later.send(given.factor_rows(number)));
    if !(in_background && Builder::new().name("factor rows".to_owned()).spawn(work).is_ok()) {
        // Nobody else has the receiver.
        drop(sender.send(history.factor_rows(number)));
    }
    receiver
}

/// The columns of a block: what a residual's slope by them is called, and how many shown units one stored unit is.
fn parts_of(block: &ColumnBlock, unit: &str) -> Vec<(String, f64)> {
    let shown = |name: &str, unit: &str| {
        let shown = Shown::of(unit);
        (format!("∂{name} σ/{}", shown.unit.trim()), shown.factor)
    };
    let three =
        |names: [&str; 3], unit: &'static str, factor: f64| names.map(|name| (format!("∂{name} σ/{unit}"), factor));
    let degrees = 1_f64.to_degrees();
    match block.group {
        ColumnGroup::Calibration => vec![shown("", unit)],
        ColumnGroup::Joints => (1..=block.len).map(|joint| shown(&format!("q{joint}"), "rad")).collect(),
        ColumnGroup::Pose => {
            let turns = ["rx", "ry", "rz"].map(|part| shown(part, "rad")).into_iter();
            turns.chain(["tx", "ty", "tz"].map(|part| shown(part, "m"))).collect()
        }
        ColumnGroup::SpeedBias => {
            let speeds = three(["vx", "vy", "vz"], "(m/s)", 1.0).into_iter();
            let turns = three(["gx", "gy", "gz"], "(°/s)", degrees);
            speeds.chain(turns).chain(three(["ax", "ay", "az"], "(m/s²)", 1.0)).collect()
        }
        ColumnGroup::InverseDepth => Vec::new(),
    }
}
