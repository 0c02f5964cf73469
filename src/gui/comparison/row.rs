//! One row of a plot over time: name and values at the cursor on the left, curves on the right.

use egui::{Align2, Color32, Shape, Stroke, Ui, pos2, vec2};

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
/// Width of a row in points below which names and values are above the plot.
const MIN_WIDTH_FOR_NAMES: f32 = 340.0;
/// Height of a line of names and values in points.
const NAME_HEIGHT: f32 = 13.0;
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
    /// True if values are constant until the next one.
    pub(super) steps: bool,
    /// Unique in the panel.
    pub(super) id: usize,
    pub(super) label: &'a str,
    pub(super) hover: &'a str,
}

/// Cached curves of a line: of its values and of their bound.
#[derive(Debug, Default)]
pub(super) struct LineCurves {
    values: Curve,
    bound: Curve,
}

/// The values of one run in a row.
pub(super) struct Line<'a> {
    /// Index of the column for colour and dashes: the index of the run or, counted after the runs, of the trajectory.
    pub(super) run: usize,
    pub(super) epoch: u64,
    pub(super) stamps_ns: &'a [i64],
    pub(super) values: &'a [f64],
    /// Bound of the values by frame; empty without one.
    pub(super) bound: &'a [f64],
    /// Value at the cursor.
    pub(super) text: Option<String>,
    /// Stamp of a triangle on the upper edge.
    pub(super) mark_ns: Option<i64>,
}

/// Draws a row; `curves` are the cached curves of the lines.
pub(super) fn row_ui(
    ui: &mut Ui,
    ctx: &mut PanelContext<'_>,
    row: &Row<'_>,
    lines: &[Line<'_>],
    curves: &mut [LineCurves],
    height: f32,
) {
    let theme = *ctx.theme;
    let (_, whole) = ui.allocate_space(vec2(ui.available_width(), height));
    let beside = whole.width() >= MIN_WIDTH_FOR_NAMES;
    let outer = if beside {
        whole.with_min_x(whole.left() + NAMES.min(0.4 * whole.width()))
    } else {
        whole.with_min_y(whole.top() + NAME_HEIGHT + 2.0)
    };
    let rect = within_gutters(outer, TIME_GUTTER);
    let (begin_ns, end_ns) = visible_range(ctx);
    let mut area = PlotArea { rect, begin_ns, end_ns, low: 0.0, high: 1.0, middle: None };
    let mut max_value = 0.0_f64;
    let most = |curve: &Curve| curve.extent.map_or(0.0, |(_, max_value)| max_value);
    let mut max_bound = 0.0_f64;
    for (line, curves) in lines.iter().zip(curves.iter_mut()) {
        curves.values.update(&area, line.epoch, line.stamps_ns, line.values);
        curves.bound.update(&area, line.epoch, line.stamps_ns, line.bound);
        max_value = max_value.max(most(&curves.values));
        max_bound = max_bound.max(most(&curves.bound));
    }
    // A bound far above all values does not flatten their curves; a figure shows more of it.
    let most_above = if ctx.presentation.is_figure() { 12.0 } else { 3.0 };
    max_value = max_value.max(max_bound.min(most_above * max_value));
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
    let names = if beside { whole.with_max_x(rect.left() - VALUE_GUTTER) } else { whole.with_max_y(outer.top()) };
    let names = painter.with_clip_rect(names);
    let mut at = whole.left_top() + vec2(2.0, 0.0);
    // Texts are below each other beside the plot, and in one line above it.
    let mut write = |text: &str, color: Color32| {
        let written = names.text(at, Align2::LEFT_TOP, text, theme::label_font(), color);
        at += if beside { vec2(0.0, NAME_HEIGHT) } else { vec2(written.width() + 8.0, 0.0) };
    };
    write(&name, theme.text);
    let inner = painter.with_clip_rect(rect);
    for (line, curves) in lines.iter().zip(curves.iter()) {
        let color = if lines.len() == 1 { theme.text_weak } else { style_of(ctx.recording, &theme, line.run).color };
        paint_curve(&inner, &area, &curves.bound, RunStyle { color, dashes: BOUND_DASHES }, 0.6 * CURVE_WIDTH);
    }
    for (line, curves) in lines.iter().zip(curves.iter()) {
        let style = style_of(ctx.recording, &theme, line.run);
        if row.steps {
            paint_steps(&inner, &area, &curves.values, style, CURVE_WIDTH);
        } else {
            paint_curve(&inner, &area, &curves.values, style, CURVE_WIDTH);
        }
        let mark = line.mark_ns.map(|stamp_ns| area.x(stamp_ns)).filter(|x| rect.x_range().contains(*x));
        if let Some(x) = mark {
            let triangle = vec![pos2(x - 4.0, rect.top()), pos2(x + 4.0, rect.top()), pos2(x, rect.top() + 7.0)];
            painter.add(Shape::convex_polygon(triangle, style.color, Stroke::NONE));
        }
        if let Some(text) = &line.text {
            write(text, style.color);
        }
    }
    if !beside && curves.iter().any(|curves| curves.bound.extent.is_some()) {
        write("dashed: 3σ", theme.text_weak);
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
    let readout = Readout { key: row.label, lines: &read, factor: row.factor, unit: &unit, whole: row.unit.is_empty() };
    plot_ui(ui, ctx, &area, &plot, &readout).on_hover_text(row.hover);
}
