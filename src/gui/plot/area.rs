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

    /// Value at a screen y.
    pub(crate) fn value_at(&self, y: f32) -> f64 {
        let fraction = f64::from((self.rect.bottom() - y) / self.rect.height().max(1.0));
        self.low + fraction * (self.high - self.low)
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
        let tall = area.with_values(-3.0, 5.0);
        assert!((tall.value_at(tall.y(1.25)) - 1.25).abs() < 1e-6);
        let nothing = PlotArea { end_ns: 5, ..area }.with_values(f64::NAN, f64::NAN);
        assert!(nothing.x(5).is_finite() && nothing.y(0.3).is_finite());
    }
}
