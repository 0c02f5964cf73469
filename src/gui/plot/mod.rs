//! Small plots over time: mapping to the screen, ticks, curves, bands, hatching.
//!
//! All plots over time use the time range of [`Selection`](super::Selection), so that zooming one zooms all.

mod area;
mod axes;
mod axis;
mod curve;
mod navigate;
mod on_screen;
pub(in crate::gui) mod pan_zoom;
mod readout;
mod run_legend;
mod value_axis;
mod value_plot;

use egui::containers::scroll_area::ScrollAreaOutput;
use egui::{Color32, Painter, Pos2, Rect, Response, Shape, Stroke, Ui, pos2};

pub(crate) use area::{PlotArea, visible_segments};
pub(crate) use axes::{TICKS_ONLY, TIME_GUTTER, VALUE_GUTTER, paint_time_axis, paint_value_axis, within_gutters};
pub(crate) use axis::{ValueAxis, decimals_of_step, ticks};
pub(crate) use curve::{BandCurve, Curve, StateCurve};
pub(crate) use navigate::{Clicks, Interaction, Wheel, navigate, visible_range, zoom_about_cursor};
pub(crate) use on_screen::{PlotOnScreen, plot_under_pointer, register};
pub(crate) use readout::{ReadLine, Readout, paint_time_labels, paint_times, paint_values, read_lines};
pub(crate) use run_legend::run_legend_ui;
pub(crate) use value_axis::value_range_of;
pub(crate) use value_plot::{GridLine, ValuePlot, paint_between};

use self::readout::paint_readout;
use self::value_axis::value_axis_ui;
use super::PanelContext;
use super::theme::{RunStyle, Theme};

/// Completes a plot whose curves are painted: the cursor, events, reading cursors and the pointer's time with values,
/// and navigation with the pointer.
pub(crate) fn plot_ui(
    ui: &Ui,
    ctx: &mut PanelContext<'_>,
    area: &PlotArea,
    plot: &Interaction<'_>,
    readout: &Readout<'_>,
) -> Response {
    register(ui, area, readout.key);
    let response = navigate(ui, ctx, area, plot);
    value_axis_ui(ui, ctx, area, readout.key, plot, response.hovered());
    if ctx.presentation.shows_cursor() {
        paint_cursor(&ui.painter_at(area.rect), ctx.theme, area, ctx.cursor_ns);
    }
    paint_readout(ui, ctx, area, readout, response.hovered());
    response
}

/// True if the content of a list is higher than its panel.
pub(crate) fn overflows<R>(list: &ScrollAreaOutput<R>) -> bool {
    list.content_size.y > list.inner_rect.height() + 1.0
}

/// Paints background and border of a plot.
pub(crate) fn paint_ground(painter: &Painter, theme: &Theme, rect: Rect) {
    painter.rect_filled(rect, 0.0, theme.plot_background);
}

/// Draws the cursor as a vertical line.
fn paint_cursor(painter: &Painter, theme: &Theme, area: &PlotArea, cursor_ns: i64) {
    let x = area.x(cursor_ns);
    if area.rect.x_range().expand(0.5).contains(x) {
        painter.vline(x, area.rect.y_range(), Stroke::new(1.0, theme.cursor.gamma_multiply(0.8)));
    }
}

/// Draws a curve with a run's colour and dashes.
pub(crate) fn paint_curve(painter: &Painter, area: &PlotArea, curve: &Curve, style: RunStyle, width: f32) {
    for segment in &curve.segments {
        let points: Vec<Pos2> =
            segment.iter().map(|(offset, value)| pos2(area.rect.left() + offset, area.y(*value))).collect();
        paint_line(painter, &points, style, width);
    }
}

/// Draws a curve whose value is constant until the next row, for counts and states.
pub(crate) fn paint_steps(painter: &Painter, area: &PlotArea, curve: &Curve, style: RunStyle, width: f32) {
    for segment in &curve.segments {
        let places = segment.iter().map(|(offset, value)| pos2(area.rect.left() + offset, area.y(*value)));
        paint_line(painter, &staircase(places), style, width);
    }
}

/// The corners of a step curve: horizontal from each position to the next, then vertical.
fn staircase(places: impl Iterator<Item = Pos2>) -> Vec<Pos2> {
    let mut corners: Vec<Pos2> = Vec::new();
    for place in places {
        let Some(last) = corners.last().copied() else {
            corners.push(place);
            continue;
        };
        let foot = pos2(place.x, last.y);
        match corners.as_mut_slice() {
            // A horizontal line is extended.
            [.., begin, end] if begin.y == end.y => *end = foot,
            _ => corners.push(foot),
        }
        if place.y != foot.y {
            corners.push(place);
        }
    }
    corners
}

/// Draws an open line with dashes; a single point becomes a dot.
pub(crate) fn paint_line(painter: &Painter, points: &[Pos2], style: RunStyle, width: f32) {
    let stroke = Stroke::new(width, style.color);
    match points {
        [] => {}
        [point] => {
            painter.circle_filled(*point, width, style.color);
        }
        _ if style.dashes.is_empty() => {
            painter.add(Shape::line(points.to_vec(), stroke));
        }
        _ => {
            let dashes: Vec<f32> = style.dashes.iter().copied().step_by(2).collect();
            let gaps: Vec<f32> = style.dashes.iter().copied().skip(1).step_by(2).collect();
            painter.extend(Shape::dashed_line_with_offset(points, stroke, &dashes, &gaps, 0.0));
        }
    }
}

pub(crate) fn paint_band(painter: &Painter, area: &PlotArea, band: &BandCurve, fill: Color32) {
    for segment in &band.segments {
        let at = |offset: f32, value: f64| pos2(area.rect.left() + offset, area.y(value));
        let pairs = segment.iter().map(|(offset, low, high)| [at(*offset, *low), at(*offset, *high)]);
        paint_between(painter, pairs, fill);
    }
}

/// Draws diagonal hatching in a rectangle of a plot.
pub(crate) fn paint_hatch(painter: &Painter, rect: Rect, color: Color32) {
    const SPACING: f32 = 6.0;
    if rect.width() < 0.5 || rect.height() < 0.5 {
        return;
    }
    let painter = painter.with_clip_rect(painter.clip_rect().intersect(rect));
    // The lines have fixed screen positions, so that adjacent rectangles join.
    let first = ((rect.left() + rect.top()) / SPACING).floor() as i64;
    let last = ((rect.right() + rect.bottom()) / SPACING).ceil() as i64;
    let lines = (first..=last).map(|line| {
        let sum = line as f32 * SPACING;
        let points = [pos2(sum - rect.top(), rect.top()), pos2(sum - rect.bottom(), rect.bottom())];
        Shape::line_segment(points, Stroke::new(1.0, color))
    });
    painter.extend(lines);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_staircase_is_level_or_upright_everywhere() {
        let places = [(0.0, 5.0), (1.0, 5.0), (2.0, 5.0), (3.0, 4.0), (4.0, 4.0), (5.0, 4.0), (6.0, 5.0), (7.0, 5.0)];
        let corners = staircase(places.into_iter().map(|(x, y)| pos2(x, y)));
        let expected = [(0.0, 5.0), (3.0, 5.0), (3.0, 4.0), (6.0, 4.0), (6.0, 5.0), (7.0, 5.0)];
        assert_eq!(corners, expected.map(|(x, y)| pos2(x, y)));
        assert_eq!(staircase([pos2(1.0, 2.0)].into_iter()), [pos2(1.0, 2.0)]);
    }
}
