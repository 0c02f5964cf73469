//! The Jacobian panel: the linearization of a step by blocks, before elimination.
//!
//! Rows are factors, columns are unknowns; the colour of a block is its norm.

mod details;
mod factors;
mod model;
mod paint;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use egui::{Pos2, Rect, Role, Sense, Ui, Vec2, WidgetInfo, vec2};

use self::model::JacobianModel;
pub(super) use self::model::{cameras, column_name, name_of};
use super::help::terms::window;
use super::plot::pan_zoom::PanZoom;
use super::under_pointer::{Item, offer, offer_item};
use super::widgets::{describe, empty_ui};
use super::{CsvTable, Panel, PanelContext};
use crate::estimator::{ColumnId, JacobianFactor, JacobianRow};
use crate::session::{RunRecord, StepRecord};
use crate::table::{Column, csv};

/// Maximum magnification of the matrix.
const MAX_ZOOM: f32 = 40.0;
/// Width of the row names on the left in points.
const ROW_NAMES: f32 = 118.0;
/// Height of the legend below the matrix in points.
const LEGEND: f32 = 18.0;
/// Panel height in points from which the values of the selected block are shown, and the fraction of the height that
/// they take.
const MIN_HEIGHT_WITH_DETAILS: f32 = 300.0;
const DETAILS_RATIO: f32 = 0.26;
/// Height in points of the line about a row or a column.
const DETAILS_LINE: f32 = 34.0;

/// State of the Jacobian panel: the visible region and the selected block.
#[derive(Default)]
pub struct JacobianPanel {
    model: Option<JacobianModel>,
    mesh: paint::CachedMesh,
    view: PanZoom,
    /// Selected row if it is not a feature (features are selected in all panels).
    row: Option<JacobianFactor>,
    /// Selected column if it is not a parameter.
    column: Option<ColumnId>,
    /// Height in points of the column names: the largest so far of the run with this id, so that the matrix keeps its
    /// size from step to step.
    names_height: (u64, f32),
}

impl CsvTable for JacobianPanel {
    /// Norms of the Jacobian's blocks as in the panel, one factor per row; zeros are empty.
    fn csv_table(&mut self, ctx: &PanelContext<'_>) -> String {
        type FactorColumn<'a> = Column<'a, JacobianRow>;
        let Some(run) = ctx.selected_run() else { return String::new() };
        let Some(step) = run.step_at(ctx.cursor_ns) else { return String::new() };
        let cameras = cameras(&ctx.recording.rig, run, step);
        let Some(jacobian) = step.report.jacobian(&cameras) else { return String::new() };
        let names = ctx.names();
        let mut columns = vec![
            FactorColumn::new("residuals", |row| name_of(&row.factor)),
            FactorColumn::new("rows", |row| row.height),
        ];
        columns.extend(FactorColumn::each(
            jacobian.columns.iter().enumerate(),
            |(_, block)| column_name(block.id, &names),
            |row, (index, _)| {
                row.norms.iter().find(|(of, _)| usize::from(*of) == *index).map(|(_, norm)| norm.to_string())
            },
        ));
        csv(&columns, &jacobian.rows)
    }
}

impl Panel for JacobianPanel {
    fn ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>) {
        let Some((run, step)) = ctx.selected_step() else {
            empty_ui(ui, "No step at the cursor");
            return;
        };
        if !self.model.as_ref().is_some_and(|model| Arc::ptr_eq(&model.step, step)) {
            self.model = JacobianModel::of_step(&ctx.recording.rig, &ctx.names(), run, step);
        }
        // Taken out for drawing, so that the rest of the panel can be mutated.
        let Some(model) = self.model.take() else {
            let why = if step.summary_only { "Recomputing this step…" } else { "No linearization in this step" };
            empty_ui(ui, why);
            return;
        };
        self.model_ui(ui, ctx, run, step, &model);
        self.model = Some(model);
    }
}

impl JacobianPanel {
    fn model_ui(
        &mut self,
        ui: &mut Ui,
        ctx: &mut PanelContext<'_>,
        run: &RunRecord,
        step: &Arc<StepRecord>,
        model: &JacobianModel,
    ) {
        let height = ui.available_height();
        let selected_block = self.selected_block(ctx, model);
        let with_details = height >= MIN_HEIGHT_WITH_DETAILS;
        // In the window the matrix keeps its height, so that no block moves under the pointer; in a figure the room follows
        // the selection, which this step may lack.
        let wanted = [
            self.row.is_some() || ctx.selection.feature.is_some(),
            self.column.is_some() || ctx.selection.parameter.is_some(),
        ];
        let below = match wanted {
            _ if !with_details => 0.0,
            _ if !ctx.presentation.is_figure() => DETAILS_RATIO * height,
            [true, true] => DETAILS_RATIO * height,
            [false, false] => 0.0,
            _ => DETAILS_LINE,
        };
        let names = paint::column_names_height(ui, model);
        let known = if self.names_height.0 == run.id { self.names_height.1 } else { 0.0 };
        self.names_height = (run.id, names.max(known));
        let size = vec2(ui.available_width(), height - below - LEGEND - 2.0 * ui.spacing().item_spacing.y);
        let (_, whole) = ui.allocate_space(size.max(Vec2::splat(8.0)));
        let area = Rect::from_min_max(whole.min + vec2(ROW_NAMES, self.names_height.1), whole.max);
        if area.width() < 8.0 || area.height() < 8.0 {
            return;
        }
        let response = ui.interact(area, ui.unique_id().with("blocks"), Sense::click_and_drag());
        response.widget_info(|| WidgetInfo::labeled(Role::Image, true, "Jacobian blocks"));
        describe(&response, &model.summary());
        self.view.navigate(ui, ctx.theme, area, area.size(), &response, MAX_ZOOM);
        let place = self.view.place(area, area.size());
        let hovered = response.hover_pos().and_then(|pointer| block_at(model, place, pointer));
        self.mesh.paint(ui, ctx.theme, area, place, model);
        paint::axes(ui, ctx.theme, whole, area, place, model, selected_block);
        if response.clicked() {
            self.select(ctx, model, hovered);
        }
        if let Some((row, column)) = hovered {
            paint::hover(ui, ctx.theme, area, place, model, (row, column));
            let text = details::headline(model, row, column);
            offer(ui, text.clone());
            // The parameter of a block of both, as features have the image panel.
            match (model.jacobian.rows[row].factor, model.jacobian.columns[column].id) {
                (_, ColumnId::Calibration(parameter)) => offer_item(ui, Item::Parameter(parameter)),
                (JacobianFactor::Feature(id), _) => offer_item(ui, Item::Feature(id)),
                _ => {}
            }
            response.on_hover_text_at_pointer(text);
        }
        let (legend, hovered_legend) = ui.allocate_exact_size(vec2(ui.available_width(), LEGEND), Sense::hover());
        hovered_legend.on_hover_text(window::JACOBIAN_NORM.meaning);
        paint::legend(ui, ctx.theme, legend, model);
        let (row, column) = selected_block.unwrap_or_default();
        if with_details && (selected_block.is_some() || !ctx.presentation.is_figure()) {
            if let Some(row) = row {
                factors::request(ctx, run, run.index_at(ctx.cursor_ns), model.jacobian.rows[row].factor);
            }
            details::ui(ui, ctx, run, step, model, (row, column));
        }
    }

    /// Block that is selected in this panel or by the common selection: a row, a column, or both.
    fn selected_block(&self, ctx: &PanelContext<'_>, model: &JacobianModel) -> Option<(Option<usize>, Option<usize>)> {
        let wanted = self.row.or_else(|| ctx.selection.feature.map(JacobianFactor::Feature));
        let row = wanted.and_then(|wanted| model.jacobian.rows.iter().position(|row| row.factor == wanted));
        let wanted = self.column.or_else(|| ctx.selection.parameter.map(ColumnId::Calibration));
        let column = wanted.and_then(|wanted| model.jacobian.columns.iter().position(|block| block.id == wanted));
        (row.is_some() || column.is_some()).then_some((row, column))
    }

    /// Applies a click: features and parameters are selected in all panels, other rows and columns only here.
    fn select(&mut self, ctx: &mut PanelContext<'_>, model: &JacobianModel, block: Option<(usize, usize)>) {
        (self.row, self.column) = (None, None);
        (ctx.selection.feature, ctx.selection.parameter) = (None, None);
        let Some((row, column)) = block else { return };
        match model.jacobian.rows[row].factor {
            JacobianFactor::Feature(id) => ctx.selection.feature = Some(id),
            factor => self.row = Some(factor),
        }
        match model.jacobian.columns[column].id {
            ColumnId::Calibration(parameter) => ctx.selection.parameter = Some(parameter),
            other => self.column = Some(other),
        }
    }
}

/// Row and column at a screen position.
fn block_at(model: &JacobianModel, place: Rect, pointer: Pos2) -> Option<(usize, usize)> {
    let fraction = (pointer - place.min) / place.size();
    Some((model.rows.at(fraction.y)?, model.columns.at(fraction.x)?))
}
