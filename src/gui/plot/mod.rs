//! Small plots over time: mapping to the screen, ticks, curves, bands, hatching.
//!
//! All plots over time use the time range of [`Selection`](super::Selection), so that zooming one zooms all.

mod curve;
mod navigate;
mod run_legend;
mod ticks;

use egui::containers::scroll_area::ScrollAreaOutput;
use egui::epaint::{Mesh, Vertex, WHITE_UV};
use egui::{Align2, Color32, Painter, Pos2, Rangef, Rect, Shape, Stroke, pos2};

pub(crate) use curve::{BandCurve, Curve, StateCurve};
pub(crate) use navigate::{Clicks, Interaction, Wheel, navigate, visible_range, zoom_about_cursor};
pub(crate) use run_legend::run_legend_ui;
pub(crate) use ticks::{decimals_of_step, ticks};

use super::theme::{self, RunStyle, Theme};

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PlotArea {
    /// Screen rectangle in points.
    pub(crate) rect: Rect,
    /// Stamp at the left edge, in nanoseconds since the log began.
    pub(crate) begin_ns: i64,
    /// Stamp at the right edge.
    pub(crate) end_ns: i64,
    /// Value at the lower edge.
    pub(crate) low: f64,
    /// Value at the upper edge.
    pub(crate) high: f64,
}

impl PlotArea {
    /// Distance to the right of the left edge in points, limited to one plot width outside: dashes along a very long
    /// line would exhaust the memory.
    pub(crate) fn offset_of(&self, stamp_ns: i64) -> f32 {
        let span_ns = self.end_ns.saturating_sub(self.begin_ns).max(1);
        let fraction = stamp_ns.saturating_sub(self.begin_ns) as f64 / span_ns as f64;
        fraction.clamp(-1.0, 2.0) as f32 * self.rect.width()
    }

    /// Screen x of a stamp.
    pub(crate) fn x(&self, stamp_ns: i64) -> f32 {
        self.rect.left() + self.offset_of(stamp_ns)
    }

    /// Screen y of a value, limited to a few heights of the plot to avoid overflow.
    pub(crate) fn y(&self, value: f64) -> f32 {
        let fraction = ((value - self.low) / (self.high - self.low)).clamp(-4.0, 5.0);
        self.rect.bottom() - fraction as f32 * self.rect.height()
    }

    /// Stamp at a screen x.
    pub(crate) fn stamp_ns_at(&self, x: f32) -> i64 {
        let fraction = f64::from((x - self.rect.left()) / self.rect.width().max(1.0));
        self.begin_ns + (fraction * (self.end_ns - self.begin_ns) as f64).round() as i64
    }

    /// Sets the range of values; an empty range is extended.
    pub(crate) fn with_values(mut self, low: f64, high: f64) -> Self {
        let (low, high) = if low.is_finite() && high.is_finite() && low <= high { (low, high) } else { (0.0, 1.0) };
        let min_span = (1e-9_f64).max(low.abs().max(high.abs()) * 1e-9);
        let widen = if high - low < min_span { min_span } else { 0.0 };
        (self.low, self.high) = (low - widen, high + widen);
        self
    }
}

/// True if the content of a list is higher than its panel.
pub(crate) fn overflows<R>(list: &ScrollAreaOutput<R>) -> bool {
    list.content_size.y > list.inner_rect.height() + 1.0
}

/// Paints background and border of a plot.
pub(crate) fn paint_ground(painter: &Painter, theme: &Theme, rect: Rect) {
    painter.rect_filled(rect, 0.0, theme.plot_background);
}

/// Draws horizontal grid lines with their values inside the left edge; `factor` converts stored values to shown ones.
pub(crate) fn paint_value_grid(painter: &Painter, theme: &Theme, area: &PlotArea, factor: f64, max_count: usize) {
    let (marks, step) = ticks(area.low * factor, area.high * factor, max_count);
    for shown in marks {
        let y = area.y(shown / factor).round() + 0.5;
        painter.hline(area.rect.x_range(), y, Stroke::new(theme::HAIRLINE_WIDTH, theme.grid));
        // Labels that would extend beyond the plot are omitted.
        if y - 12.0 > area.rect.top() && y < area.rect.bottom() + 1.0 {
            let text = super::units::fixed(shown, decimals_of_step(step));
            let at = pos2(area.rect.left() + 2.0, y);
            painter.text(at, Align2::LEFT_BOTTOM, text, theme::number_font(), theme.text_weak);
        }
    }
}

/// Draws the cursor as a vertical line.
pub(crate) fn paint_cursor(painter: &Painter, theme: &Theme, area: &PlotArea, cursor_ns: i64) {
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

/// Fills the area of a band.
pub(crate) fn paint_band(painter: &Painter, area: &PlotArea, band: &BandCurve, fill: Color32) {
    for segment in &band.segments {
        let mut mesh = Mesh::default();
        for (offset, low, high) in segment {
            for value in [*low, *high] {
                let pos = pos2(area.rect.left() + offset, area.y(value));
                mesh.vertices.push(Vertex { pos, uv: WHITE_UV, color: fill });
            }
        }
        for corner in (2..mesh.vertices.len() as u32).step_by(2) {
            mesh.add_triangle(corner - 2, corner - 1, corner);
            mesh.add_triangle(corner - 1, corner, corner + 1);
        }
        painter.add(Shape::mesh(mesh));
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

/// Time ranges of the rows for which `holds` is true: from the stamp of the first row to that of the row after the
/// last.
fn segments_where(stamps_ns: &[i64], holds: impl Fn(usize) -> bool) -> Vec<(i64, i64)> {
    let mut segments = Vec::new();
    let mut begin = None;
    for (row, stamp_ns) in stamps_ns.iter().enumerate() {
        match (begin, holds(row)) {
            (None, true) => begin = Some(*stamp_ns),
            (Some(since), false) => {
                segments.push((since, *stamp_ns));
                begin = None;
            }
            _ => {}
        }
    }
    if let (Some(since), Some(last)) = (begin, stamps_ns.last()) {
        segments.push((since, *last));
    }
    segments
}

/// The same ranges on the screen, from left to right. Ranges less than a pixel apart are merged, so that a flickering
/// state has no more ranges than the plot has columns.
pub(crate) fn visible_segments(area: &PlotArea, stamps_ns: &[i64], holds: impl Fn(usize) -> bool) -> Vec<Rangef> {
    let mut visible: Vec<Rangef> = Vec::new();
    for (begin_ns, end_ns) in segments_where(stamps_ns, holds) {
        let segment = Rangef::new(area.x(begin_ns), area.x(end_ns)).intersection(area.rect.x_range());
        if segment.max < segment.min {
            continue;
        }
        match visible.last_mut() {
            Some(last) if segment.min < last.max + 1.0 => last.max = segment.max.max(last.max),
            _ => visible.push(segment),
        }
    }
    visible
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

    #[test]
    fn segments_join_rows() {
        let stamps = [0, 10, 20, 30, 40];
        let holds = [true, true, false, true, true];
        assert_eq!(segments_where(&stamps, |row| holds[row]), [(0, 20), (30, 40)]);
        assert!(segments_where(&[], |_| true).is_empty());
    }

    #[test]
    fn a_flickering_state_has_few_segments() {
        let rect = Rect::from_min_max(pos2(0.0, 0.0), pos2(100.0, 10.0));
        let area = PlotArea { rect, begin_ns: 0, end_ns: 12_000, low: 0.0, high: 1.0 };
        let stamps: Vec<i64> = (0..12_000).collect();
        let flickers = visible_segments(&area, &stamps, |row| row % 2 == 0);
        assert!(flickers.len() == 1 && flickers[0].max > 99.0, "{flickers:?}");
        let apart = visible_segments(&area, &stamps, |row| row < 600 || row >= 6000 && row < 12_000);
        assert_eq!(apart.len(), 2);
        assert!((apart[0].max - 5.0).abs() < 0.02 && (apart[1].min - 50.0).abs() < 0.02, "{apart:?}");
        // There is nothing beyond the edges.
        let later = PlotArea { begin_ns: 20_000, end_ns: 30_000, ..area };
        assert!(visible_segments(&later, &stamps, |_| true).is_empty());
    }

    #[test]
    fn the_mapping_goes_back_and_forth_and_survives_empty_ranges() {
        let rect = Rect::from_min_max(pos2(100.0, 10.0), pos2(300.0, 60.0));
        let area = PlotArea { rect, begin_ns: 5, end_ns: 5_000_005, low: 0.0, high: 0.0 }.with_values(2.0, 2.0);
        assert_eq!(area.stamp_ns_at(area.x(2_500_005)), 2_500_005);
        assert_eq!(area.y(2.0), 35.0);
        let nothing = PlotArea { end_ns: 5, ..area }.with_values(f64::NAN, f64::NAN);
        assert!(nothing.x(5).is_finite() && nothing.y(0.3).is_finite());
    }
}
