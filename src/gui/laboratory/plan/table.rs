//! Table of σ: prior, this log, the motion alone and both, with the verdict on each parameter.

use egui::{Align2, FontId, Label, Rect, RichText, Role, Stroke, StrokeKind, Ui, WidgetInfo, pos2, vec2};

use super::rows::{PlannedRow, ShownPrediction, SigmaColumn};
use crate::gui::PanelContext;
use crate::gui::determination::look_of;
use crate::gui::help::terms::window;
use crate::gui::theme::{Theme, label_font};
use crate::gui::under_pointer::{Item, offer, offer_item};
use crate::gui::units::fixed;
use crate::observability::{DETERMINED_RATIO, Determination, NOT_DETERMINED_RATIO};
use crate::text::Named as _;

const ROW_HEIGHT: f32 = 17.0;
/// Gap between two columns in points.
const GAP: f32 = 8.0;
/// Width of the bar of σ / prior in points.
const BAR_WIDTH: f32 = 60.0;

/// Number of parameters in each verdict, and the least determined one, in a sentence per verdict.
pub(super) fn headline_ui(ui: &mut Ui, theme: &Theme, shown: &ShownPrediction<'_>) {
    let result = shown.now.result();
    let after = if shown.flight.is_some() { "After this log and the motion" } else { "After the motion" };
    let with = |verdict: Determination| {
        let names = result.parameters.iter().filter(|it| it.verdict == verdict).map(|it| it.name.as_str());
        names.collect::<Vec<_>>()
    };
    ui.horizontal_wrapped(|ui| {
        let mut is_open = false;
        for verdict in [Determination::NotDetermined, Determination::WeaklyDetermined] {
            let names = with(verdict);
            if !names.is_empty() {
                is_open = true;
                let (mark, color) = look_of(verdict, theme);
                let text = format!("{mark} {} {}: {}", names.len(), verdict.name(), names.join(", "));
                ui.add(Label::new(RichText::new(text).strong().color(color)).wrap());
            }
        }
        if !is_open {
            let (mark, color) = look_of(Determination::Determined, theme);
            ui.label(RichText::new(format!("{mark} every parameter determined")).strong().color(color));
        }
    });
    let text = format!(
        "{after}: largest σ / prior {} ({}), mean {}",
        fixed(result.worst_ratio, 3),
        result.worst,
        fixed(result.mean_ratio, 3)
    );
    ui.add(Label::new(RichText::new(text).color(theme.text)).wrap()).on_hover_text(window::PLAN_SIGMA.meaning);
}

/// Columns that are shown with their left edges; columns of numbers are right-aligned within their widths.
struct SigmaColumns {
    shown: Vec<(SigmaColumn, f32, f32)>,
    width: f32,
}

impl SigmaColumns {
    fn new(ui: &Ui, theme: &Theme, rows: &[PlannedRow<'_>]) -> Self {
        let size = |text: String, font: FontId| ui.painter().layout_no_wrap(text, font, theme.text).size().x;
        let has_flight = rows.iter().any(|row| row.flight.is_some());
        let has_change = rows.iter().any(|row| row.change.is_some());
        let is_shown = |column: &SigmaColumn| match column {
            SigmaColumn::Flight | SigmaColumn::Both => has_flight,
            SigmaColumn::Change => has_change,
            _ => true,
        };
        let mut left = 4.0;
        let mut shown = Vec::new();
        for column in SigmaColumn::ALL.into_iter().filter(is_shown) {
            let cells = rows.iter().map(|row| {
                let (text, font, _) = row.cell(column, theme);
                size(text, font)
            });
            let widest = cells.fold(size(column.title().to_owned(), label_font()), f32::max);
            let width = if column == SigmaColumn::Bar { BAR_WIDTH } else { widest };
            shown.push((column, left, width));
            left += width + GAP;
        }
        Self { shown, width: left }
    }
}

/// True for columns whose texts are right-aligned.
const fn is_number(column: SigmaColumn) -> bool {
    !matches!(column, SigmaColumn::Parameter | SigmaColumn::Bar | SigmaColumn::Verdict)
}

/// Draws the table; it is wider than the room if its columns need that.
pub(super) fn ui(ui: &mut Ui, ctx: &mut PanelContext<'_>, shown: &ShownPrediction<'_>) {
    let theme = *ctx.theme;
    let rows = PlannedRow::all(shown);
    let columns = SigmaColumns::new(ui, &theme, &rows);
    let (_, heading) = ui.allocate_space(vec2(columns.width.max(ui.available_width()), ROW_HEIGHT));
    for (column, left, width) in &columns.shown {
        let (left, width) = (heading.left() + left, *width);
        let (x, align) =
            if is_number(*column) { (left + width, Align2::RIGHT_CENTER) } else { (left, Align2::LEFT_CENTER) };
        let place = pos2(x, heading.center().y);
        let drawn = ui.painter().text(place, align, column.title(), label_font(), theme.text_weak);
        if !column.title().is_empty() {
            let id = ui.unique_id().with(("plan heading", column.title()));
            let response = ui.interact(drawn, id, egui::Sense::hover());
            response.widget_info(|| WidgetInfo::labeled(Role::Label, true, column.title()));
            response.on_hover_text(column.meaning(shown.flight));
        }
    }
    ui.painter().hline(heading.x_range(), heading.bottom() - 1.0, Stroke::new(1.0, theme.outline));
    let spacing = std::mem::take(&mut ui.spacing_mut().item_spacing.y);
    let parameters = shown.situation.chain.parameters();
    for (index, row) in rows.iter().enumerate() {
        row_ui(ui, ctx, &columns, row, (index, parameters.get(index).copied()));
    }
    ui.spacing_mut().item_spacing.y = spacing;
}

fn row_ui(
    ui: &mut Ui,
    ctx: &mut PanelContext<'_>,
    columns: &SigmaColumns,
    row: &PlannedRow<'_>,
    (number, parameter): (usize, Option<crate::gimbal::ParameterId>),
) {
    let theme = *ctx.theme;
    let (_, rect) = ui.allocate_space(vec2(columns.width.max(ui.available_width()), ROW_HEIGHT));
    let (sense, role) = ctx.presentation.clickable(Role::Label);
    let response = ui.interact(rect, ui.unique_id().with(("plan row", number)), sense);
    let is_selected = parameter.is_some() && ctx.selection.parameter == parameter;
    let sentence = row.sentence();
    response.widget_info(|| WidgetInfo::selected(role, true, is_selected, &sentence));
    let painter = ui.painter_at(rect);
    if number % 2 == 1 {
        painter.rect_filled(rect, 0.0, theme.surface_raised.gamma_multiply(0.35));
    }
    for (column, left, width) in &columns.shown {
        let (left, width) = (rect.left() + left, *width);
        if *column == SigmaColumn::Bar {
            let place = Rect::from_x_y_ranges(left..=left + width, rect.top() + 3.0..=rect.bottom() - 3.0);
            paint_bar(&painter, &theme, place, row);
            continue;
        }
        let (text, font, color) = row.cell(*column, &theme);
        let color = if is_selected && *column == SigmaColumn::Parameter { theme.accent } else { color };
        let (x, align) =
            if is_number(*column) { (left + width, Align2::RIGHT_CENTER) } else { (left, Align2::LEFT_CENTER) };
        painter.text(pos2(x, rect.center().y), align, text, font, color);
    }
    if is_selected || response.hovered() && !ctx.presentation.is_figure() {
        let stroke = Stroke::new(1.0, if is_selected { theme.accent } else { theme.outline });
        painter.rect_stroke(rect, 0.0, stroke, StrokeKind::Inside);
    }
    if response.hovered() {
        offer(ui, sentence);
        if let Some(parameter) = parameter {
            offer_item(ui, Item::Parameter(parameter));
        }
    }
    if response.clicked() {
        ctx.selection.parameter = parameter;
    }
}

/// Draws σ / prior from 0 to 1 with the limits of the verdicts, the value before the last change as an outline, and that
/// of the log alone as a thin mark.
fn paint_bar(painter: &egui::Painter, theme: &Theme, rect: Rect, row: &PlannedRow<'_>) {
    let x = |ratio: f64| rect.left() + ratio.clamp(0.0, 1.0) as f32 * rect.width();
    let to = |ratio: f64| Rect::from_x_y_ranges(rect.left()..=x(ratio), rect.y_range());
    painter.rect_filled(rect, 0.0, theme.plot_background);
    let (_, color) = look_of(row.last.verdict, theme);
    painter.rect_filled(to(row.last.ratio), 0.0, color);
    if let Some(before) = row.ratio_before {
        painter.rect_stroke(to(before), 0.0, Stroke::new(1.0, theme.text), StrokeKind::Inside);
    }
    for limit in [DETERMINED_RATIO, NOT_DETERMINED_RATIO] {
        painter.vline(x(limit), rect.y_range(), Stroke::new(1.0, theme.outline));
    }
    if let Some(flight) = row.flight {
        painter.vline(x(flight.ratio), rect.expand2(vec2(0.0, 2.0)).y_range(), Stroke::new(1.5, theme.text_strong));
    }
}
