//! The rectangle of a plot with its axes, and ranges of time on it.

use egui::{Rangef, Rect};

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
    /// Ends of the middle part of a broken scale, beyond which values are compressed; `None` for one linear scale.
    pub(crate) middle: Option<[f64; 2]>,
}

/// Height of the part above the middle of a broken scale, and of the part below, as ratios of the plot's height.
const OUTER: f64 = 0.18;

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
        let fraction = match self.scale() {
            None => (value - self.low) / (self.high - self.low),
            Some(knots) => interpolated(&knots, value),
        };
        self.rect.bottom() - fraction.clamp(-4.0, 5.0) as f32 * self.rect.height()
    }

    /// Value at a screen y.
    pub(crate) fn value_at(&self, y: f32) -> f64 {
        let fraction = f64::from((self.rect.bottom() - y) / self.rect.height().max(1.0));
        match self.scale() {
            None => self.low + fraction * (self.high - self.low),
            Some(knots) => interpolated(&knots.map(|[value, fraction]| [fraction, value]), fraction),
        }
    }

    /// Breaks the scale at the ends of its middle part, which gets most of the height.
    pub(crate) fn broken(self, middle: [f64; 2]) -> Self {
        let [from, to] = middle;
        let inside = self.low <= from && from < to && to <= self.high && (self.low < from || to < self.high);
        Self { middle: inside.then_some(middle), ..self }
    }

    /// Values and fractions of the height of a broken scale.
    fn scale(&self) -> Option<[[f64; 2]; 4]> {
        let [from, to] = self.middle?;
        let (below, above) = (if self.low < from { OUTER } else { 0.0 }, if to < self.high { OUTER } else { 0.0 });
        Some([[self.low, 0.0], [from, below], [to, 1.0 - above], [self.high, 1.0]])
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

/// Ordinate at an abscissa on a line through four points, which continues beyond its ends.
fn interpolated(points: &[[f64; 2]; 4], at: f64) -> f64 {
    let piece = if at < points[1][0] { 0 } else { usize::from(at > points[2][0]) + 1 };
    // Without an outer part the middle continues.
    let piece = if points[piece][0] < points[piece + 1][0] { piece } else { 1 };
    let [[x0, y0], [x1, y1]] = [points[piece], points[piece + 1]];
    y0 + (at - x0) / (x1 - x0) * (y1 - y0)
}

/// Time ranges of the rows for which `holds` is true: from the stamp of the first row to the stamp of the row after the
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
    use egui::pos2;

    use super::*;

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
        let area = PlotArea { rect, begin_ns: 0, end_ns: 12_000, low: 0.0, high: 1.0, middle: None };
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
        let area =
            PlotArea { rect, begin_ns: 5, end_ns: 5_000_005, low: 0.0, high: 0.0, middle: None }.with_values(2.0, 2.0);
        assert_eq!(area.stamp_ns_at(area.x(2_500_005)), 2_500_005);
        assert_eq!(area.y(2.0), 35.0);
        let tall = area.with_values(-3.0, 5.0);
        assert!((tall.value_at(tall.y(1.25)) - 1.25).abs() < 1e-6);
        let broken = tall.broken([0.0, 0.5]);
        for value in [-3.0, -1.0, 0.0, 0.2, 0.5, 3.0, 5.0] {
            assert!((broken.value_at(broken.y(value)) - value).abs() < 1e-5, "{value}");
        }
        let height = |area: &PlotArea| area.y(0.0) - area.y(0.5);
        assert!(
            height(&broken) > 8.0 * height(&tall) && broken.y(5.0) == rect.top() && broken.y(-3.0) == rect.bottom()
        );
        let above = tall.broken([-3.0, 0.0]);
        assert!(above.y(-3.0) == rect.bottom() && above.y(0.0) > above.y(0.5) && above.y(5.0) == rect.top());
        assert_eq!(tall.broken([-3.0, 5.0]).middle, None);
        let nothing = PlotArea { end_ns: 5, ..area }.with_values(f64::NAN, f64::NAN);
        assert!(nothing.x(5).is_finite() && nothing.y(0.3).is_finite());
    }
}
