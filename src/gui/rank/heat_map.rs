//! Null and weak directions by parameter name: a heat map with the signed weights as text.

use egui::epaint::TextShape;
use egui::{Align2, FontFamily, FontId, Rect, RichText, Role, Sense, Stroke, StrokeKind, Ui, WidgetInfo, pos2, vec2};

use super::verdict::parameters_of;
use crate::gimbal::ParameterId;
use crate::gui::PanelContext;
use crate::gui::convergence::names::{meaning_of, part_of};
use crate::gui::theme::{self, Theme};
use crate::gui::units::{counted, significant};
use crate::observability::{CalibrationDirection, RankReport};

const NAME_WIDTH: f32 = 62.0;
const HEADER_HEIGHT: f32 = 28.0;
/// Height of the header of narrow columns, whose numbers are vertical.
const UPRIGHT_HEADER_HEIGHT: f32 = 40.0;
const MAX_ROW_HEIGHT: f32 = 26.0;
const MIN_ROW_HEIGHT: f32 = 12.0;
/// Minimum width of a column with signed numbers.
const NUMBER_WIDTH: f32 = 30.0;
/// Minimum width of a column whose singular value fits beside its neighbours'.
const HEAD_WIDTH: f32 = 40.0;
const MAX_COLUMN_WIDTH: f32 = 84.0;
const MIN_COLUMN_WIDTH: f32 = 15.0;
/// Rows with smaller weights may be omitted when room is short.
const MIN_SHOWN_WEIGHT: f64 = 0.1;

/// Draws the heat map in about `height` points; it takes more if necessary.
pub(super) fn ui(ui: &mut Ui, ctx: &mut PanelContext<'_>, rank: &RankReport, height: f32) {
    let theme = *ctx.theme;
    if rank.directions.is_empty() {
        ui.label(RichText::new("No null or weak direction").color(theme.text_weak));
        return;
    }
    let width = ui.available_width();
    let room = (width - NAME_WIDTH).max(MIN_COLUMN_WIDTH);
    let count = rank.directions.len().min((room / MIN_COLUMN_WIDTH) as usize).max(1);
    let pitch = (room / count as f32).min(MAX_COLUMN_WIDTH);
    let directions = &rank.directions[..count];

    let mut rows: Vec<usize> = (0..rank.parameters.len()).collect();
    rows.sort_by_key(|row| part_of(rank.parameters[*row]));
    let all = rows.len();
    let header_height = if pitch >= HEAD_WIDTH { HEADER_HEIGHT } else { UPRIGHT_HEADER_HEIGHT };
    if (height - header_height) / (rows.len() as f32) < MIN_ROW_HEIGHT {
        rows.retain(|row| {
            let weight = |direction: &CalibrationDirection| direction.weights.get(*row).copied().unwrap_or(0.0);
            directions.iter().any(|direction| weight(direction).abs() >= MIN_SHOWN_WEIGHT)
        });
    }
    let left_out = all - rows.len();
    let row_height = ((height - header_height) / rows.len().max(1) as f32).clamp(MIN_ROW_HEIGHT, MAX_ROW_HEIGHT);
    let (_, rect) = ui.allocate_space(vec2(width, header_height + row_height * rows.len() as f32));

    for (column, direction) in directions.iter().enumerate() {
        let left = rect.left() + NAME_WIDTH + column as f32 * pitch;
        let cell = Rect::from_min_size(pos2(left, rect.top()), vec2(pitch, header_height));
        header(ui, ctx, rank, direction, column, cell);
    }
    for (place, row) in rows.iter().enumerate() {
        let top = rect.top() + header_height + place as f32 * row_height;
        let line = Rect::from_min_size(pos2(rect.left(), top), vec2(NAME_WIDTH + pitch * count as f32, row_height));
        row_ui(ui, ctx, rank.parameters[*row], *row, directions, line, pitch);
    }
    if left_out > 0 || count < rank.directions.len() {
        let mut notes = Vec::new();
        if left_out > 0 {
            notes.push(format!("{} with |weight| < {MIN_SHOWN_WEIGHT}", counted(left_out, "parameter")));
        }
        if count < rank.directions.len() {
            notes.push(counted(rank.directions.len() - count, "more observable direction"));
        }
        ui.label(RichText::new(format!("Not shown: {}", notes.join(", "))).small().color(theme.text_weak));
    }
}

/// Number and singular value of a direction.
fn header(
    ui: &Ui,
    ctx: &PanelContext<'_>,
    rank: &RankReport,
    direction: &CalibrationDirection,
    column: usize,
    cell: Rect,
) {
    let theme = ctx.theme;
    let color = if direction.structural { theme.error } else { theme.warn };
    let painter = ui.painter();
    let mark = if direction.structural { "null" } else { "weak" };
    let value = if direction.structural { "0".to_owned() } else { significant(direction.singular_value) };
    let small = FontId::new(9.5, FontFamily::Monospace);
    if cell.width() >= HEAD_WIDTH {
        let top = cell.center_top();
        painter.text(top, Align2::CENTER_TOP, mark, FontId::new(10.0, FontFamily::Proportional), color);
        painter.text(top + vec2(0.0, 13.0), Align2::CENTER_TOP, value, small, theme.text_weak);
    } else {
        let galley = painter.layout_no_wrap(value, small, color);
        let foot = cell.center_bottom() - vec2(0.5 * galley.size().y, 2.0);
        painter.add(TextShape::new(foot, galley, color).with_angle(-std::f32::consts::FRAC_PI_2));
    }
    let response = ui.interact(cell, ui.unique_id().with(("direction", column)), Sense::hover());
    let named = parameters_of(&ctx.names(), &rank.parameters, direction, 6);
    response.widget_info(|| WidgetInfo::labeled(Role::Label, true, format!("{mark} direction {named}")));
    response.on_hover_text(format!(
        "{mark} direction, singular value {} (1: σ of 10° or 3 cm)\n{named}",
        significant(direction.singular_value)
    ));
}

fn row_ui(
    ui: &Ui,
    ctx: &mut PanelContext<'_>,
    parameter: ParameterId,
    row: usize,
    directions: &[CalibrationDirection],
    line: Rect,
    pitch: f32,
) {
    let theme = *ctx.theme;
    let name = ctx.names().name(parameter);
    let painter = ui.painter();
    let selected = ctx.selection.parameter == Some(parameter);
    let color = if selected { theme.accent } else { theme.text };
    painter.text(line.left_center(), Align2::LEFT_CENTER, &name, theme::label_font(), color);
    for (column, direction) in directions.iter().enumerate() {
        let weight = direction.weights.get(row).copied().unwrap_or(0.0);
        let left = line.left() + NAME_WIDTH + column as f32 * pitch;
        let cell = Rect::from_min_size(pos2(left, line.top()), vec2(pitch, line.height())).shrink(0.5);
        let ground = theme.diverging(weight);
        painter.rect_filled(cell, 1.0, ground);
        if weight.abs() >= 0.05 && pitch >= NUMBER_WIDTH {
            let font =
                FontId::new((line.height() - 3.0).min(if pitch > 50.0 { 12.0 } else { 10.0 }), FontFamily::Monospace);
            painter.text(cell.center(), Align2::CENTER_CENTER, format!("{weight:+.2}"), font, Theme::text_on(ground));
        } else if weight.abs() >= 0.2 {
            let sign = if weight < 0.0 { "−" } else { "+" };
            let font = FontId::new(10.0, FontFamily::Monospace);
            painter.text(cell.center(), Align2::CENTER_CENTER, sign, font, Theme::text_on(ground));
        }
    }
    let (sense, role) = ctx.presentation.clickable(Role::Label);
    let response = ui.interact(line, ui.unique_id().with(("row", &name)), sense);
    response.widget_info(|| WidgetInfo::selected(role, true, selected, format!("{name} weights")));
    if selected || response.hovered() {
        let stroke = Stroke::new(1.0, if selected { theme.accent } else { theme.outline });
        painter.rect_stroke(line, 0.0, stroke, StrokeKind::Inside);
    }
    if response.clicked() {
        ctx.selection.parameter = if selected { None } else { Some(parameter) };
    }
    response.on_hover_text(format!(
        "{name}: {}\nWeights in the unit right singular vectors, columns scaled by 10° and 3 cm",
        meaning_of(parameter, &ctx.recording.rig)
    ));
}
