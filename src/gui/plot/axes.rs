//! Axes of plots over time: values in a gutter on the left, times in a gutter below.

use egui::{Align2, Painter, Rangef, Rect, Stroke, pos2, vec2};

use super::area::PlotArea;
use super::axis::{decimals_of_step, ticks};
use crate::geometry::seconds_from_ns;
use crate::gui::theme::{HAIRLINE_WIDTH, Theme, label_font, number_font};
use crate::gui::units::fixed;

/// Width of the gutter of the values in points: seven characters.
pub(crate) const VALUE_GUTTER: f32 = 49.0;
/// The same in a narrow plot.
const NARROW_VALUE_GUTTER: f32 = 40.0;
/// Plots narrower than this have the narrow gutter, in points.
const NARROW: f32 = 220.0;
/// Height of the gutter of the times in points.
pub(crate) const TIME_GUTTER: f32 = 14.0;
/// Height of the gutter of a plot that shares the times of the plot below it, in points.
pub(crate) const TICKS_ONLY: f32 = 4.0;

/// Distance of two values on an axis in points, at least.
const VALUE_PITCH: f32 = 20.0;
/// Distance of two times on an axis in points, at least.
const TIME_PITCH: f32 = 40.0;
/// Half the height of a label in points.
const HALF_LABEL: f32 = 6.0;

/// Rectangle of the curves in the rectangle of a plot with its gutters; the gutter of the times is `below` points high.
pub(crate) fn within_gutters(outer: Rect, below: f32) -> Rect {
    let left = if outer.width() < NARROW { NARROW_VALUE_GUTTER } else { VALUE_GUTTER };
    let (left, below) = (left.min(0.5 * outer.width()), below.min(0.5 * outer.height()));
    Rect::from_min_max(outer.min + vec2(left, 0.0), outer.max - vec2(0.0, below))
}

/// Draws grid lines of values with their labels in the gutter on the left; `factor` converts stored values to shown
/// ones. On a broken scale, the compressed parts are shaded and labelled at the edges.
pub(crate) fn paint_value_axis(painter: &Painter, theme: &Theme, area: &PlotArea, factor: f64) {
    let [from, to] = area.middle.unwrap_or([area.low, area.high]);
    let height = area.y(from) - area.y(to);
    let max_count = ((height / VALUE_PITCH).round() as usize).max(1);
    let (marks, step) = ticks(from * factor, to * factor, max_count);
    let label = |shown: f64, y: f32, step: f64| {
        // A label at an edge stays between the edges.
        let (top, bottom) = (area.rect.top() + HALF_LABEL, area.rect.bottom() - HALF_LABEL);
        let at = pos2(area.rect.left() - 3.0, y.min(bottom).max(top));
        painter.text(at, Align2::RIGHT_CENTER, fixed(shown, decimals_of_step(step)), number_font(), theme.text_weak);
    };
    let ends = [(area.high, to, area.rect.top()), (area.low, from, area.rect.bottom())];
    let outer: Vec<_> = ends.into_iter().filter(|(end, inner, _)| end != inner).collect();
    for (end, inner, edge) in &outer {
        let part = Rect::from_x_y_ranges(area.rect.x_range(), Rangef::new(*edge, area.y(*inner)).as_positive());
        painter.rect_filled(part, 0.0, theme.grid.gamma_multiply(0.6));
        painter.hline(area.rect.x_range(), area.y(*inner), Stroke::new(HAIRLINE_WIDTH, theme.outline));
        // Two digits of the compressed part.
        let step = 10_f64.powf(((end - inner).abs() * factor).log10().floor());
        label(end * factor, *edge, step);
    }
    for shown in marks {
        let y = area.y(shown / factor).round() + 0.5;
        painter.hline(area.rect.x_range(), y, Stroke::new(HAIRLINE_WIDTH, theme.grid));
        if outer.iter().all(|(_, _, edge)| (y - edge).abs() > 3.0 * HALF_LABEL) {
            label(shown, y, step);
        }
    }
}

/// Draws grid lines of times, and in the gutter below their ticks and, if that is high enough, their labels.
pub(crate) fn paint_time_axis(painter: &Painter, theme: &Theme, area: &PlotArea, below: f32) {
    let (begin_s, end_s) = (seconds_from_ns(area.begin_ns), seconds_from_ns(area.end_ns));
    let max_count = ((area.rect.width() / TIME_PITCH) as usize).max(1);
    let (marks, step) = ticks(begin_s, end_s, max_count);
    let bottom = area.rect.bottom();
    for mark in marks {
        let x = area.x((mark * 1e9).round() as i64).round() + 0.5;
        painter.vline(x, area.rect.y_range(), Stroke::new(HAIRLINE_WIDTH, theme.grid));
        painter.vline(x, bottom..=bottom + 3.0, Stroke::new(HAIRLINE_WIDTH, theme.outline));
        if below < TIME_GUTTER {
            continue;
        }
        let text = format!("{} s", fixed(mark, decimals_of_step(step)));
        let galley = painter.layout_no_wrap(text, label_font(), theme.text_weak);
        let left = (x - 0.5 * galley.size().x).min(area.rect.right() - galley.size().x);
        painter.galley(pos2(left, bottom + 2.0), galley, theme.text_weak);
    }
}
