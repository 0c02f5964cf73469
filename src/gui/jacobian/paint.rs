//! Painting of the blocks as one mesh, of the names on both axes, and of the legend.

use std::sync::Arc;

use egui::epaint::{Mesh, TextShape};
use egui::{Align2, Color32, Painter, Rect, Shape, Stroke, StrokeKind, Ui, pos2, vec2};

use super::model::{ColumnStrip, JacobianModel, MatrixAxis, ONE_GROUP};
use crate::gui::plot::paint_ground;
use crate::gui::theme::{Theme, ThemeName, label_font};
use crate::session::StepRecord;

/// Minimum width in points of a row or column with a name.
const MIN_NAMED_WIDTH: f32 = 11.0;

/// Blocks as triangles, cached while step, rectangle and colours stay the same.
#[derive(Debug, Default)]
pub(super) struct CachedMesh {
    of: Option<(Arc<StepRecord>, Rect, Rect, ThemeName)>,
    mesh: Arc<Mesh>,
}

impl CachedMesh {
    /// Paints all non-zero blocks.
    pub(super) fn paint(&mut self, ui: &Ui, theme: &Theme, area: Rect, place: Rect, model: &JacobianModel) {
        let painter = ui.painter_at(area);
        paint_ground(&painter, theme, area);
        let fresh = self.of.as_ref().is_some_and(|(step, known_area, known_place, name)| {
            Arc::ptr_eq(step, &model.step) && (*known_area, *known_place, *name) == (area, place, theme.name)
        });
        if !fresh {
            self.mesh = Arc::new(mesh_of(theme, area, place, model));
            self.of = Some((Arc::clone(&model.step), area, place, theme.name));
        }
        painter.add(Shape::mesh(Arc::clone(&self.mesh)));
        let line = Stroke::new(1.0, theme.outline);
        for group in &model.columns.groups {
            painter.vline(place.left() + group.end * place.width(), area.y_range(), line);
        }
        for group in &model.rows.groups {
            painter.hline(area.x_range(), place.top() + group.end * place.height(), line);
        }
    }
}

fn mesh_of(theme: &Theme, area: Rect, place: Rect, model: &JacobianModel) -> Mesh {
    /// Gap between wide blocks in points.
    const GAP: f32 = 0.5;
    let mut mesh = Mesh::default();
    for (number, row) in model.jacobian.rows.iter().enumerate() {
        for (column, norm) in &row.norms {
            let rect = rect_of(model, place, number, usize::from(*column));
            if !rect.intersects(area) {
                continue;
            }
            let gap = vec2(if rect.width() > 6.0 { GAP } else { 0.0 }, if rect.height() > 4.0 { GAP } else { 0.0 });
            mesh.add_colored_rect(rect.shrink2(gap), theme.height_color(model.color_fraction(*norm)));
        }
    }
    mesh
}

/// Height of the column names in points; larger than the height for a chain if the names of sensors are longer.
pub(super) fn column_names_height(ui: &Ui, model: &JacobianModel) -> f32 {
    /// Height with the columns of a chain, and height of the names of groups, in points.
    const OF_CHAIN: f32 = 68.0;
    const GROUP: f32 = 20.0;
    if model.columns.groups.first().is_none_or(|group| group.name == ONE_GROUP) {
        return OF_CHAIN;
    }
    let width = |strip: &ColumnStrip| {
        let name = short_name(strip).to_owned();
        ui.painter().layout_no_wrap(name, label_font(), Color32::PLACEHOLDER).size().x
    };
    OF_CHAIN.max(GROUP + model.columns.strips.iter().map(width).fold(0.0, f32::max))
}

/// Name of a column under the name of its group; frames are labelled by their number.
fn short_name(strip: &ColumnStrip) -> &str {
    strip.name.rsplit(' ').next().unwrap_or(&strip.name)
}

/// Draws the names on both axes, and the selection.
pub(super) fn axes(
    ui: &Ui,
    theme: &Theme,
    whole: Rect,
    area: Rect,
    place: Rect,
    model: &JacobianModel,
    selected_block: Option<(Option<usize>, Option<usize>)>,
) {
    let (row, column) = selected_block.unwrap_or_default();
    let left = Rect::from_min_max(pos2(whole.left(), area.top()), area.left_bottom());
    row_names(&ui.painter_at(left), theme, left, place, &model.rows, row);
    let top = Rect::from_min_max(pos2(area.left(), whole.top()), area.right_top());
    column_names(&ui.painter_at(top), theme, top, place, &model.columns, column);
    let corner = Rect::from_min_max(whole.min, area.min);
    let painter = ui.painter_at(corner);
    painter.text(corner.right_top() + vec2(-4.0, 2.0), Align2::RIGHT_TOP, "unknowns", label_font(), theme.text_weak);
    let foot = corner.left_bottom() - vec2(-2.0, 2.0);
    painter.text(foot, Align2::LEFT_BOTTOM, "residuals", label_font(), theme.text_weak);

    let painter = ui.painter_at(area);
    let stroke = Stroke::new(1.0, theme.accent);
    if let Some(strip) = row.map(|row| &model.rows.strips[row]) {
        let rect = Rect::from_x_y_ranges(area.x_range(), span(place.top(), place.height(), strip));
        painter.rect_stroke(rect.expand2(vec2(0.0, 1.0)), 0.0, stroke, StrokeKind::Outside);
    }
    if let Some(strip) = column.map(|column| &model.columns.strips[column]) {
        let rect = Rect::from_x_y_ranges(span(place.left(), place.width(), strip), area.y_range());
        painter.rect_stroke(rect.expand2(vec2(1.0, 0.0)), 0.0, stroke, StrokeKind::Outside);
    }
}

fn span(start: f32, length: f32, strip: &ColumnStrip) -> egui::Rangef {
    egui::Rangef::new(start + strip.begin * length, start + strip.end * length)
}

fn row_names(painter: &Painter, theme: &Theme, left: Rect, place: Rect, rows: &MatrixAxis, selected: Option<usize>) {
    let write = |range: egui::Rangef, name: &str, color: Color32| {
        let seen = range.intersection(left.y_range());
        painter.text(pos2(left.right() - 4.0, seen.center()), Align2::RIGHT_CENTER, name, label_font(), color);
    };
    for group in &rows.groups {
        let range = span(place.top(), place.height(), group);
        let members = rows.strips.iter().filter(|strip| strip.begin >= group.begin && strip.end <= group.end + 1e-6);
        let count = members.clone().count();
        let pitch = range.span() / count.max(1) as f32;
        if pitch >= MIN_NAMED_WIDTH + 1.0 {
            for strip in members {
                write(span(place.top(), place.height(), strip), &strip.name, theme.text);
            }
        } else if range.max > left.top() && range.min < left.bottom() {
            write(range, &group.name, theme.text);
        }
    }
    if let Some(strip) = selected.map(|row| &rows.strips[row]) {
        let range = span(place.top(), place.height(), strip);
        if left.y_range().contains(range.center()) {
            let line = Rect::from_center_size(pos2(left.center().x, range.center()), vec2(left.width(), 13.0));
            painter.rect_filled(line, 0.0, theme.surface);
            write(range, &strip.name, theme.accent);
        }
    }
}

fn column_names(
    painter: &Painter,
    theme: &Theme,
    top: Rect,
    place: Rect,
    columns: &MatrixAxis,
    selected: Option<usize>,
) {
    let small = label_font();
    for group in &columns.groups {
        let seen = span(place.left(), place.width(), group).intersection(top.x_range());
        if seen.span() > 0.0 {
            let painter = painter.with_clip_rect(Rect::from_x_y_ranges(seen, top.y_range()));
            let at = pos2(seen.center(), top.top() + 2.0);
            painter.text(at, Align2::CENTER_TOP, &group.name, label_font(), theme.text_strong);
        }
    }
    for (number, strip) in columns.strips.iter().enumerate() {
        let range = span(place.left(), place.width(), strip);
        let chosen = selected == Some(number);
        if range.max < top.left() || range.min > top.right() || range.span() < MIN_NAMED_WIDTH && !chosen {
            continue;
        }
        let color = if chosen { theme.accent } else { theme.text };
        let galley = painter.layout_no_wrap(short_name(strip).to_owned(), small.clone(), color);
        let foot = pos2(range.center() - 0.5 * galley.size().y, top.bottom() - 3.0);
        if chosen {
            let ground =
                Rect::from_min_max(pos2(foot.x, foot.y - galley.size().x), pos2(foot.x + galley.size().y, foot.y));
            painter.rect_filled(ground, 0.0, theme.surface);
        }
        painter.add(TextShape::new(foot, galley, color).with_angle(-std::f32::consts::FRAC_PI_2));
    }
}

/// Draws lines from the block under the pointer to both axes.
pub(super) fn hover(ui: &Ui, theme: &Theme, area: Rect, place: Rect, model: &JacobianModel, block: (usize, usize)) {
    let rect = rect_of(model, place, block.0, block.1);
    let painter = ui.painter_at(area);
    let line = Stroke::new(1.0, theme.cursor.gamma_multiply(0.5));
    painter.hline(egui::Rangef::new(area.left(), rect.left()), rect.center().y, line);
    painter.vline(rect.center().x, egui::Rangef::new(area.top(), rect.top()), line);
    painter.rect_stroke(rect, 0.0, Stroke::new(1.5, theme.cursor), StrokeKind::Outside);
}

/// Draws the colour map with powers of ten.
pub(super) fn legend(ui: &Ui, theme: &Theme, rect: Rect, model: &JacobianModel) {
    const WIDTH: f32 = 150.0;
    const STEPS: u16 = 30;
    let painter = ui.painter_at(rect);
    let (low, high) = model.decades;
    let mut at = rect.left_center();
    let text = |at: egui::Pos2, text: String| {
        let drawn = painter.text(at, Align2::LEFT_CENTER, text, label_font(), theme.text_weak);
        drawn.right() + 5.0
    };
    at.x = text(at, format!("block norm, 1e{low:.0}"));
    let bar = Rect::from_min_size(pos2(at.x, rect.center().y - 6.0), vec2(WIDTH, 12.0));
    for step in 0..STEPS {
        let [left, right] = [step, step + 1].map(|edge| bar.left() + WIDTH * f32::from(edge) / f32::from(STEPS));
        let color = theme.height_color((f64::from(step) + 0.5) / f64::from(STEPS));
        painter.rect_filled(Rect::from_min_max(pos2(left, bar.top()), pos2(right, bar.bottom())), 0.0, color);
    }
    at.x = bar.right() + 5.0;
    text(at, format!("1e{high:.0} σ per 10°, 3 cm, 0.1 m/s, 1 °/s, 0.1 m/s², 10 % of the inverse depth"));
}

/// The screen rectangle of a block.
pub(super) fn rect_of(model: &JacobianModel, place: Rect, row: usize, column: usize) -> Rect {
    let (row, column) = (&model.rows.strips[row], &model.columns.strips[column]);
    let at = |x: f32, y: f32| pos2(place.left() + x * place.width(), place.top() + y * place.height());
    Rect::from_min_max(at(column.begin, row.begin), at(column.end, row.end))
}
