//! One row of a plot over time: name and values at the cursor on the left, curves on the right.

use egui::{Align2, Shape, Stroke, Ui, pos2, vec2};

use super::columns::style_of;
use crate::gui::PanelContext;
use crate::gui::plot::{
    Clicks, Curve, Interaction, PlotArea, ReadLine, Readout, TIME_GUTTER, VALUE_GUTTER, Wheel, paint_curve,
    paint_ground, paint_steps, paint_time_axis, paint_value_axis, plot_ui, value_range_of, visible_range,
    within_gutters,
};
use crate::gui::theme::{self, CURVE_WIDTH, RunStyle};

/// Width of names and values on the left, in points.
const NAMES: f32 = 158.0;
const BOUND_DASHES: &[f32] = &[4.0, 3.0];

/// Minimum height of a row in points; a list of rows of this height may scroll.
pub(super) const MIN_HEIGHT: f32 = 60.0;

pub(super) struct Row<'a> {
    pub(super) name: &'a str,
    /// Shown unit, empty for counts.
    pub(super) unit: &'a str,
    /// Shown value per stored value.
    pub(super) factor: f64,
    /// Stored value of the dotted line.
    pub(super) threshold: Option<f64>,
    /// Smallest upper limit of the axis, so that rounding errors are not magnified.
    pub(super) min_high: f64,
    /// Bound of the values over time, at the stamps of the first line.
    pub(super) bound: Option<Bound<'a>>,
    /// True if values are constant until the next one.
    pub(super) steps: bool,
    /// Unique in the panel.
    pub(super) id: usize,
    pub(super) label: &'a str,
    pub(super) hover: &'a str,
}

/// Bound of the values of a row, by frame.
pub(super) struct Bound<'a> {
    pub(super) values: &'a [f64],
    pub(super) curve: &'a mut Curve,
    /// Bound at the cursor.
    pub(super) text: Option<String>,
}

/// The values of one run in a row.
pub(super) struct Line<'a> {
    /// Index of the column for colour and dashes: of the run, or after the runs that of the trajectory.
    pub(super) run: usize,
    pub(super) epoch: u64,
    pub(super) stamps_ns: &'a [i64],
    pub(super) values: &'a [f64],
    /// Value at the cursor.
    pub(super) text: Option<String>,
    /// Stamp of a triangle on the upper edge.
    pub(super) mark_ns: Option<i64>,
}

/// Draws a row; `curves` are the cached curves of the lines.
pub(super) fn row_ui(
    ui: &mut Ui,
    ctx: &mut PanelContext<'_>,
    mut row: Row<'_>,
    lines: &[Line<'_>],
    curves: &mut [Curve],
    height: f32,
) {
    let theme = *ctx.theme;
    let (_, whole) = ui.allocate_space(vec2(ui.available_width(), height));
    let rect = within_gutters(whole.with_min_x(whole.left() + NAMES.min(0.4 * whole.width())), TIME_GUTTER);
    let (begin_ns, end_ns) = visible_range(ctx);
    let mut area = PlotArea { rect, begin_ns, end_ns, low: 0.0, high: 1.0 };
    let mut max_value = 0.0_f64;
    for (line, curve) in lines.iter().zip(curves.iter_mut()) {
        curve.update(&area, line.epoch, line.stamps_ns, line.values);
        max_value = max_value.max(curve.extent.map_or(0.0, |(_, max_value)| max_value));
    }
    if let (Some(bound), Some(line)) = (&mut row.bound, lines.first()) {
        bound.curve.update(&area, line.epoch, line.stamps_ns, bound.values);
        // A bound far above all values does not flatten their curves.
        let most = bound.curve.extent.map_or(0.0, |(_, max_value)| max_value);
        max_value = max_value.max(most.min(3.0 * max_value));
    }
    let (low, high) = value_range_of(ctx, row.label, 0.0, 1.15 * max_value.max(row.min_high));
    area = area.with_values(low, high);
    let painter = ui.painter_at(whole);
    paint_ground(&painter, &theme, rect);
    paint_value_axis(&painter, &theme, &area, row.factor);
    paint_time_axis(&painter, &theme, &area, TIME_GUTTER);
    let threshold = row.threshold.map(|threshold| area.y(threshold)).filter(|y| rect.y_range().contains(*y));
    if let Some(y) = threshold {
        let ends = [pos2(rect.left(), y), pos2(rect.right(), y)];
        painter.extend(Shape::dotted_line(&ends, theme.warn.gamma_multiply(0.7), 6.0, 0.7));
    }
    let name = if row.unit.is_empty() { row.name.to_owned() } else { format!("{}, {}", row.name, row.unit) };
    let names = painter.with_clip_rect(whole.with_max_x(rect.left() - VALUE_GUTTER));
    let mut at = whole.left_top() + vec2(2.0, 0.0);
    names.text(at, Align2::LEFT_TOP, name, theme::label_font(), theme.text);
    let inner = painter.with_clip_rect(rect);
    if let Some(bound) = &row.bound {
        let style = RunStyle { color: theme.text_weak, dashes: BOUND_DASHES };
        paint_curve(&inner, &area, bound.curve, style, 0.8 * CURVE_WIDTH);
    }
    for (line, curve) in lines.iter().zip(curves.iter()) {
        let style = style_of(ctx.recording, &theme, line.run);
        if row.steps {
            paint_steps(&inner, &area, curve, style, CURVE_WIDTH);
        } else {
            paint_curve(&inner, &area, curve, style, CURVE_WIDTH);
        }
        let mark = line.mark_ns.map(|stamp_ns| area.x(stamp_ns)).filter(|x| rect.x_range().contains(*x));
        if let Some(x) = mark {
            let triangle = vec![pos2(x - 4.0, rect.top()), pos2(x + 4.0, rect.top()), pos2(x, rect.top() + 7.0)];
            painter.add(Shape::convex_polygon(triangle, style.color, Stroke::NONE));
        }
        if let Some(text) = &line.text {
            at.y += 13.0;
            names.text(at, Align2::LEFT_TOP, text, theme::label_font(), style.color);
        }
    }
    if let Some(text) = row.bound.as_ref().and_then(|bound| bound.text.as_ref()) {
        at.y += 13.0;
        names.text(at, Align2::LEFT_TOP, text, theme::label_font(), theme.text_weak);
    }
    let id = ui.unique_id().with(("row over time", row.id));
    let values: Vec<&str> = lines.iter().filter_map(|line| line.text.as_deref()).collect();
    let wheel = Wheel::in_list(height <= MIN_HEIGHT);
    let plot = Interaction { id, name: row.label, value: &values.join(", "), clicks: Clicks::Seek, wheel };
    let read = lines.iter().map(|line| {
        let color = style_of(ctx.recording, &theme, line.run).color;
        ReadLine { color, stamps_ns: line.stamps_ns, values: line.values }
    });
    let read: Vec<ReadLine<'_>> = read.collect();
    let unit = if row.unit.is_empty() || row.unit == "°" { row.unit.to_owned() } else { format!(" {}", row.unit) };
    let readout = Readout {
        key: row.label,
        lines: &read,
        factor: row.factor,
        unit: &unit,
        whole: row.unit.is_empty(),
        principal: &|value| value,
    };
    plot_ui(ui, ctx, &area, &plot, &readout).on_hover_text(row.hover);
}
